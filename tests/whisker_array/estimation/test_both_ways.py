"""Slope and lift of whole maps against `estimate`, place by place."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.surface.maps import EdgeMap, TraceDirection
from tests.support.paper import lift_from_slope, slope_from_turned
from whisker_array.estimation.estimate import moment_per_lift
from whisker_array.estimation.relief import STEEPEST, mean_of_known, relief_from_edges
from whisker_array.whisker.touch import default_touch

TOUCH = default_touch(5.0)
PAIRS = (
    (TraceDirection.FORWARD_X, TraceDirection.BACK_X),
    (TraceDirection.FORWARD_Y, TraceDirection.BACK_Y),
)


def edges(directions: tuple[TraceDirection, ...]) -> EdgeMap:
    """Noise so large that some places have the steepest slope, or jam; some are not valid."""
    rng = np.random.default_rng(4)
    shape = (len(directions), 17, 23)
    valid = rng.uniform(size=shape[1:]) > 0.1
    felt = rng.normal(0.0, 0.4, shape).astype(np.float32)
    felt[:, 0] = rng.normal(0.0, 3.0, (len(directions), shape[2]))
    felt *= valid
    return EdgeMap(enhancement=felt, directions=directions, valid=valid, pitch_mm=0.125)


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.45])
@pytest.mark.parametrize("axes", [(0,), (1,), (0, 1)])
def test_relief_is_that_of_the_estimates(mu: float, axes: tuple[int, ...]) -> None:
    made = edges(tuple(d for axis in axes for d in PAIRS[axis]))
    felt = {d: 1.0 + e.astype(np.float64) for d, e in zip(made.directions, made.enhancement, strict=True)}
    land = float(moment_per_lift(np.arctan(mu), TOUCH.tip))
    lifts, slopes = [], {}
    for axis in axes:
        one, other = (felt[d] * land for d in PAIRS[axis])
        slope = np.clip(slope_from_turned(one, other, TOUCH.tip, mu=mu), -STEEPEST, STEEPEST)
        slopes[axis] = np.where(made.valid, slope, np.nan)
        lifts += [
            lift_from_slope(one, slope, TOUCH.tip, mu=mu),
            lift_from_slope(other, -slope, TOUCH.tip, mu=mu),
        ]
    height = np.where(made.valid, (mean_of_known(lifts) - 1.0) * TOUCH.preload_mm, np.nan)
    relief = relief_from_edges(made, TOUCH, friction=mu)
    # float32 of what is computed in float64
    np.testing.assert_allclose(relief.height_mm, height, rtol=2e-6, atol=2e-6)
    for axis, got in enumerate((relief.slope_x, relief.slope_y)):
        if axis not in slopes:
            assert got is None
            continue
        assert got is not None
        np.testing.assert_allclose(got, slopes[axis], rtol=2e-6, atol=2e-6)
        assert (np.abs(got) == STEEPEST).any() or mu > 0.4
    # where it is rough, some places would jam one way or the other
    assert any(np.isnan(lift[made.valid]).any() for lift in lifts) is (mu > 0.4)
