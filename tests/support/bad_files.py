"""Files that nobody should send: cut, mislabelled, far larger than they look, or pointing elsewhere.

Each is (name, bytes); the suffix says where it is sent. None of them may crash a reader, keep it busy, fill the memory,
run code or read another file: `FileError`, or a reading like any other. Bits flipped
anywhere are tried by `tests/faults/mutated.py`.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import pickle
import shutil
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.support.h5_edits import attribute, fill, put, unwritten


class _Bomb:
    """What a pickle does when it is opened."""

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return (exec, ("raise SystemExit('a pickle was opened')",))


def small_map() -> NDArray[np.float32]:
    """A plate with two grooves, 60 x 80 samples."""
    z = np.zeros((60, 80), dtype=np.float32)
    z[20:40, 20:24] = z[20:40, 50:54] = -0.2
    return z


def npz(**arrays: Any) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def picture(suffix: str) -> bytes:
    """Bright on one side; plain, so that what can be read at all is soon read."""
    shade = np.broadcast_to(np.linspace(60.0, 200.0, 96)[None, :, None], (48, 96, 3))
    return bytes(cv2.imencode(suffix, shade.astype(np.uint8))[1])


@cache
def scan() -> bytes:
    """A recording of the small map, with few samples: of each file of the corpus one is written."""
    from glyphs.surface.maps import HeightMap
    from recognition.see.virtual_bench import VirtualBench
    from whisker_array.scan.recording import save_scan
    from whisker_array.whisker.array import default_plan

    height_map = HeightMap(small_map(), 0.1)
    plan = default_plan((0.0, 0.0, *height_map.size_mm), character_height_mm=5.0)
    plan = replace(plan, sample_pitch_mm=4.0 * plan.sample_pitch_mm)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "a.h5"
        save_scan(VirtualBench(height_map, 5.0).scan(plan), path)
        return path.read_bytes()


@contextlib.contextmanager
def changed_scan(out: list[bytes]) -> Iterator[h5py.File]:
    """The recording, open for changes; its bytes are put into the list."""
    stream = io.BytesIO(scan())
    with h5py.File(stream, "r+") as file:
        yield file
    out.append(stream.getvalue())


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def declared_png(cols: int, rows: int, pixels: bytes = b"\0" * 100) -> bytes:
    head = struct.pack(">IIBBBBB", cols, rows, 8, 0, 0, 0, 0)
    parts = (chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(pixels, 1)), chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _tiff(entries: list[tuple[int, int, int, int]]) -> bytes:
    body = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", *e) for e in entries)
    return b"II*\0" + struct.pack("<I", 8) + body + struct.pack("<I", 0)


def _raw_npz(members: dict[str, bytes], *, compressed: bool = True) -> bytes:
    stream = io.BytesIO()
    kind = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(stream, "w", kind, compresslevel=1) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def _npy_head(shape: tuple[int, ...], dtype: str = "<f4") -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue()


def _pitch() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.asarray(0.05))
    return stream.getvalue()


def bad_photos() -> Iterator[tuple[str, bytes]]:
    """Sent as photographs."""
    good = picture(".png")
    yield "empty.png", b""
    yield "one-byte.png", b"\x89"
    yield "head-only.png", good[:20]
    yield "truncated.png", good[: len(good) // 2]
    yield "no-end.png", good[:-12]
    yield "text.png", b"this is not a picture"
    yield "recording.png", scan()
    yield "jpeg-inside.png", picture(".jpg")
    yield "one-pixel.png", declared_png(1, 1, b"\0\0")
    yield "no-columns.png", declared_png(0, 100)
    yield "black-8x8.png", declared_png(8, 8, b"\0" * 72)
    yield "declared-60000x60000.png", declared_png(60_000, 60_000)
    yield "declared-2e9.png", declared_png(2_000_000_000, 2_000_000_000)
    yield "bomb-12000x12000.png", declared_png(12_000, 12_000, b"\0" * (12_001 * 12_000))
    yield "short-data.png", declared_png(2_000, 2_000)
    yield "text-bomb.png", _with_text_bomb(good)
    cut = picture(".jpg")
    yield "truncated.jpg", cut[: len(cut) // 2]
    yield "markers-only.jpg", b"\xff\xd8\xff\xd9"
    at = cut.index(b"\xff\xc0")
    yield "declared-65000x65000.jpg", cut[: at + 5] + struct.pack(">HH", 65_000, 65_000) + cut[at + 9 :]
    bmp = bytes(cv2.imencode(".bmp", np.full((16, 16, 3), 99, dtype=np.uint8))[1])
    yield "declared-huge.bmp", bmp[:18] + struct.pack("<ii", 2**30, -(2**30)) + bmp[26:]
    yield "data-beyond.bmp", bmp[:10] + struct.pack("<I", 2**31) + bmp[14:]
    yield "declared-huge.tif", _tiff([(256, 4, 1, 2**31), (257, 4, 1, 2**31), (258, 3, 1, 8), (273, 4, 1, 8)])
    yield "own-offset.tif", _tiff([(256, 4, 1, 64), (257, 4, 1, 64), (273, 4, 1, 8), (279, 4, 1, 2**31)])
    yield "no-directory.tif", b"II*\0" + struct.pack("<I", 2**31)
    done, floats = cv2.imencode(".tif", np.full((32, 32), np.nan, dtype=np.float32))
    assert done
    yield "nan.tif", bytes(floats)
    yield "animation.png", b"GIF89a" + b"\0" * 64
    yield "comments.pgm", b"P2 1000 1000 255\n" + b"#\n" * 500_000 + b"1 " * 1000
    yield "comments-in-head.pgm", b"P5\n" + b"#\n" * 500_000 + b"100 100 255\n" + b"\1" * 10_000
    yield "chunks.png", good[:33] + chunk(b"tEXt", b"") * 310_000 + good[33:]
    yield "segments.jpg", cut[:2] + b"\xff\xfe\0\2" * 310_000 + cut[2:]
    yield "blocks.gif", b"GIF89a\x10\0\x10\0\0\0\0\x21\xfe" + b"\1a" * 310_000 + b"\0;"
    yield "strips.tif", _tiff([(256, 4, 1, 10), (257, 4, 1, 310_000), (258, 3, 1, 8), (273, 4, 310_000, 8)])
    yield "entries.tif", b"II+\0" + struct.pack("<HHQQ", 8, 0, 16, 310_000) + b"\0" * 20 * 310_000
    yield "drawing.png", b"<svg xmlns='http://www.w3.org/2000/svg'><image href='file:///etc/passwd'/></svg>"


def _with_text_bomb(data: bytes) -> bytes:
    body = b"Comment\0\0" + zlib.compress(b"A" * 50_000_000, 1)
    return data[:33] + chunk(b"zTXt", body) + data[33:]


def bad_maps() -> Iterator[tuple[str, bytes]]:
    """Sent as height maps."""
    z = small_map()
    good = npz(z_mm=z, pitch_mm=0.1)
    yield "empty.npz", b""
    yield "truncated.npz", good[: len(good) // 2]
    yield "picture.npz", picture(".png")
    yield "no-heights.npz", npz(pitch_mm=0.1)
    yield "no-pitch.npz", npz(z_mm=z)
    yield "nothing.npz", npz()
    yield "bools.npz", npz(z_mm=z > 0, pitch_mm=0.1)
    yield "flat.npz", npz(z_mm=np.zeros(9), pitch_mm=0.1)
    yield "strings.npz", npz(z_mm=np.full((9, 9), "deep"), pitch_mm=0.1)
    yield "pitch-string.npz", npz(z_mm=z, pitch_mm="0.1")
    yield "complex.npz", npz(z_mm=z + 1j, pitch_mm=0.1)
    yield "nan-only.npz", npz(z_mm=np.full((50, 50), np.nan), pitch_mm=0.1)
    yield "infinite.npz", npz(z_mm=np.where(z < 0, np.inf, z), pitch_mm=0.1)
    yield "beyond-floats.npz", npz(z_mm=np.full((50, 50), 1e308), pitch_mm=0.1)
    yield "one-sample.npz", npz(z_mm=np.zeros((1, 1)), pitch_mm=0.1)
    yield "two-by-two.npz", npz(z_mm=np.array([[0.0, 1.0], [0.0, 1.0]]), pitch_mm=0.1)
    yield "one-row.npz", npz(z_mm=np.zeros((1, 500)), pitch_mm=0.1)
    yield "strip.npz", npz(z_mm=np.zeros((2, 5000)), pitch_mm=0.1)
    yield "cube.npz", npz(z_mm=np.zeros((9, 9, 9)), pitch_mm=0.1)
    yield "no-samples.npz", npz(z_mm=np.zeros((0, 0)), pitch_mm=0.1)
    for name, pitch in (
        ("nan", np.nan),
        ("nought", 0.0),
        ("negative", -1.0),
        ("tiny", 1e-300),
        ("list", [1, 2]),
    ):
        yield f"pitch-{name}.npz", npz(z_mm=z, pitch_mm=pitch)
    yield "coarse.npz", npz(z_mm=np.tile(z, (20, 20)), pitch_mm=10.0)
    members = {"z_mm.npy": _npy_head((10**6, 10**6)) + b"\0" * 400, "pitch_mm.npy": _pitch()}
    yield "declared-1e12.npz", _raw_npz(members)
    yield "declared-overflow.npz", _raw_npz({**members, "z_mm.npy": _npy_head((2**40, 2**40))})
    yield "declared-negative.npz", _raw_npz({**members, "z_mm.npy": _npy_head((-5, 7))})
    yield "no-head.npz", _raw_npz({**members, "z_mm.npy": b"GIF89a"})
    yield "declared-short.npz", _raw_npz({**members, "z_mm.npy": _npy_head((500, 500)) + b"\0" * 400})
    yield "bomb.npz", _raw_npz({**members, "z_mm.npy": _npy_head((7000, 7000)) + b"\0" * 196_000_000})
    yield "bomb-beside.npz", _raw_npz({"more.npy": b"\0" * 300_000_000, "z_mm.npy": b"", "pitch_mm.npy": b""})
    yield "long-head.npz", _raw_npz({**members, "z_mm.npy": b"\x93NUMPY\x01\x00\xff\xff" + b" " * 65_535})
    yield "version-9.npz", _raw_npz({**members, "z_mm.npy": b"\x93NUMPY\x09\x00" + b" " * 100})
    yield "code-in-head.npz", _raw_npz({**members, "z_mm.npy": _python_head("__import__('os').getpid()")})
    yield "pickle.npz", _pickled()
    yield "many-members.npz", _raw_npz({f"m{k}.npy": b"" for k in range(12_000)}, compressed=False)
    yield "climbing.npz", _raw_npz({"../../z_mm.npy": b"", "/etc/z_mm.npy": b""})
    yield "zip-in-zip.npz", _raw_npz({"z_mm.npy": good, "pitch_mm.npy": _pitch()})
    yield "encrypted.npz", _encrypted(good)
    yield "no-suffix", good
    yield "one-line.txt", b"1.5 " * 500_000
    yield "script.py", b"print('hello')"
    yield "empty.x3p", b""
    yield "no-member.x3p", _raw_npz({})
    yield "nan-only.x3p", x3p(60, 80, np.nan)
    yield "truncated.x3p", x3p(60, 80)[:200]
    yield "laughs.x3p", _raw_npz({"main.xml": _laughs()})
    yield "other-entity.x3p", _raw_npz({"main.xml": _entity()})
    yield "declared-1e10.x3p", x3p(100_000, 100_000)
    yield "xml-bomb.x3p", _raw_npz({"main.xml": b"<a>" + b" " * 80_000_000 + b"</a>"})
    yield "npz.x3p", good
    yield "empty.sdf", b""
    yield "truncated.sdf", _sdf(z)[:90]
    yield "head-only.sdf", _sdf(z)[:40]
    yield "one-row.sdf", _sdf(np.zeros((1, 9)))
    yield "text.sdf", b"aISO-1.0\nNumPoints = many\nNumProfiles = 3\n*\n1 2 3\n*"
    yield "declared.sdf", b"aISO-1.0\nNumPoints = 999999\nNumProfiles = 999999\n*\n1 2 3\n*"
    yield "binary.sdf", b"bISO-1.0" + bytes(range(256)) * 4
    noise = np.random.default_rng(3).integers(0, 256, 4096, dtype=np.uint8).tobytes()
    for suffix in ("sur", "al3d", "opd", "plu", "vk4", "gwy", "mnt", "zon", "lext"):
        yield f"noise.{suffix}", noise
    yield "empty.sur", b""
    yield "magic-only.sur", b"DIGITAL SURF"
    yield "declared.sur", b"DIGITAL SURF\0" + b"\xff" * 500
    yield "recording.sur", scan()
    yield "linked.datx", _linked("external", group="Data/Surface")
    yield "counted.pcd", PCD_HEAD % 1_000_000_000 + b"\0" * 1200
    yield "counted-down.pcd", PCD_HEAD % -3 + b"\0" * 1200
    corners = b"v 0 0 0\nv 9 0 0\nv 0 9 0\nv 9 9 0\n"
    yield (
        "groups.obj",
        corners + b"".join(b"g g%d\nusemtl m%d\nf 1 2 3\nf 2 4 3\n" % (k, k) for k in range(20_000)),
    )
    facet = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 9 0 0\nvertex 0 9 0\nendloop\nendfacet\n"
    yield "solids.stl", (b"solid a\n" + facet + b"endsolid a\n") * 20_000
    ply = b"ply\nformat %s 1.0\nelement vertex 4\n%send_header\n"
    places = b"".join(b"property float %c\n" % axis for axis in b"xyz")
    yield "lines.ply", ply % (b"ascii", places) + b"\n" * 2_000_000
    lists = b"".join(b"property list uchar int p%d\n" % k for k in range(20_000))
    yield "properties.ply", ply % (b"binary_little_endian", lists) + bytes(9999)
    yield "members.npz", _raw_npz({f"m{k}": b"" for k in range(60_000)}, compressed=False)
    yield "members.x3p", _raw_npz({**{f"{k}.bin": bytes(10**6) for k in range(90)}, **_members(x3p(60, 80))})
    yield (
        "declared.tmd",
        b"Binary TrueMap Data File v2.0\r\n\0\0" + struct.pack("<iiffff", 10**9, 4, 9, 9, 0, 0),
    )
    yield "declared.nms", bytes(1368) + struct.pack("<2I2d", 2**31, 4, 1.0, 1.0) + bytes(4000)
    yield "claims.mat", _matlab_bomb(300_000_000)


PCD_HEAD = (
    b"VERSION .7\nFIELDS x y z q\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 %d\nWIDTH 100\nHEIGHT 1\nPOINTS 100\n"
    b"DATA binary\n"
)


def _members(archive: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(archive)) as file:
        return {name: file.read(name) for name in file.namelist()}


def _matlab_bomb(n_bytes: int) -> bytes:
    """A matrix of 60 x 40 whose packed numbers are far longer."""

    def element(kind: int, body: bytes) -> bytes:
        return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)

    matrix = (
        element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 60, 40)) + element(1, b"z_mm")
    )
    matrix += struct.pack("<II", 9, n_bytes)
    packer = zlib.compressobj(9)
    body = packer.compress(struct.pack("<II", 14, len(matrix) + n_bytes) + matrix)
    body += b"".join(packer.compress(bytes(10**6)) for _ in range(n_bytes // 10**6)) + packer.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return head + struct.pack("<II", 15, len(body)) + body


def _python_head(code: str) -> bytes:
    head = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({code}, 2)}}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


def _pickled() -> bytes:
    body = pickle.dumps(np.array([[_Bomb()] * 2] * 2, dtype=object))
    return _raw_npz({"z_mm.npy": _npy_head((2, 2), "|O") + body, "pitch_mm.npy": _pitch()})


def _encrypted(data: bytes) -> bytes:
    """The archive with every member said to be encrypted."""
    changed = bytearray(data)
    for magic, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = changed.find(magic)
        while at >= 0:
            changed[at + offset] |= 1
            at = changed.find(magic, at + 4)
    return bytes(changed)


def x3p(rows: int, cols: int, height: float = 1.0) -> bytes:
    import x3pio

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "a.x3p"
        z = small_map().astype(np.float64) * 1e-3 * height
        x3pio.write(path, z, x_scale=1e-4, y_scale=1e-4)
        with zipfile.ZipFile(path) as archive:
            members = {n: archive.read(n) for n in archive.namelist()}
    xml = members["main.xml"].decode()
    for old, new, tag in ((80, cols, "SizeX"), (60, rows, "SizeY")):
        xml = xml.replace(f"{tag}>{old}<", f"{tag}>{new}<")
    return _raw_npz({**members, "main.xml": xml.encode()})


def _sdf(z: NDArray[Any]) -> bytes:
    import sdfio

    stream = io.BytesIO()
    sdfio.write(stream, z.astype(np.float64) * 1e-3, x_scale=1e-4, y_scale=1e-4)
    return stream.getvalue()


def _laughs() -> bytes:
    lines = ['<!ENTITY a0 "ha">'] + [f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12)]
    return f"<?xml version='1.0'?><!DOCTYPE a [{''.join(lines)}]><a>&a11;</a>".encode()


def _entity() -> bytes:
    return b"<?xml version='1.0'?><!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]><a>&b;</a>"


@cache
def other_file() -> str:
    """A recording of another part on the same disk, which links point to."""
    path = Path(tempfile.mkdtemp()) / "other.h5"
    atexit.register(shutil.rmtree, path.parent, ignore_errors=True)
    with h5py.File(path, "w") as file:
        file["signal"] = np.arange(5000, dtype=np.float32).reshape(-1, 8)
    return str(path)


def _linked(how: str, *, group: str = "scan") -> bytes:
    """A recording whose signal is kept in another file."""
    out: list[bytes] = []
    with changed_scan(out) as file:
        shape = file["scan/signal"].shape
        del file["scan/signal"]
        parent = file.require_group(group)
        if how == "external":
            parent["signal"] = h5py.ExternalLink(other_file(), "/signal")
        elif how == "virtual":
            layout = h5py.VirtualLayout(shape=shape, dtype=np.float32)
            layout[:625, :] = h5py.VirtualSource(other_file(), "signal", shape=(625, 8))
            parent.create_virtual_dataset("signal", layout)
        elif how == "storage":
            parent.create_dataset(
                "signal", shape=shape, dtype=np.float32, external=[(other_file(), 0, 10**6)]
            )
        elif how == "soft":
            parent["elsewhere"] = h5py.ExternalLink(other_file(), "/")
            parent["signal"] = h5py.SoftLink(f"/{group}/elsewhere/signal")
    return out[0]


def bad_scans() -> Iterator[tuple[str, bytes]]:
    """Sent as recordings."""
    good = scan()
    yield "empty.h5", b""
    yield "magic-only.h5", b"\x89HDF\r\n\x1a\n"
    yield "truncated.h5", good[: len(good) // 2]
    yield "half-head.h5", good[:60]
    rng = np.random.default_rng(40)
    for k in range(12):
        # in the first blocks stand the superblock and the groups, where damage is worst
        flipped = bytearray(good)
        for at in rng.integers(0, 4096, 6):
            flipped[at] ^= 1 << int(rng.integers(8))
        yield f"flipped-{k}.h5", bytes(flipped)
    yield "picture.h5", picture(".png")
    yield "npz.h5", npz(z_mm=small_map(), pitch_mm=0.1)
    for how in ("external", "virtual", "storage", "soft"):
        yield f"linked-{how}.h5", _linked(how)
    for name, change in _CHANGES.items():
        out: list[bytes] = []
        with changed_scan(out) as file:
            change(file)
        yield f"{name}.h5", out[0]


def _nested(file: h5py.File) -> None:
    group = file
    for _ in range(300):
        group = group.create_group("g")


def _calibrated(file: h5py.File) -> None:
    file["calibration/gain"] = np.full(8, np.nan)
    file["calibration/offset_n_mm"] = np.zeros(8)


def _crowded(file: h5py.File) -> None:
    for k in range(11_000):
        file.create_group(f"crowd/{k}")


def _packed(file: h5py.File) -> None:
    n = 2_000_000
    for name in ("scan/signal", "scan/flags", "stage/pass", "stage/phase", "stage/position_mm"):
        del file[name]
    file.create_dataset("scan/signal", data=np.zeros((n, 8), np.float32), chunks=(500_000, 8), compression=1)
    file.create_dataset("stage/pass", data=np.zeros(n, np.int8), compression=9)


def _cycle(file: h5py.File) -> None:
    file["scan/again"] = file["/"]
    file["scan/round"] = h5py.SoftLink("/scan/round")


_CHANGES: dict[str, Any] = {
    "nested": _nested,
    "crowded": _crowded,
    "packed": _packed,
    "wide-chunk": unwritten(
        "scan/signal", (100, 8), maxshape=(None, 8), chunks=(20_000_000, 8), compression=9
    ),
    "small-chunks": unwritten("scan/signal", (2**20, 8), chunks=(1, 1)),
    "declared": unwritten("scan/signal", (10**15, 8), chunks=(4096, 8)),
    "cycle": _cycle,
    "compound": put("scan/signal", np.zeros((10, 8), dtype=[("a", "f4"), ("b", "S9")])),
    "signal-1x1": put("scan/signal", np.ones((1, 1), np.float32)),
    "signal-strings": put("scan/signal", np.array([[b"deep"] * 8] * 9)),
    "signal-nan": fill("scan/signal", np.nan),
    "signal-infinite": fill("scan/signal", np.inf),
    "signal-beyond": fill("scan/signal", 3e38),
    "signal-nought": fill("scan/signal", 0.0),
    "lines-nan": fill("passes/line_mm", np.nan),
    "lines-same": fill("passes/line_mm", 1.0),
    "lines-far": lambda file: file["passes/line_mm"].__setitem__((0, 0), 1e12),
    "steps-tiny": fill("passes/step_mm", 1e-12),
    "steps-huge": fill("passes/step_mm", 1e12),
    "starts-far": fill("passes/start_mm", 1e300),
    "lead-huge": fill("passes/n_lead", 2**30),
    "passes-negative": fill("stage/pass", -1),
    "arm-nought": fill("whisker/moment_arm_mm", 0.0),
    "arm-huge": fill("whisker/moment_arm_mm", 1e300),
    "compliance-nought": fill("whisker/compliance_mm_per_n", 0.0),
    "compliance-huge": fill("whisker/compliance_mm_per_n", 1e300),
    "gain-nan": _calibrated,
    "preload-string": attribute("preload_mm", "deep", "whisker"),
    "preload-huge": attribute("preload_mm", 1e300, "whisker"),
    "rate-nan": attribute("sampling_rate_hz", np.nan),
    "rate-list": attribute("sampling_rate_hz", [1.0, 2.0]),
    "pitch-tiny": attribute("line_pitch_mm", 1e-12),
    "pitch-huge": attribute("line_pitch_mm", 1e12),
    "scale-huge": attribute("scale_factor", 1e300),
    "notes-long": attribute("notes", ["x" * 1000] * 30),
    "part-binary": attribute("part_id", np.void(b"\0\xff\xfe")),
}


def bad_files() -> Iterator[tuple[str, bytes]]:
    """All of them; suffixes of pictures are photographs, .h5 recordings, others height maps."""
    yield from bad_photos()
    yield from bad_maps()
    yield from bad_scans()
