"""A stage: passes felt one by one make the scan that is felt at once; its play and errors of place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.errors import MarksError
from glyphs.surface.maps import HeightMap, TraceDirection
from tests.support.scans import SMALL_PLAN
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.scan.session import gather_sweeps
from whisker_array.scan.simulated_session import SimulatedSession, bench_calibration
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.stage_play import StagePlay, apply_screw_wave, displace_plan
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.touch import default_touch

# ----------------------------------------------------------------------------------------------------------- session

PITCH = 0.05
TOUCH = default_touch(5.0)


def hill() -> HeightMap:
    y, x = np.mgrid[:81, :121] * PITCH
    z = 0.1 * np.exp(-((x - 2.0) ** 2) / 0.5 - (y - 1.5) ** 2 / 0.3)
    return HeightMap(z.astype(np.float32), PITCH)


def session(**options: object) -> SimulatedSession:
    return SimulatedSession(
        hill(),
        touch=TOUCH,
        array=SMALL_PLAN.array,
        height_mm=5.0,
        sample_pitch_mm=0.05,
        **options,  # type: ignore[arg-type]
    )


def scan_of(felt: list[Sweep]) -> Scan:
    return Scan(gather_sweeps(felt), touch=TOUCH, line_pitch_mm=0.25, sample_rate_hz=1000.0)


def test_passes_in_any_order_make_the_scan_of_the_plan() -> None:
    stage, passes = session(), list(SMALL_PLAN.passes())
    np.random.default_rng(3).shuffle(passes)
    one_by_one = edge_map(scan_of([stage.feel(p) for p in passes]), register=False)
    at_once = edge_map(trace_scan(hill(), touch=TOUCH, plan=SMALL_PLAN), register=False)
    for direction, layer in zip(at_once.directions, at_once.enhancement, strict=True):
        own = one_by_one.enhancement[one_by_one.directions.index(direction)]
        # the same lines over the same surface; the two surfaces are padded differently, by rounding
        np.testing.assert_allclose(own, layer, atol=2e-4)
    assert stage.felt_s == pytest.approx(SMALL_PLAN.scan_time_s)


def test_a_stretch_lies_within_the_whole_line() -> None:
    stage, whole = session(), SMALL_PLAN.passes()[0]
    part = replace(whole, along_mm=(2.0, 4.0), line_mm=tuple(v + 0.125 for v in whole.line_mm))
    (together,) = gather_sweeps([stage.feel(whole), stage.feel(part)])
    assert together.plan.line_mm.shape == (2, 4)
    outside = (together.flags[1] & np.uint8(SampleFlag.OUTSIDE)) != 0
    felt = together.plan.position_mm()[~outside[0]]
    assert (felt.min(), felt.max()) == pytest.approx((2.0, 4.0))
    # where both were felt they differ by an eighth of a millimetre across a slope of 0.2 at most, over 1 mm preload
    both = together.moment_n_mm[:, :, ~outside[0]] / TOUCH.land_moment_n_mm()
    assert np.abs(both[0] - both[1]).max() < 0.05
    assert not outside[:, 50:91].any()


def test_passes_of_one_stretch_keep_the_land_on_which_they_run_in() -> None:
    stage, order = session(), SMALL_PLAN.passes()[0]
    beside = replace(order, line_mm=tuple(v + 0.125 for v in order.line_mm))
    (together,) = gather_sweeps([stage.feel(order), stage.feel(beside)])
    assert together.plan.n_lead == order.n_lead > 0
    assert not (together.flags[..., : order.n_lead] & np.uint8(SampleFlag.OUTSIDE)).any()


def test_passes_of_other_steps_do_not_go_together() -> None:
    stage, one = session(), SMALL_PLAN.passes()[0]
    with pytest.raises(ValueError, match="steps"):
        gather_sweeps([stage.feel(one), stage.feel(replace(one, sample_pitch_mm=0.1))])


def test_sensors_keep_their_gains_and_the_bench_knows_them() -> None:
    rng = np.random.default_rng(5)
    chain = draw_sensor_chain(4, rng=rng)
    known = bench_calibration(chain, TOUCH, sample_rate_hz=1000.0, rng=rng)
    # 256 samples of 0.2 % vibration
    np.testing.assert_allclose(known.gain, chain.gain, rtol=0.003)
    stage = session(sensor=chain, calibration=known, rng=rng)
    felt = replace(scan_of([stage.feel(p) for p in SMALL_PLAN.passes()[:4]]), calibration=known)

    def land(scan: Scan) -> np.ndarray:
        (sweep,) = scan.sweeps
        moment = sweep.moment_n_mm[..., 2:9].mean(axis=2) - sweep.air_n_mm.mean(axis=2)
        return np.asarray(moment / known.gain / TOUCH.land_moment_n_mm())

    np.testing.assert_allclose(land(felt), 1.0, atol=0.005)


def test_a_closed_session_feels_nothing() -> None:
    stage = session()
    stage.close()
    stage.close()
    with pytest.raises(StageError, match="no longer on the stage"):
        stage.feel(SMALL_PLAN.passes()[0])


def test_a_pass_for_another_array_is_refused() -> None:
    with pytest.raises(StageError, match="2 whiskers for an array of 4"):
        session().feel(replace(SMALL_PLAN.passes()[0], line_mm=(1.0, 2.0)))


# -------------------------------------------------------------------------------------------------------- stage play

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
