"""Numbers that are no millimetres are asked about, and converted when their unit is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.common.settings import MapSettings
from pipeline.formats.touch_file import read_height_map

Z_MM = np.zeros((260, 820))
Z_MM[100:160, 200:600] = -0.25  # a mark as deep as a 6 mm stamp's
PITCH_MM = 0.05


def test_inches_cannot_be_suspected_but_are_converted(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", z_mm=Z_MM / 25.4, pitch_mm=PITCH_MM / 25.4)
    found = read_height_map(tmp_path / "a.npz", MapSettings(unit="in"))
    np.testing.assert_allclose(found.z_mm, Z_MM, atol=1e-6)
    assert found.pitch_mm == pytest.approx(PITCH_MM)


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0])
def test_plates_are_not_suspected(tilt_deg: float, tmp_path: Path) -> None:
    tilt = np.arange(Z_MM.shape[1]) * PITCH_MM * np.tan(np.radians(tilt_deg))
    np.savez_compressed(tmp_path / "a.npz", z_mm=Z_MM + tilt, pitch_mm=PITCH_MM)
    assert read_height_map(tmp_path / "a.npz").pitch_mm == PITCH_MM
    np.savez_compressed(tmp_path / "flat.npz", z_mm=0.0 * Z_MM, pitch_mm=PITCH_MM)
    assert read_height_map(tmp_path / "flat.npz").pitch_mm == PITCH_MM
