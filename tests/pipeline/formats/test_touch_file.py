"""Readers of files: what is good is read with the right scale and the right way up, all else is refused."""

from __future__ import annotations

import io
import struct
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sdfio
import x3pio
from numpy.typing import NDArray

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.common.settings import MapSettings
from pipeline.formats.npz import write_npz
from pipeline.formats.touch_file import read_height_map, read_scan

ROOT = Path(__file__).parents[3]


def relief() -> NDArray[np.float64]:
    """30 x 40, no symmetry whatever, some dropouts; mm."""
    y, x = np.mgrid[0:30, 0:40]
    z = 0.01 * y + 0.002 * x + 0.05 * (x > 30) * (y < 5)
    z[3, 4] = np.nan
    return np.asarray(z)


def save_npz(path: Path, **arrays: object) -> Path:
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
    return path


# ------------------------------------------------------------------------------------------------ good files


def test_npz_round_trip(tmp_path: Path) -> None:
    height_map = HeightMap(relief().astype(np.float32), 0.05)
    write_npz(tmp_path / "a.npz", height_map)
    loaded = read_height_map(tmp_path / "a.npz")
    np.testing.assert_array_equal(loaded.z_mm, height_map.z_mm)
    assert loaded.pitch_mm == 0.05
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


@pytest.mark.parametrize(
    ("dtype", "pitch"),
    [("float16", 5.0), ("float64", [5.0]), ("int16", 5), ("uint8", np.float32(5.0)), (">f4", 5.0)],
)
def test_npz_of_any_real_type(tmp_path: Path, dtype: str, pitch: object) -> None:
    z = np.arange(12).reshape(3, 4).astype(dtype)
    path = save_npz(tmp_path / "a.npz", z_mm=np.asfortranarray(z), pitch_mm=pitch)
    loaded = read_height_map(path, MapSettings(unit="mm"))
    np.testing.assert_array_equal(loaded.z_mm, z)
    assert loaded.pitch_mm == 5.0


@pytest.mark.parametrize("kind", ["x3p", *sdfio.FileFormat])
def test_surfaces_of_the_standard_are_turned_upright_and_scaled(tmp_path: Path, kind: Any) -> None:
    path, z = tmp_path / ("a.x3p" if kind == "x3p" else "a.sdf"), relief()
    # the standard's frame: y grows with the row, so what the reader sees at the top is the last row
    if kind == "x3p":
        x3pio.write(path, z[::-1] * 1e-3, x_scale=5e-5, y_scale=5e-5)
    else:
        sdfio.write(path, z[::-1] * 1e-3, x_scale=5e-5, y_scale=5e-5, format=kind)
    loaded = read_height_map(path)
    np.testing.assert_allclose(loaded.z_mm, z, atol=1e-6)
    assert loaded.pitch_mm == pytest.approx(0.05)
    turned = read_height_map(path, MapSettings(rows="top-first"))
    np.testing.assert_array_equal(turned.z_mm, loaded.z_mm[::-1])


@pytest.mark.parametrize(
    ("x_scale", "y_scale", "pitch"), [(5e-5, 1e-4, 0.05), (1e-4, 5e-5, 0.05), (5e-5, 5e-4, 0.5)]
)
def test_pitches_that_differ_are_made_one(
    tmp_path: Path, x_scale: float, y_scale: float, pitch: float
) -> None:
    y, x = np.mgrid[0:30, 0:40]
    plane = 0.02 * x * x_scale + 0.01 * y * y_scale
    x3pio.write(tmp_path / "a.x3p", plane[::-1], x_scale=x_scale, y_scale=y_scale)
    loaded = read_height_map(tmp_path / "a.x3p")
    assert loaded.pitch_mm == pytest.approx(pitch)
    width, height = loaded.size_mm
    assert width == pytest.approx(39 * x_scale * 1e3, abs=pitch)
    assert height == pytest.approx(29 * y_scale * 1e3, abs=pitch)
    slope_y, slope_x = (float(np.diff(loaded.z_mm, axis=a).mean()) / pitch for a in (0, 1))
    assert slope_x == pytest.approx(0.02, rel=1e-3)
    # rows run up in the file and down in the map; the first row of the map is the last of the file
    assert slope_y == pytest.approx(0.01, rel=1e-3)


def test_resampling_keeps_dropouts_and_spreads_them_no_further(tmp_path: Path) -> None:
    z = np.zeros((5, 6))
    z[2, 3] = np.nan
    x3pio.write(tmp_path / "a.x3p", z, x_scale=5e-5, y_scale=1e-4)
    lost = np.argwhere(np.isnan(read_height_map(tmp_path / "a.x3p").z_mm))
    assert lost.tolist() == [[3, 3], [4, 3], [5, 3]]


