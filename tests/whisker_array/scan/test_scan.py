"""A scan by the virtual array: both fidelities, flags, places, sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap, MapError
from tests.support.scans import SMALL_PLAN
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, SensorError, draw_sensor_chain
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.array import ALL_DIRECTIONS
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.touch import Touch, default_touch

PITCH = 0.05
TOUCH = default_touch(5.0)


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A low hill off the middle, so that no direction may be taken for another."""
    return 0.1 * np.exp(-((x - 2.0) ** 2) / 0.5 - (y - 1.5) ** 2 / 0.3)


def plate(heights: np.ndarray | None = None) -> HeightMap:
    y, x = np.mgrid[:81, :121] * PITCH
    return HeightMap((hill(x, y) if heights is None else heights).astype(np.float32), PITCH)


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_every_direction_feels_the_hill_where_it_is(fidelity: Fidelity) -> None:
    scan = trace_scan(plate(), touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity)
    assert scan.fidelity == fidelity.value
    assert scan.directions == ALL_DIRECTIONS
    for sweep in scan.sweeps:
        assert sweep.moment_n_mm.shape == (*sweep.plan.line_mm.shape, sweep.plan.n_samples)
        good = sweep.flags == 0
        line, at = np.broadcast_arrays(sweep.plan.line_mm[..., None], sweep.plan.position_mm())
        x, y = (at, line) if sweep.plan.direction.along_x else (line, at)
        height = hill(x, y)
        felt = sweep.moment_n_mm / TOUCH.land_moment_n_mm() - 1.0
        # enhancement is h / d0 and slopes up to 0.17; centre of mass of the excess is the hill's, if slopes cancel
        weight = np.where(good, height, 0.0)
        assert (felt * weight).sum() == pytest.approx((height**2 * good).sum() / TOUCH.preload_mm, rel=0.05)
        assert np.corrcoef(felt[good], height[good])[0, 1] > 0.93


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_beyond_the_part_is_flagged_but_for_lead_ins_beside_it(fidelity: Fidelity) -> None:
    plan = replace(SMALL_PLAN, region_mm=(-0.5, -0.5, 6.8, 4.6))
    scan = trace_scan(plate(), touch=TOUCH, plan=plan, fidelity=fidelity)
    for sweep in scan.sweeps:
        along, across = (6.0, 4.0) if sweep.plan.direction.along_x else (4.0, 6.0)
        line, at = np.broadcast_arrays(sweep.plan.line_mm[..., None], sweep.plan.position_mm())
        beside = (line < -1e-6) | (line > across + 1e-6)
        outside = (at < -1e-6) | (at > along + 1e-6) | beside
        flagged = (sweep.flags & SampleFlag.OUTSIDE) > 0
        core = slice(sweep.plan.n_lead, -sweep.plan.n_lead)
        np.testing.assert_array_equal(flagged[..., core], outside[..., core])
        assert (sweep.moment_n_mm[beside] == 0.0).all()
    inside = trace_scan(plate(), touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity)
    for sweep in inside.sweeps:
        across = 4.0 if sweep.plan.direction.along_x else 6.0
        assert (sweep.flags[sweep.plan.line_mm <= across + 1e-6] == 0).all()


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_dropouts_are_flagged_where_they_are(fidelity: Fidelity) -> None:
    z = plate().z_mm.copy()
    z[20:30, 60:75] = np.nan
    scan = trace_scan(plate(z), touch=TOUCH, plan=SMALL_PLAN, fidelity=fidelity)
    for sweep in scan.sweeps:
        line, at = np.broadcast_arrays(sweep.plan.line_mm[..., None], sweep.plan.position_mm())
        x, y = (at, line) if sweep.plan.direction.along_x else (line, at)
        hole = (x > 59.5 * PITCH) & (x < 74.5 * PITCH) & (y > 19.5 * PITCH) & (y < 29.5 * PITCH)
        near = (x > 58 * PITCH) & (x < 76 * PITCH) & (y > 18 * PITCH) & (y < 31 * PITCH)
        flagged = (sweep.flags & SampleFlag.DROPOUT) > 0
        assert flagged[hole].all()
        assert not flagged[~near].any()
        assert np.isfinite(sweep.moment_n_mm).all()


