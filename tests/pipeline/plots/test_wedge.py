"""The wedge: its corners are where its dimensions say, for every angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.surface.maps import MapError
from pipeline.plots.wedge import Wedge

MICROMETRE = 1e-3


@given(alpha_deg=st.floats(5.0, 80.0), depth=st.floats(0.1, 1.0))
def test_the_slope_falls_by_the_depth_over_the_run_at_the_angle(alpha_deg: float, depth: float) -> None:
    wedge = Wedge(math.radians(alpha_deg), depth, 0.5, 0.4)
    height_map = wedge.height_map(pitch_mm=0.01)
    x = np.arange(height_map.shape[1]) * height_map.pitch_mm
    z = height_map.z_mm.astype(np.float64)
    assert height_map.size_mm[0] == pytest.approx(wedge.length_mm, abs=0.5 * height_map.pitch_mm + MICROMETRE)
    assert np.ptp(z, axis=0).max() == 0.0
    on_slope = (x > 0.5 + 0.01) & (x < 0.5 + wedge.run_mm - 0.01)
    drop = (x - 0.5) * math.sin(math.radians(alpha_deg)) / math.cos(math.radians(alpha_deg))
    np.testing.assert_allclose(z[0, on_slope], -drop[on_slope], atol=1e-6)
    assert (z[0, x < 0.5 - 0.01] == 0.0).all()
    np.testing.assert_allclose(z[0, x > 0.5 + wedge.run_mm + 0.01], -depth, atol=1e-6)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0.0, 0.5, 1.0, 1.0), "alpha_rad"),
        ((45.0, 0.5, 1.0, 1.0), "radians"),
        ((math.nan, 0.5, 1.0, 1.0), "alpha_rad"),
        ((0.5, 0.0, 1.0, 1.0), "depth_mm"),
        ((0.5, 0.5, -1.0, 1.0), "land_mm"),
        ((0.5, 0.5, 1.0, math.inf), "floor_mm"),
    ],
)
def test_refusals_name_the_dimension(values: tuple[float, float, float, float], message: str) -> None:
    with pytest.raises(MapError, match=message):
        Wedge(*values)


@pytest.mark.parametrize("pitch", [0.0, -0.1, math.nan])
def test_a_pitch_is_positive(pitch: float) -> None:
    with pytest.raises(MapError, match="pitch_mm"):
        Wedge(0.5, 0.5, 1.0, 1.0).height_map(pitch_mm=pitch)
