"""A view on another grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.see.resample import resample, turn_back, turn_view
from recognition.see.view import GREY, HEIGHTS, KNOWN, LAYERS, View, ViewKind

PITCH_MM = 0.1
PIXEL_SHARE = 1.0 / 32.0
"""Of a pixel: places are known to a 32nd to cv2.warpAffine."""


def ramp() -> View:
    layers = np.zeros((LAYERS, 60, 90), dtype=np.float32)
    y, x = np.mgrid[:60, :90] * PITCH_MM
    layers[GREY], layers[KNOWN] = 0.2 + 0.03 * x - 0.02 * y, 1.0
    return View(ViewKind.PHOTO, layers, PITCH_MM)


@pytest.mark.parametrize("pitch_mm", [0.04, 0.1, 0.17, 0.5])
def test_an_even_slope_stays_where_it_was(pitch_mm: float) -> None:
    view = ramp()
    made = resample(view, pitch_mm)
    rows, columns = made.shape[1:]
    assert (rows - 1) * pitch_mm <= view.size_mm[1] + 1e-9 < rows * pitch_mm + 1e-9
    assert (columns - 1) * pitch_mm <= view.size_mm[0] + 1e-9 < columns * pitch_mm + 1e-9
    y, x = np.mgrid[:rows, :columns] * pitch_mm
    expected = 0.2 + 0.03 * x - 0.02 * y
    # beside the rim the blur, of 0.4 of a new pixel, sees only one side
    inner = (slice(2, -2), slice(2, -2))
    off = 0.05 * PITCH_MM * PIXEL_SHARE + 2e-4
    np.testing.assert_allclose(made[GREY][inner], expected[inner], atol=off)
    assert made[KNOWN].all()


def test_averages_leave_out_what_is_not_known() -> None:
    view = ramp()
    layers = view.layers.copy()
    layers[:, :, 40:50] = 0.0
    made = resample(View(ViewKind.PHOTO, layers, PITCH_MM), 0.3)
    known = made[KNOWN] > 0.0
    assert set(np.unique(made[KNOWN])) == {0.0, 1.0}
    assert not made[GREY][~known].any()
    x = np.arange(made.shape[2]) * 0.3
    np.testing.assert_array_equal(known.all(axis=0), (x < 3.95) | (x > 4.95))
    # beside the gap it is no darker: a new pixel's slope, not the gap's nothing
    whole = resample(view, 0.3)
    np.testing.assert_allclose(made[GREY][known], whole[GREY][known], atol=0.03 * 0.3)


def test_a_view_smaller_than_a_few_pixels_is_still_one() -> None:
    assert resample(ramp(), 5.0).shape == (LAYERS, 8, 8)


@given(turned_deg=st.floats(-180.0, 180.0), u=st.integers(20, 39), v=st.integers(20, 29))
def test_what_is_turned_lies_where_it_is_turned_back_to(turned_deg: float, u: int, v: int) -> None:
    layers = np.zeros((LAYERS, 50, 60), dtype=np.float32)
    layers[KNOWN], layers[HEIGHTS, v, u] = 1.0, 1.0
    view = View(ViewKind.HEIGHTS, layers, 0.5, (3.0, -2.0))
    made = turn_view(view, turned_deg)
    heights = made.layers[HEIGHTS]
    at = np.argwhere(heights > 0.0)
    middle = (heights[heights > 0.0][:, None] * at).sum(axis=0) / heights.sum()
    there_mm = np.array(made.origin_mm) + 0.5 * middle[::-1]
    # bilinear weights keep the middle of a spot to a share of a pixel
    off_mm = turn_back(there_mm[None], view, turned_deg)[0] - (3.0 + 0.5 * u, -2.0 + 0.5 * v)
    assert np.abs(off_mm).max() < 0.25


def test_beyond_a_turned_picture_nothing_is_known_and_it_is_as_bright() -> None:
    layers = np.zeros((LAYERS, 50, 60), dtype=np.float32)
    layers[KNOWN], layers[GREY] = 1.0, 0.4
    made = turn_view(View(ViewKind.PHOTO, layers, 1.0), 30.0)
    assert not made.layers[KNOWN, 0, 0]
    assert made.layers[KNOWN].sum() == pytest.approx(50 * 60, rel=0.1)  # less its rim
    np.testing.assert_allclose(made.layers[GREY], 0.4, atol=1e-6)