@pytest.mark.parametrize("pitch", [0.05, 0.01])
def test_a_friction_map_must_fit(pitch: float) -> None:
    # at the fine pitch both would be averaged to the same grid: it must be caught before
    surface = HeightMap(np.zeros((81, 121), dtype=np.float32), pitch)
    plan = replace(SMALL_PLAN, region_mm=(0.0, 0.0, 0.7, 0.7))
    for shape in ((80, 121), (81, 120), (121, 81), (5,)):
        with pytest.raises(MapError, match="does not fit the height map"):
            trace_scan(surface, touch=TOUCH, plan=plan, friction=np.full(shape, 0.2, dtype=np.float32))
    patchy = np.full((81, 121), 0.2, dtype=np.float32)
    patchy[3, 3] = np.nan
    with pytest.raises(MapError, match="finite and not negative"):
        trace_scan(surface, touch=TOUCH, plan=plan, friction=patchy)


def test_sensors_need_a_generator_and_repeat_with_its_seed() -> None:
    chain = draw_sensor_chain(4, rng=np.random.default_rng(0))

    def run(seed: int) -> Scan:
        return trace_scan(
            plate(), touch=TOUCH, plan=SMALL_PLAN, sensor=chain, rng=np.random.default_rng(seed), part_id="p"
        )

    with pytest.raises(ValueError, match="random generator"):
        trace_scan(plate(), touch=TOUCH, plan=SMALL_PLAN, sensor=chain)
    with pytest.raises(SensorError, match="4 whiskers"):
        trace_scan(
            plate(), touch=TOUCH, plan=replace(SMALL_PLAN, array=WhiskerArray(3, 1.0)), sensor=chain,
            rng=np.random.default_rng(0),
        )  # fmt: skip
    one, again, other = run(1), run(1), run(2)
    assert one.part_id == "p"
    for a, b, c in zip(one.sweeps, again.sweeps, other.sweeps, strict=True):
        np.testing.assert_array_equal(a.moment_n_mm, b.moment_n_mm)
        np.testing.assert_array_equal(a.air_n_mm, b.air_n_mm)
        assert a.air_n_mm.shape == (*a.moment_n_mm.shape[:2], SMALL_PLAN.air_samples)
        assert not np.array_equal(a.moment_n_mm, c.moment_n_mm)


def test_a_moment_beyond_the_converter_is_flagged() -> None:
    land = abs(TOUCH.land_moment_n_mm())
    chain = SensorChain(np.ones(4), np.zeros(4), adc_range_n_mm=1.05 * land, adc_bits=16)
    scan = trace_scan(plate(), touch=TOUCH, plan=SMALL_PLAN, sensor=chain, rng=np.random.default_rng(0))
    ideal = trace_scan(plate(), touch=TOUCH, plan=SMALL_PLAN)
    for a, b in zip(scan.sweeps, ideal.sweeps, strict=True):
        beyond = np.abs(b.moment_n_mm) > 1.0501 * land
        assert beyond.any()
        assert ((a.flags & SampleFlag.OUT_OF_RANGE) > 0)[beyond].all()
        assert not (a.flags & SampleFlag.OUT_OF_RANGE)[np.abs(b.moment_n_mm) < 1.0499 * land].any()


def test_refusals_say_what_is_wrong() -> None:
    tip = TOUCH.tip
    for change, message in (
        ({"preload_mm": 0.0}, "preload_mm"),
        ({"tip_radius_mm": -0.1}, "tip_radius_mm"),
        ({"friction": 2.5}, "friction"),
    ):
        with pytest.raises(WhiskerError, match=message):
            Touch(**{"tip": tip, "preload_mm": 1.0, "tip_radius_mm": 0.05, **change})
    scan = trace_scan(plate(), touch=TOUCH, plan=SMALL_PLAN)
    sweep = scan.sweeps[0]
    for change, message in (
        ({"sweeps": ()}, "at least one sweep"),
        ({"sweeps": (sweep, sweep)}, "at most once dragged"),
        ({"line_pitch_mm": 0.0}, "line_pitch_mm"),
        ({"sample_rate_hz": float("nan")}, "sample_rate_hz"),
    ):
        with pytest.raises(MapError, match=message):
            replace(scan, **change)
    with pytest.raises(MapError, match="do not fit the plan"):
        replace(sweep, flags=sweep.flags[..., 1:])
    with pytest.raises(MapError, match="air samples"):
        replace(sweep, air_n_mm=sweep.air_n_mm[1:])
