"""Files of every kind that people hand in, changed at random: each must be read, or be refused by its name.

    python -m tests.faults.mutated                          200 of every kind
    python -m tests.faults.mutated map.npz job.toml --number 50 --seed 2

Bits flipped, bytes set, stretches cut, doubled, moved or blanked, lengths overwritten, ends cut. What has checksums
(.npz, .x3p, PNG) is changed in half of the cases inside, and they are made anew, as else they would find it all.
Files are opened as the program does, by workers. Printed by kind: read, refused; and what is a fault: workers crashed,
more than SLOW_S taken, an exception that is no refusal or does not name the file. A file that is a fault is kept in
`mutated-faults/`.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import md5
from pathlib import Path

import numpy as np

from glyphs.errors import MarksError
from glyphs.fonts.outlines import load_font
from pipeline.common.job_file import read_job_file
from pipeline.common.serial_format import read_lexicon
from pipeline.formats.glyph_database import GlyphDatabase, load_database, save_database
from pipeline.formats.manifest import read_manifest
from pipeline.formats.photos import read_photo
from pipeline.formats.touch_file import read_height_map, read_scan
from pipeline.formats.truth import load_truth, read_order
from pipeline.workers.executors import WorkerLostError
from pipeline.workers.pool import WorkPool
from tests.support.bad_files import chunk, npz, picture, scan, small_map, x3p

SLOW_S = 20.0
READ_OR_REFUSED = ("read", "refused")
WORDS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1)


@dataclass(frozen=True)
class Kind:
    """A kind of file: a sound one, and what opens it."""

    content: Callable[[], bytes]
    opened: Callable[[Path], object]


@dataclass(frozen=True)
class Mutant:
    """A changed file."""

    kind: str
    path: Path


def _mesh(suffix: str) -> bytes:
    import trimesh

    columns, rows = np.meshgrid(np.arange(12.0), np.arange(9.0))
    points = np.column_stack([columns.ravel(), rows.ravel(), small_map()[18:27, 16:28].ravel()])
    at = np.arange(12 * 9).reshape(9, 12)
    corners = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, :-1]], axis=-1).reshape(-1, 3)
    data = trimesh.Trimesh(points, corners, process=False).export(file_type=suffix)
    return data if isinstance(data, bytes) else data.encode()


def _database() -> bytes:
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "a.glyphs")
        save_database(GlyphDatabase({"gothic": load_font("gothic")}), path)
        return path.read_bytes()


def _sdf() -> bytes:
    z = (small_map()[::6, ::8] * 1e-3).ravel()
    head = {
        "ManufacID": "press", "CreateDate": "010120260000", "ModDate": "010120260000", "NumPoints": 10,
        "NumProfiles": 10, "Xscale": 1e-4, "Yscale": 1e-4, "Zscale": 1, "Zresolution": -1, "Compression": 0,
        "DataType": 7, "CheckType": 0,
    }  # fmt: skip
    lines = (
        "aISO-1.0",
        *(f"{key} = {value}" for key, value in head.items()),
        "*",
        " ".join(map(str, z)),
        "*",
    )
    return "\n".join(lines).encode()


KINDS = {
    "map.npz": Kind(lambda: npz(z_mm=small_map(), pitch_mm=0.1), read_height_map),
    "map.x3p": Kind(lambda: x3p(60, 80), read_height_map),
    "map.sdf": Kind(_sdf, read_height_map),
    "map.stl": Kind(lambda: _mesh("stl"), read_height_map),
    "map.ply": Kind(lambda: _mesh("ply"), read_height_map),
    "scan.h5": Kind(scan, read_scan),
    "photo.png": Kind(lambda: picture(".png"), read_photo),
    "photo.jpg": Kind(lambda: picture(".jpg"), read_photo),
    "photo.bmp": Kind(lambda: picture(".bmp"), read_photo),
    "photo.tif": Kind(lambda: picture(".tiff"), read_photo),
    "fonts.glyphs": Kind(_database, load_database),
    "parts.csv": Kind(
        lambda: b"part,height_map,expected,format\nA-1,maps/a-1.npz,KX407251,AA999999\nA-2,b.npz,,\n",
        lambda path: read_manifest(str(path)),
    ),
    "truth.csv": Kind(lambda: b"part,text\nA-1,KX407251\nA-2,KX407252\n", load_truth),
    "words.txt": Kind(lambda: b"KX407251 # first\nKX407252\n", read_lexicon),
    "order.csv": Kind(lambda: b"serial\nKX400000..KX409999\nZZ1\n", read_order),
    "job.toml": Kind(lambda: b'format = ["AA999999"]\nfont = ["gothic"]\nheight_mm = 5.0\n', read_job_file),
}


def changed(data: bytes, rng: np.random.Generator) -> bytes:
    """The file with one to four things wrong."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        if not out:
            break
        at = int(rng.integers(len(out)))
        n = int(min(len(out) - at, 2 ** rng.integers(0, 9)))
        match int(rng.integers(8)):
            case 0:
                out[at] ^= 1 << int(rng.integers(8))
            case 1:
                out[at : at + n] = rng.bytes(n)
            case 2:
                del out[at : at + n]
            case 3:
                out[at:at] = out[at : at + n]
            case 4:
                out[at : at + n] = bytes(n)
            case 5:
                width = int(rng.choice([1, 2, 4, 8]))
                word = WORDS[int(rng.integers(len(WORDS)))] & ((1 << 8 * width) - 1)
                out[at : at + width] = word.to_bytes(width, "little" if rng.random() < 0.5 else "big")
            case 6:
                there = int(rng.integers(len(out)))
                out[there:there] = out[at : at + n]
            case _:
                if rng.random() < 0.3:
                    del out[at:]
                else:  # a figure of the text, or what looks like one
                    out[at] = int(rng.choice(list(b'0123456789-+.eE,;"\n\r\0[]{}')))
    return bytes(out)