def test_bad_points_of_instruments_become_dropouts(tmp_path: Path) -> None:
    z = relief()[::-1] * 1e-3
    z[0, 0] = -1.8e300
    metadata = sdfio.Metadata(data_type=sdfio.DataType.BINARY64)
    sdfio.write(tmp_path / "a.sdf", z, x_scale=5e-5, y_scale=5e-5, metadata=metadata)
    loaded = read_height_map(tmp_path / "a.sdf")
    assert np.isnan(loaded.z_mm[-1, 0])
    assert np.isfinite(loaded.z_mm).sum() == loaded.z_mm.size - 2


@pytest.mark.parametrize("path", sorted((ROOT / "tests/data").rglob("*.npz")), ids=lambda p: p.stem)
def test_measured_strips_are_read(path: Path) -> None:
    loaded = read_height_map(path)
    with np.load(path) as raw:
        np.testing.assert_array_equal(loaded.z_mm, raw["z_mm"])
        assert loaded.pitch_mm == float(raw["pitch_mm"])


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.sur").write_bytes(b"DIGITAL SURF")
    for name in [n for n in sys.modules if n.partition(".")[0] == "SurfaceTopography"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(FileError, match=r"tactile-marks\[formats\]"):
        read_height_map(tmp_path / "a.sur")


# ------------------------------------------------------------------------------------------------- bad files


def npy_header(shape: tuple[int, ...], dtype: str = "<f4") -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue()


def zip_of(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return stream.getvalue()


def npz(z: object = np.zeros((4, 5), np.float32), pitch: object = 0.05) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, z_mm=z, pitch_mm=pitch)  # type: ignore[arg-type]
    return stream.getvalue()


def npz_of(*arrays: str) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **{name: np.float64(0.05) for name in arrays})
    return stream.getvalue()


def declaring(shape: tuple[int, ...]) -> bytes:
    """An npz whose headers alone stand in it."""
    return zip_of(z_mm=npy_header(shape), pitch_mm=npy_header(()))


def x3p_bytes(z: NDArray[np.float64] | None = None, *, edit: tuple[bytes, bytes] | None = None) -> bytes:
    """An X3P file; `edit` replaces text in its description and puts a fitting checksum."""
    stream = io.BytesIO()
    x3pio.write(stream, np.zeros((6, 8)) if z is None else z, x_scale=1e-5, y_scale=1e-5)
    if edit is None:
        return stream.getvalue()
    out = io.BytesIO()
    with zipfile.ZipFile(stream) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        main = old.read("main.xml")
        assert edit[0] in main
        for name in old.namelist():
            if name != "md5checksum.hex":
                new.writestr(name, main.replace(*edit) if name == "main.xml" else old.read(name))
    return out.getvalue()


def sdf_bytes(z: NDArray[np.float64] | None = None, *, ascii_text: bool = False) -> bytes:
    stream = io.BytesIO()
    kind = sdfio.FileFormat.ASCII if ascii_text else sdfio.FileFormat.BINARY
    sdfio.write(stream, np.zeros((6, 8)) if z is None else z, x_scale=1e-5, y_scale=1e-5, format=kind)
    return stream.getvalue()


def sdf_declaring(profiles: int, points: int) -> bytes:
    data = bytearray(sdf_bytes())
    wide = data[1:8] == b"ISO-2.0"
    struct.pack_into("<II" if wide else "<HH", data, 42, points, profiles)
    return bytes(data)


