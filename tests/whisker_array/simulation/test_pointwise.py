"""The pointwise fidelity against the paper's formula and its known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.enhancement import land_moment_n_mm, moment_ratio
from whisker_array.whisker.sections import Round, WhiskerError
from whisker_array.whisker.shapes import LShaped

STEP = 0.05
D0 = 1.0
FLOAT32 = 2e-5
"""Relative: heights of 1 mm in float32 make slopes uncertain by 1e-6, doubled where F is steep."""


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("k", [0.033, 0.117, 0.3])
def test_ramps_up_and_down_are_eq_16(k: float, mu: float) -> None:
    tip = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.4)).tip_model()
    slope = np.tan(np.radians([-60.0, -45.0, -30.0, -5.0, 0.0, 5.0, 30.0, 45.0, 60.0]))
    x = STEP * (np.arange(15) - 7)
    h = slope[:, None] * x  # within 0.61 mm of the land
    felt = trace_pointwise(h.astype(np.float32), tip, step_mm=STEP, preload_mm=D0, friction=mu)
    expected = land_moment_n_mm(tip, preload_mm=D0, mu=mu) * (1.0 + h / D0)
    expected *= moment_ratio(slope, mu, tip)[:, None]
    assert not felt.flags.any()
    np.testing.assert_allclose(felt.moment_n_mm, expected, rtol=FLOAT32)


def test_lost_contact_and_jamming_are_flagged_and_carry_no_number() -> None:
    tip = LShaped(30.0, 15.0, None, 0.0, Round(0.4)).tip_model()  # k = 0.5 jams at atan(4/3) = 53 degrees
    x = STEP * np.arange(60)
    deep = -np.clip(x - 1.0, 0.0, 1.2) * 0.9
    wall = np.where(x < 1.0, 0.0, np.where(x < 1.3, -2.0 * (x - 1.0), -0.6))
    felt = trace_pointwise(np.float32([deep, wall]), tip, step_mm=STEP, preload_mm=D0, friction=0.0)
    lost = np.float32(deep) <= -D0
    assert lost.any()
    np.testing.assert_array_equal(felt.flags[0] == SampleFlag.CONTACT_LOST, lost)
    on_wall = (x > 1.0 + 1e-9) & (x < 1.3 - 1e-9)
    assert (felt.flags[1, on_wall] == SampleFlag.JAMMED).all()
    assert (felt.flags[1, ~on_wall] == 0).sum() >= (~on_wall).sum() - 2  # the two corners have half the slope
    assert (felt.moment_n_mm[felt.flags != 0] == 0.0).all()
    assert (felt.moment_n_mm[felt.flags == 0] < 0.0).all()


def test_a_trace_of_one_sample_is_flat_and_refusals_speak() -> None:
    tip = default_whisker(5.0).tip_model()
    h = np.full((1, 1), 0.1, dtype=np.float32)
    felt = trace_pointwise(h, tip, step_mm=STEP, preload_mm=D0, friction=0.2)
    assert felt.moment_n_mm[0, 0] == pytest.approx(
        1.1 * land_moment_n_mm(tip, preload_mm=D0, mu=0.2), rel=1e-5
    )
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(WhiskerError, match="preload_mm"):
            trace_pointwise(h, tip, step_mm=STEP, preload_mm=wrong, friction=0.2)
        with pytest.raises(WhiskerError, match="step_mm"):
            trace_pointwise(h, tip, step_mm=wrong, preload_mm=D0, friction=0.2)
