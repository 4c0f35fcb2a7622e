"""Numbers that are no millimetres are asked about, and converted when their unit is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glyphs.errors import FileError
from pipeline.common.settings import MapSettings
from pipeline.formats.touch_file import read_height_map
from pipeline.formats.units import UNITS

DATA = Path(__file__).parents[4] / "shared" / "data"
Z_MM = np.zeros((260, 820))
Z_MM[100:160, 200:600] = -0.25  # a mark as deep as a 6 mm stamp's
PITCH_MM = 0.05


def write(path: Path, z: float, pitch: float) -> Path:
    """The plate with heights and distances in these fractions of a millimetre."""
    np.savez_compressed(path, z_mm=Z_MM / z, pitch_mm=PITCH_MM / pitch)
    return path


@pytest.mark.parametrize(
    ("unit", "z", "pitch"),
    [
        ("um", 1e-3, 1e-3),
        ("um", 1e-3, 1.0),  # each of the two may be in mm all the same
        ("um", 1.0, 1e-3),
        ("m", 1e3, 1e3),
    ],
)
def test_absurd_numbers_are_asked_about_and_converted(
    unit: str, z: float, pitch: float, tmp_path: Path
) -> None:
    path = write(tmp_path / "a.npz", z, pitch)
    with pytest.raises(FileError, match=f"are the .* {UNITS[unit]}. then give --unit {unit}"):
        read_height_map(path)
    found = read_height_map(path, MapSettings(unit=unit))
    np.testing.assert_allclose(found.z_mm, Z_MM, atol=1e-6)
    assert found.pitch_mm == pytest.approx(PITCH_MM)


def test_inches_cannot_be_suspected_but_are_converted(tmp_path: Path) -> None:
    found = read_height_map(write(tmp_path / "a.npz", 25.4, 25.4), MapSettings(unit="in"))
    np.testing.assert_allclose(found.z_mm, Z_MM, atol=1e-6)
    assert found.pitch_mm == pytest.approx(PITCH_MM)


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0])
def test_plates_are_not_suspected(tilt_deg: float, tmp_path: Path) -> None:
    tilt = np.arange(Z_MM.shape[1]) * PITCH_MM * np.tan(np.radians(tilt_deg))
    np.savez_compressed(tmp_path / "a.npz", z_mm=Z_MM + tilt, pitch_mm=PITCH_MM)
    assert read_height_map(tmp_path / "a.npz").pitch_mm == PITCH_MM
    np.savez_compressed(tmp_path / "flat.npz", z_mm=0.0 * Z_MM, pitch_mm=PITCH_MM)
    assert read_height_map(tmp_path / "flat.npz").pitch_mm == PITCH_MM


@pytest.mark.skipif(not DATA.is_dir(), reason="the folder with real measurements is not there")
def test_real_measurements_are_not_suspected() -> None:
    files = [f for name in ("height_maps", "grooves", "other_dirt") for f in (DATA / name).rglob("*.npz")]
    assert files
    for file in files:
        read_height_map(file)