def inside(data: bytes, rng: np.random.Generator) -> bytes:
    """An archive with something wrong in one of its members, or in their names."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as new:
        members = {name: old.read(name) for name in old.namelist()}
        hit = str(rng.choice(list(members)))
        members[hit] = changed(members[hit], rng)
        if rng.random() < 0.05:
            del members[hit]
        if "md5checksum.hex" in members and rng.random() < 0.9:
            members["md5checksum.hex"] = (
                f"{md5(members.get('main.xml', b'')).hexdigest()} *main.xml\n".encode()
            )
        for name, body in members.items():
            new.writestr(name, body)
    return stream.getvalue()


def inside_png(data: bytes, rng: np.random.Generator) -> bytes:
    """A PNG with something wrong in one of its chunks, whose checksum is made anew."""
    chunks, at = [], 8
    while at < len(data):
        n = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + n]))
        at += n + 12
    hit = int(rng.integers(len(chunks)))
    name, body = chunks[hit]
    if name == b"IDAT" and rng.random() < 0.5:
        body = zlib.compress(changed(zlib.decompress(body), rng))
    else:
        body = changed(body, rng)
    chunks[hit] = (name, body)
    return data[:8] + b"".join(chunk(name, body) for name, body in chunks)


INSIDE = {".npz": inside, ".x3p": inside, ".png": inside_png}


def opened(_: None, mutant: Mutant) -> str:
    """What became of a file, in the worker."""
    try:
        KINDS[mutant.kind].opened(mutant.path)
    except MarksError as error:
        return READ_OR_REFUSED[1] if mutant.path.name in str(error) else f"does not name the file: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return READ_OR_REFUSED[0]


def campaign(kinds: Sequence[str], number: int, seed: int, jobs: int, keep: Path) -> dict[str, Counter[str]]:
    """How many of each kind were read, refused, and what else; whatever is a fault is printed, and kept in a folder."""
    tallies: dict[str, Counter[str]] = {kind: Counter() for kind in kinds}
    with tempfile.TemporaryDirectory() as name, WorkPool(jobs, timeout_s=SLOW_S) as pool:
        for outcome in pool.calls(opened, None, mutants(kinds, number, seed, Path(name))):
            mutant, came = outcome.task, outcome.result or _lost(outcome.error)
            tallies[mutant.kind][came.split(":")[0]] += 1
            if came not in READ_OR_REFUSED:
                print(f"{mutant.path.name}: {came}", file=sys.stderr)
                keep.mkdir(exist_ok=True)
                (keep / mutant.path.name).write_bytes(mutant.path.read_bytes())
            mutant.path.unlink()
    return tallies


def mutants(kinds: Sequence[str], number: int, seed: int, folder: Path) -> Iterator[Mutant]:
    """The files, written as they are asked for; the sound one of a kind has been read before them.

    Raises:
        AssertionError: it has not.
    """
    for kind in kinds:
        rng, sound = np.random.default_rng([seed, *kind.encode()]), KINDS[kind].content()
        whole = Mutant(kind, folder / kind)
        whole.path.write_bytes(sound)
        if (came := opened(None, whole)) != READ_OR_REFUSED[0]:
            raise AssertionError(f"the sound {kind} is not read: {came}")
        for k in range(number):
            into = INSIDE.get(whole.path.suffix) if rng.random() < 0.5 else None
            mutant = Mutant(kind, folder / f"{k}-{kind}")
            mutant.path.write_bytes((into or changed)(sound, rng))
            yield mutant


def _lost(error: Exception | None) -> str:
    if isinstance(error, WorkerLostError):
        return f"{'slow' if error.timed_out else 'crash'}: {error}"
    return f"{type(error).__name__}: {error}"


def main(*kinds: str, number: int = 200, seed: int = 1, jobs: int = 2) -> int:
    """Print the table; 1 where anything is a fault.

    Args:
        kinds: of `KINDS`; all of them unless given.
        number: files of each kind.
        seed: of the changes.
        jobs: number of workers.
    """
    began, faults = time.monotonic(), 0
    found = campaign(kinds or tuple(KINDS), number, seed, jobs, Path("mutated-faults"))
    for kind, tally in found.items():
        others = {came: n for came, n in tally.items() if came not in READ_OR_REFUSED}
        faults += sum(others.values())
        counts = "".join(f"{tally[came]:7} {came}" for came in READ_OR_REFUSED)
        print(f"{kind:14}{counts}   {', '.join(f'{n} {came}' for came, n in others.items()) or 'no fault'}")
    print(f"{number * len(found)} tried, {faults} faults, {time.monotonic() - began:.0f} s")
    return int(faults > 0)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
