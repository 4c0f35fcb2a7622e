"""The compiled loops of registration against eq. (16) and correlation written out in numpy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from whisker_array.estimation.backlash import correlation
from whisker_array.estimation.registration import LIMIT_PIXELS, STEEPEST, _costs, _moved, play_pixels
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.touch import default_touch

Layer = NDArray[np.float64]
TOUCH, PITCH = default_touch(5.0), 0.125


def maps(cols: int, seed: int = 1) -> tuple[Layer, Layer]:
    """Bumps felt forwards and backwards, a little noise on both."""
    rng = np.random.default_rng(seed)
    x = np.arange(cols)
    height = np.array([-0.2 * np.exp(-(((x - c) / 3.0) ** 2)) for c in rng.uniform(0.0, cols, 5)])
    slope = np.gradient(height, axis=1) * TOUCH.preload_mm / PITCH
    ahead, back = ((1.0 + height) * moment_ratio(s * slope, TOUCH.friction, TOUCH.tip) - 1.0 for s in (1, -1))
    return ahead + rng.normal(0.0, 0.005, ahead.shape), back + rng.normal(0.0, 0.005, back.shape)


def plain_cost(ahead: Layer, behind: Layer, half: float) -> float:
    a, b = _moved(ahead, half), _moved(behind, -half)
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
    shifted = play_pixels(_moved(ahead, -1.5), _moved(behind, 1.5), touch=TOUCH, pitch_mm=PITCH)
    assert shifted == pytest.approx(3.0, abs=0.3)  # tenths of a pixel go to linear interpolation


def test_a_whisker_that_jams_on_the_land_is_refused() -> None:
    tip = replace(
        TOUCH.tip, compliance_mm_per_n=np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    )
    with pytest.raises(WhiskerError, match="jams"):
        play_pixels(*maps(40), touch=replace(TOUCH, tip=tip, friction=1.2), pitch_mm=PITCH)


@pytest.mark.parametrize("shape", [(9, 30), (21, 8), (3, 5)])
def test_correlation_is_that_of_scipy(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(5)
    a, b = (rng.normal(size=shape).astype(np.float32) for _ in range(2))
    reach = 4
    got = np.zeros((2 * reach + 1, 2 * reach + 1))
    correlation(a, b, reach, got)
    whole = signal.correlate2d(a.astype(np.float64), b.astype(np.float64), mode="full")
    expected = np.pad(whole, reach)
    middle = (shape[0] - 1 + reach, shape[1] - 1 + reach)
    window = tuple(slice(m - reach, m + reach + 1) for m in middle)
    np.testing.assert_allclose(got, expected[window], atol=1e-4)  # sums in float32
