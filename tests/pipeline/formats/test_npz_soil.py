"""What lies on a part, in `.npz` files: read, written, refused, and felt by `scan`."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.cli.whisker import scan
from pipeline.common.settings import MapSettings
from pipeline.formats.npz import DEFAULT_HARDNESS_MPA, soil_members, write_npz
from pipeline.formats.touch_file import read_part_map, read_scan
from whisker_array.whisker.defaults import NOMINAL_FRICTION

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


@pytest.mark.parametrize("given", ["friction", "soft_mm", "hardness_mpa"])
@pytest.mark.parametrize(("shape", "dtype"), [(Z.shape, np.float16), ((), np.float64), ((1,), np.float32)])
def test_members_that_are_missing_are_filled_in(
    given: str, shape: tuple[int, ...], dtype: type, tmp_path: Path
) -> None:
    write_npz(tmp_path / "a.npz", MAP, more={given: np.full(shape, 0.5, dtype)})
    read = read_part_map(tmp_path / "a.npz").soil
    assert read is not None
    missing = {"friction": NOMINAL_FRICTION, "soft_mm": 0.0, "hardness_mpa": DEFAULT_HARDNESS_MPA}
    expected = {**missing, given: 0.5}
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


def test_a_member_is_looked_at_before_it_is_unpacked(tmp_path: Path) -> None:
    """20,000 x 20,000 are declared, and nothing follows."""
    header = io.BytesIO()
    array = {"descr": "<f4", "fortran_order": False, "shape": (20_000, 20_000)}
    np.lib.format.write_array_header_1_0(header, array)
    write_npz(tmp_path / "a.npz", MAP)
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
        archive.writestr("friction.npy", header.getvalue())
    with pytest.raises(FileError, match="friction has shape"):
        read_part_map(tmp_path / "a.npz")


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
