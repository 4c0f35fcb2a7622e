"""A stage session: passes felt one by one make the scan that is felt at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from tests.support.scans import SMALL_PLAN
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.scan.session import gather_sweeps
from whisker_array.scan.simulated_session import SimulatedSession, bench_calibration
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.touch import default_touch

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