Z = np.zeros((4, 5), np.float32)
NOISE = np.random.default_rng(0).random((90, 90))
LONG_SDF_TEXT = (
    sdf_bytes(ascii_text=True)
    .replace(b"NumProfiles = 6", b"NumProfiles = 20000")
    .replace(b"NumPoints = 8", b"NumPoints = 20000")
)
BAD: dict[str, tuple[str, bytes, str]] = {
    "npz empty": (".npz", b"", "is empty"),
    "npz no archive": (".npz", b"hello, this is text", "damaged"),
    "npz truncated": (".npz", npz(NOISE)[:900], "damaged"),
    "npz without heights": (".npz", npz_of("pitch_mm"), "no z_mm"),
    "npz without pitch": (".npz", npz_of("z_mm"), "no pitch_mm"),
    "npz nothing in it": (".npz", npz_of(), "no z_mm"),
    "npz zero pitch": (".npz", npz(pitch=0.0), "states 0 as"),
    "npz negative pitch": (".npz", npz(pitch=-0.1), "states -0.1 as"),
    "npz NaN pitch": (".npz", npz(pitch=np.nan), "states nan as"),
    "npz pitch in other units": (".npz", npz(pitch=50.0), "samples lie 50 mm apart"),
    "npz two pitches": (".npz", npz(pitch=[0.1, 0.1]), "shape (2,)"),
    "npz pitch a word": (".npz", npz(pitch="0.05"), "of type <U4"),
    "npz NaN only": (".npz", npz(Z * np.nan), "no finite height"),
    "npz complex": (".npz", npz(Z.astype(complex)), "of type complex"),
    "npz words": (".npz", npz(np.array([["a", "b"]] * 2)), "of type <U1"),
    "npz bools": (".npz", npz(Z > 0), "of type bool"),
    "npz pickle": (".npz", npz(np.array([[{}, {}]] * 2)), "of type object"),
    "npz flat": (".npz", npz(np.zeros(9)), "shape (9,)"),
    "npz stack": (".npz", npz(np.zeros((3, 3, 3))), "shape (3, 3, 3)"),
    "npz one row": (".npz", npz(np.zeros((1, 9))), "shape (1, 9)"),
    "npz no samples": (".npz", npz(np.zeros((0, 9))), "shape (0, 9)"),
    "npz 20000 declared": (".npz", declaring((20_000, 20_000)), "20,000 x 20,000"),
    "npz shorter than declared": (".npz", declaring((90, 90)), "shorter"),
    "npz negative shape": (".npz", declaring((-5, 7)), "shape (-5, 7)"),
    "npz header of another age": (".npz", zip_of(z_mm=b"\x93NUMPY\x09\x00", pitch_mm=npy_header(())), "version"),
    "npz header no header": (".npz", zip_of(z_mm=b"GIF89a", pitch_mm=b""), "damaged"),
    "x3p empty": (".x3p", b"", "is empty"),
    "x3p text": (".x3p", b"hello", "damaged"),
    "x3p truncated": (".x3p", x3p_bytes()[:400], "damaged"),
    "x3p an npz": (".x3p", npz(), "damaged"),
    "x3p NaN only": (".x3p", x3p_bytes(np.full((6, 8), np.nan)), "no finite height"),
    "x3p more declared than held": (".x3p", x3p_bytes(edit=(b"<SizeX>8</SizeX>", b"<SizeX>20000</SizeX>")), "damaged"),
    "x3p zero pitch": (".x3p", x3p_bytes(edit=(b"<Increment>1e-05<", b"<Increment>0.0<")), ""),
    "sdf empty": (".sdf", b"", "is empty"),
    "sdf text": (".sdf", b"hello, this is text", "damaged"),
    "sdf truncated": (".sdf", sdf_bytes()[:90], "damaged"),
    "sdf header cut": (".sdf", sdf_bytes()[:40], "damaged"),
    "sdf NaN only": (".sdf", sdf_bytes(np.full((6, 8), np.nan)), "no finite height"),
    "sdf 20000 declared": (".sdf", sdf_declaring(20_000, 20_000), "20,000 x 20,000"),
    "sdf text 20000 declared": (".sdf", LONG_SDF_TEXT, "20,000 x 20,000"),
    "sdf text truncated": (".sdf", sdf_bytes(ascii_text=True)[:-200], "damaged"),
    "sdf one row": (".sdf", sdf_bytes(np.zeros((1, 9))), "profile"),
    "sur empty": (".sur", b"", "is empty"),
    "sur text": (".sur", b"hello", "damaged"),
    "sur magic alone": (".sur", b"DIGITAL SURF", "damaged"),
    "opd zeros": (".opd", bytes(3000), "damaged"),
    "plu noise": (".plu", np.random.default_rng(1).bytes(3000), "damaged"),
    "word of no format": (".docx", b"PK nothing", "no format that is read"),
    "scan empty": (".h5", b"", "is empty"),
    "scan text": (".h5", b"hello", "damaged"),
}  # fmt: skip


def read(path: Path) -> object:
    return (read_scan if path.suffix == ".h5" else read_height_map)(path)


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_by_name(case: str, tmp_path: Path) -> None:
    suffix, data, message = BAD[case]
    if suffix not in (".npz", ".x3p", ".sdf", ".h5"):
        pytest.importorskip("SurfaceTopography")
    path = tmp_path / f"part{suffix}"
    path.write_bytes(data)
    with pytest.raises(FileError) as caught:
        read(path)
    text = str(caught.value)
    assert str(path) in text
    assert message in text
    assert "\n" not in text
    assert caught.value.hint


def test_missing_files_and_folders_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.npz", tmp_path / "none.h5", tmp_path / "none.sur"):
        with pytest.raises(FileError, match="is not there"):
            read(path)
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(FileError, match="is not a file"):
        read_height_map(tmp_path / "folder.npz")
