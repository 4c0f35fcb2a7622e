"""Readers of files: what is good is read with the right scale, rows and dirt. What is bad: tests/pipeline/reading."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import sdfio
import x3pio
from numpy.typing import NDArray

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.cli.whisker import scan
from pipeline.common.settings import MapSettings
from pipeline.formats.npz import DEFAULT_HARDNESS_MPA, soil_members, write_npz
from pipeline.formats.touch_file import read_height_map, read_part_map, read_scan
from whisker_array.whisker.defaults import NOMINAL_FRICTION


def relief() -> NDArray[np.float64]:
    """30 x 40, no symmetry whatever, some dropouts; mm."""
    y, x = np.mgrid[0:30, 0:40]
    z = 0.01 * y + 0.002 * x + 0.05 * (x > 30) * (y < 5)
    z[3, 4] = np.nan
    return np.asarray(z)


def save_npz(path: Path, **arrays: object) -> Path:
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]
    return path


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


def plate() -> NDArray[np.float64]:
    """60 x 80 samples 0.1 mm apart, rough to 2 um, with a mark 0.15 mm deep; mm."""
    z = 0.002 * np.random.default_rng(0).standard_normal((60, 80))
    z[20:40, 30:36] -= 0.15
    return np.asarray(z)


def some(share: float) -> NDArray[np.bool_]:
    return np.asarray(np.random.default_rng(1).random((60, 80)) < share)


@pytest.mark.parametrize(
    ("dropout", "offset_mm"), [(0.0, 3.1), (0.0, -12.5), (-10.0, 0.0), (10.0, 0.0), (-5.0, 0.0)]
)
def test_dropouts_written_as_one_constant_are_no_depth(
    dropout: float, offset_mm: float, tmp_path: Path
) -> None:
    missing = some(0.05)
    z = np.where(missing, dropout, plate() + offset_mm)
    loaded = read_height_map(save_npz(tmp_path / "a.npz", z_mm=z, pitch_mm=0.1))
    np.testing.assert_array_equal(np.isnan(loaded.z_mm), missing)
    assert np.nanmax(loaded.z_mm) - np.nanmin(loaded.z_mm) == pytest.approx(
        np.ptp(plate()[~missing]), abs=1e-5
    )


def test_a_constant_depth_of_another_unit_is_no_dropout(tmp_path: Path) -> None:
    """Marks of one depth, as a converter at its limit writes them, on a plate in micrometres."""
    z = 1e3 * plate()
    z[z < -100.0] = -150.0
    path = save_npz(tmp_path / "a.npz", z_mm=np.round(z), pitch_mm=0.1)
    with pytest.raises(FileError, match=r"are the heights micrometres\? then give --unit um"):
        read_height_map(path)
    assert np.isfinite(read_height_map(path, MapSettings(unit="um")).z_mm).all()


def test_an_isolated_constant_of_a_map_that_fits_a_part_is_kept(tmp_path: Path) -> None:
    z = np.where(some(0.05), -0.5, plate())
    loaded = read_height_map(save_npz(tmp_path / "a.npz", z_mm=z, pitch_mm=0.1))
    np.testing.assert_array_equal(loaded.z_mm, z.astype(np.float32))


def test_the_unit_that_fits_is_named_though_a_format_states_metres(tmp_path: Path) -> None:
    x3pio.write(tmp_path / "a.x3p", 1e6 * plate()[::-1], x_scale=1e5, y_scale=1e5)
    with pytest.raises(FileError, match=r"are the numbers nanometres\? then give --unit nm"):
        read_height_map(tmp_path / "a.x3p")
    loaded = read_height_map(tmp_path / "a.x3p", MapSettings(unit="nm"))
    np.testing.assert_allclose(loaded.z_mm, plate(), atol=1e-6)


def test_a_grid_of_gwyddion_without_a_unit_is_said_to_have_none(tmp_path: Path) -> None:
    head = b"Gwyddion Simple Field 1.0\nXRes = 8\nYRes = 8\nZUnits =\n"
    (tmp_path / "a.gsf").write_bytes(head + bytes(4 - len(head) % 4) + bytes(4 * 64))
    with pytest.raises(FileError, match="states no unit of its values; export the heights with their unit"):
        read_height_map(tmp_path / "a.gsf")


def table(head: str, *, unit: float = 1.0) -> str:
    """A number, x, y and z of each sample."""
    y, x = np.mgrid[0:60, 0:80] * 0.1
    rows = zip(x.ravel(), 5.9 - y.ravel(), plate().ravel() * unit, strict=True)
    return f"{head}\n" + "".join(f"{n};{x:.3f};{y:.3f};{z:.5f}\n" for n, (x, y, z) in enumerate(rows))


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ("Point;Pos X;Pos Y;Height", 1.0),
        ("Nr;X-Achse [mm];Y-Achse [mm];Z-Koordinate [µm]", 1e3),
        ("Idx;Position X (mm);Position Y (mm);Z Value (mm)", 1.0),
        ("id;coordinate_x;coordinate_y;measured height", 1.0),
        ("i;Axis X;Axis Y;Höhenwert [mm]", 1.0),
    ],
)
def test_columns_headed_as_positions_are_found(head: str, unit: float, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(table(head, unit=unit), encoding="utf-8")
    np.testing.assert_allclose(read_height_map(tmp_path / "a.csv").z_mm, plate(), atol=2e-5)


def test_points_of_a_surface_under_unknown_headings_are_no_profile(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(table("Point;first;second;third"))
    with pytest.raises(FileError, match="first columns are not x, y and z; head the columns x, y and z"):
        read_height_map(tmp_path / "a.csv")


def test_a_recording_that_is_cut_short_is_said_to_be_in_plain_words(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["heights"] = np.arange(1000.0)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(FileError, match=r"a\.h5: is damaged or cut short; copy it again$"):
        read_scan(path)
    path.write_text("no recording\n")
    with pytest.raises(FileError, match="is not an HDF5 file; record it again"):
        read_scan(path)


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.sur").write_bytes(b"DIGITAL SURF")
    for name in [n for n in sys.modules if n.partition(".")[0] == "SurfaceTopography"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(FileError, match=r"tactile-marks\[formats\]"):
        read_height_map(tmp_path / "a.sur")


Z = np.zeros((4, 5), np.float32)
MAP = HeightMap(Z, 0.05)


def test_soil_turns_with_its_map(tmp_path: Path) -> None:
    rising = np.add.outer(np.arange(4.0), np.zeros(5))
    write_npz(
        tmp_path / "a.npz",
        HeightMap(0.01 * rising, 0.05),
        more={"soft_mm": rising, "rows": np.str_("bottom-first")},
    )
    for settings, first in ((None, 3.0), (MapSettings(rows="top-first"), 0.0)):
        read = read_part_map(tmp_path / "a.npz", settings)
        assert read.soil is not None
        assert read.soil.thickness_mm[0, 0] == first
        assert read.height_map.z_mm[0, 0] == pytest.approx(0.01 * first)


@pytest.mark.parametrize("member", ["friction", "soft_mm", "hardness_mpa"])
@pytest.mark.parametrize(("shape", "dtype"), [(Z.shape, np.float16), ((), np.float64), ((1,), np.float32)])
def test_members_that_are_missing_are_filled_in(
    member: str, shape: tuple[int, ...], dtype: type, tmp_path: Path
) -> None:
    write_npz(tmp_path / "a.npz", MAP, more={member: np.full(shape, 0.5, dtype)})
    read = read_part_map(tmp_path / "a.npz").soil
    assert read is not None
    missing = {"friction": NOMINAL_FRICTION, "soft_mm": 0.0, "hardness_mpa": DEFAULT_HARDNESS_MPA}
    expected = {**missing, member: 0.5}
    for name, values in soil_members(read).items():
        np.testing.assert_array_equal(values, np.full(Z.shape, expected[name], np.float32))


BAD: dict[str, tuple[dict[str, object], str]] = {
    "another grid": ({"friction": np.zeros((5, 4))}, "friction has shape (5, 4), z_mm (4, 5)"),
    "a row": ({"soft_mm": np.zeros(5)}, "soft_mm has shape (5,)"),
    "not a number": ({"soft_mm": Z + np.nan}, "soft_mm is not finite at 20 samples"),
    "infinite": ({"hardness_mpa": np.inf}, "hardness_mpa is not finite"),
    "beyond single precision": ({"hardness_mpa": 1e300}, "hardness_mpa runs from 1e+300"),
    "negative friction": ({"friction": Z - 0.1}, "friction runs from -0.1"),
    "friction in per cent": ({"friction": Z + 20.0}, "friction runs from 20"),
    "negative thickness": ({"soft_mm": Z - 1e-3}, "soft_mm runs from -0.001"),
    "thickness in nanometres": ({"soft_mm": Z + 5e4}, "soft_mm runs from 5e+04"),
    "no hardness": ({"hardness_mpa": Z}, "hardness_mpa runs from 0"),
    "words": ({"friction": "oily"}, "friction is of type <U4"),
    "complex": ({"soft_mm": Z.astype(complex)}, "soft_mm is of type complex"),
    "yes and no": ({"soft_mm": Z > 0}, "soft_mm is of type bool"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_soil_is_refused_by_name(case: str, tmp_path: Path) -> None:
    more, message = BAD[case]
    path = tmp_path / "part.npz"
    write_npz(path, MAP, more=more)
    with pytest.raises(FileError) as caught:
        read_part_map(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)
    assert caught.value.hint


def test_scan_feels_what_the_file_tells_of(tmp_path: Path) -> None:
    """Soft dirt caked over a groove: the map is flat, the moment is not."""
    depth = np.zeros((41, 121), np.float32)
    depth[:, 50:70] = 0.2
    flat = HeightMap(0.0 * depth, 0.05)
    ranges = {}
    for name, more in (("clean", {}), ("soft", {"soft_mm": depth, "hardness_mpa": 1.0})):
        write_npz(tmp_path / f"{name}.npz", flat, more=more)
        out = tmp_path / f"{name}.h5"
        scan(tmp_path / f"{name}.npz", out=out, height_mm=2.0, sensors="ideal", fidelity="pointwise")
        sweep = read_scan(out).sweeps[0]
        felt = sweep.moment_n_mm[sweep.flags == 0]
        ranges[name] = float(np.ptp(felt) / np.abs(felt).mean())
    assert ranges["clean"] < 1e-3
    assert ranges["soft"] > 0.3
