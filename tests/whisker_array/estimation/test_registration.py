"""The play between forward and backward maps against eq. (16), and maps laid on each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from whisker_array.estimation.registration import (
    LIMIT_PIXELS,
    STEEPEST,
    _costs,
    _offset_pixels,
    _shift_rows,
    play_pixels,
)
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.touch import default_touch

Layer = NDArray[np.float64]
TOUCH, PITCH = default_touch(5.0), 0.125


def maps(cols: int) -> tuple[Layer, Layer]:
    """Bumps felt forwards and backwards, a little noise on both."""
    rng = np.random.default_rng(1)
    x = np.arange(cols)
    height = np.array([-0.2 * np.exp(-(((x - c) / 3.0) ** 2)) for c in rng.uniform(0.0, cols, 5)])
    slope = np.gradient(height, axis=1) * TOUCH.preload_mm / PITCH
    ahead, back = ((1.0 + height) * moment_ratio(s * slope, TOUCH.friction, TOUCH.tip) - 1.0 for s in (1, -1))
    return ahead + rng.normal(0.0, 0.005, ahead.shape), back + rng.normal(0.0, 0.005, back.shape)


def plain_cost(ahead: Layer, behind: Layer, half: float) -> float:
    a, b = _shift_rows(ahead, half), _shift_rows(behind, -half)
    total, edges = 0.5 * (a + b), 0.5 * (a - b)
    reach = 1.0 + total
    for _ in range(2):
        slope = np.clip(np.gradient(reach, axis=1) * TOUCH.preload_mm / PITCH, -STEEPEST, STEEPEST)
        rising = np.nan_to_num(moment_ratio(slope, TOUCH.friction, TOUCH.tip), nan=1.0)
        falling = np.nan_to_num(moment_ratio(-slope, TOUCH.friction, TOUCH.tip), nan=1.0)
        reach = (1.0 + total) / np.maximum(0.5 * (rising + falling), 0.1)
    predicted = 0.5 * reach * (rising - falling)
    return float(((edges - predicted)[:, LIMIT_PIXELS:-LIMIT_PIXELS] ** 2).mean())


@pytest.mark.parametrize("cols", [14, 19, 90])
def test_costs_are_those_of_the_formula_written_out(cols: int) -> None:
    ahead, behind = maps(cols)
    halves = np.array([-3.0, -2.5, -0.5, 0.0, 0.3, 1.0, 3.0])
    expected = [plain_cost(ahead, behind, half) for half in halves]
    np.testing.assert_allclose(_costs(ahead, behind, halves, TOUCH, PITCH), expected, rtol=1e-10)


def test_maps_apart_by_play_are_laid_together() -> None:
    ahead, behind = maps(120)
    shifted = play_pixels(_shift_rows(ahead, -1.5), _shift_rows(behind, 1.5), touch=TOUCH, pitch_mm=PITCH)
    assert shifted == pytest.approx(3.0, abs=0.3)  # tenths of a pixel go to linear interpolation


def test_a_whisker_that_jams_on_the_land_is_refused() -> None:
    tip = replace(
        TOUCH.tip, compliance_mm_per_n=np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    )
    with pytest.raises(WhiskerError, match="jams"):
        play_pixels(*maps(40), touch=replace(TOUCH, tip=tip, friction=1.2), pitch_mm=PITCH)


@pytest.mark.parametrize(
    ("moved", "found"),
    [
        ((0.0, 0.0), (0.0, 0.0)),
        ((2.0, -3.0), (2.0, -3.0)),
        ((-1.5, 0.5), (-1.5, 0.5)),
        ((6.0, 6.0), (6.0, 6.0)),
        ((12.0, 0.0), (0.0, 0.0)),  # beyond the reach: left where it is
    ],
)
def test_a_map_is_laid_on_another_by_correlation(
    moved: tuple[float, float], found: tuple[float, float]
) -> None:
    mark = np.zeros((70, 90))
    mark[30:40, 30:60] = np.random.default_rng(5).normal(size=(10, 30))
    mark = ndimage.gaussian_filter(mark, 2.0)
    # between samples the parabola through the correlation's peak is out by up to an eighth
    np.testing.assert_allclose(
        _offset_pixels(mark, ndimage.shift(mark, np.negative(moved))), found, atol=0.125
    )
