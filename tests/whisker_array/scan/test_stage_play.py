"""A stage with play and errors of its place: limits without them, their signs, and that flags go by what was asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.errors import MarksError
from glyphs.surface.maps import HeightMap, TraceDirection
from tests.support.scans import SMALL_PLAN
from whisker_array.scan.scan import trace_scan
from whisker_array.scan.stage_play import StagePlay, apply_screw_wave, displace_plan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.touch import default_touch

TOUCH = default_touch(5.0)
STILL = StagePlay(play_mm=0.0, rate=0.0, wave_mm=0.0, return_mm=0.0)
PLAN = replace(SMALL_PLAN, directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_X))


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def wavy() -> HeightMap:
    y, x = np.mgrid[:81, :121] * 0.05
    return HeightMap((0.05 * np.sin(2.0 * x) + 0.02 * np.cos(1.3 * y)).astype(np.float32), 0.05)


def scan(stage: StagePlay | None) -> list[np.ndarray]:
    felt = trace_scan(wavy(), touch=TOUCH, plan=PLAN, fidelity=Fidelity.POINTWISE, stage=stage, rng=rng())
    return [s.moment_n_mm for s in felt.sweeps]


def test_the_nut_lags_by_half_the_play_whichever_way_it_goes() -> None:
    plans = PLAN.sweeps()
    for plan, sign in zip(plans, (-1.0, 1.0), strict=True):
        ran = displace_plan(plan, replace(STILL, play_mm=0.04), rng=rng())
        np.testing.assert_allclose(ran.position_mm() - plan.position_mm(), sign * 0.02)
        np.testing.assert_array_equal(ran.line_mm, plan.line_mm)


def test_travel_is_stretched_and_lines_are_missed_together() -> None:
    plan = PLAN.sweeps()[0]
    ran = displace_plan(plan, replace(STILL, rate=1e-3), rng=rng())
    np.testing.assert_allclose(ran.position_mm(), 1.001 * plan.position_mm())
    np.testing.assert_allclose(ran.line_mm, 1.001 * plan.line_mm)
    many = replace(plan, line_mm=np.zeros((4000, 4)))
    missed = displace_plan(many, replace(STILL, return_mm=0.002), rng=rng()).line_mm
    assert missed.std() == pytest.approx(0.002, rel=6.0 / np.sqrt(2 * 4000))
    assert np.ptp(missed, axis=1).max() == 0.0


def test_the_wave_shifts_samples_along_the_plate_either_way() -> None:
    for plan in PLAN.sweeps():
        at = plan.position_mm()
        ramp = np.tile(at, (2, 1)).astype(np.float32)
        stage = replace(STILL, wave_mm=0.01, lead_mm=3.0, phase_rad=0.4)
        moved, flags = apply_screw_wave(ramp, np.zeros(ramp.shape, np.uint8), plan, stage)
        # a straight line is interpolated exactly, but for its two ends
        expected = at + 0.01 * np.sin(2.0 * np.pi * at / 3.0 + 0.4)
        np.testing.assert_allclose(moved[0, 1:-1], expected[1:-1], atol=1e-5)
        assert not flags.any()


def test_what_lies_on_the_part_is_what_was_asked_for() -> None:
    """Outermost lines and samples are asked for at the very rim: a miss by micrometres leaves them on the part."""
    ideal, real = (
        trace_scan(wavy(), touch=TOUCH, plan=PLAN, fidelity=Fidelity.POINTWISE, stage=s, rng=rng())
        for s in (None, StagePlay())
    )
    for a, b in zip(ideal.sweeps, real.sweeps, strict=True):
        np.testing.assert_array_equal(a.flags, b.flags)
        np.testing.assert_array_equal(a.plan.line_mm, b.plan.line_mm)
        # slopes of 0.1 at most over 12 um: 1.2 um of 1 mm preload in the height, and 0.2 a mm of the slope's change
        on = a.flags == 0
        ratio = a.moment_n_mm[on] / b.moment_n_mm[on]
        assert (ratio != 1.0).mean() > 0.9
        assert np.abs(ratio - 1.0).max() < 0.01


def test_refusals() -> None:
    with pytest.raises(MarksError, match="play_mm is -1"):
        StagePlay(play_mm=-1.0)
    with pytest.raises(MarksError, match="lead_mm is 0"):
        StagePlay(lead_mm=0.0)
    with pytest.raises(MarksError, match="rate"):
        StagePlay(rate=0.5)
    with pytest.raises(ValueError, match="random generator"):
        trace_scan(wavy(), touch=TOUCH, plan=PLAN, stage=StagePlay())
