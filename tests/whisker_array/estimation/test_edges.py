"""Scan -> EdgeMap: the paper's enhancement where a mark is, nothing where none is, whatever the sensor adds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from glyphs import stamp
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.maps import EdgeMap, HeightMap, MapError, TraceDirection
from tests.factories import extruded
from whisker_array.estimation.edges import UNUSABLE, calibrated_moments, edge_map
from whisker_array.estimation.gridding import average_onto, averaging_weights
from whisker_array.estimation.land import land_coefficients, land_surface, remove_drift, shorth, whisker_gain
from whisker_array.estimation.registration import play_pixels
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, draw_sensor_chain
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.array import ALL_DIRECTIONS, RasterPlan, default_plan
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.sections import WhiskerError
from whisker_array.whisker.touch import default_touch

# ------------------------------------------------------------------------------------------------------------- edges

# ------------------------------------------------------------------------------------------------------------- edges

TOUCH = default_touch(5.0)
D0 = TOUCH.preload_mm
PITCH = 0.05


def plan_of(plate: HeightMap) -> RasterPlan:
    return default_plan((0.0, 0.0, *plate.size_mm), character_height_mm=5.0)


@pytest.fixture(scope="module")
def stamped() -> HeightMap:
    """A serial stamped without fault on a flat plate."""
    return stamp("K7R4", pitch_mm=PITCH, variation=StampingVariation.none(), seed=1).height_map


@pytest.fixture(scope="module", params=list(Fidelity))
def scan(request: pytest.FixtureRequest, stamped: HeightMap) -> Scan:
    return trace_scan(stamped, touch=TOUCH, plan=plan_of(stamped), fidelity=request.param)


def rms(a: EdgeMap, b: EdgeMap) -> float:
    both = a.valid & b.valid
    return float(np.sqrt(((a.enhancement - b.enhancement)[:, both] ** 2).mean()))


def strength(edges: EdgeMap) -> float:
    return float(np.sqrt((edges.enhancement**2).mean()))


# --- what is felt


def test_floor_walls_and_land_of_a_groove_are_the_formula() -> None:
    """A wide groove across x: 0.3 mm deep, walls of 45 degrees, felt both ways by the pointwise whisker."""
    x = np.arange(241) * PITCH
    profile = -0.3 * np.clip((1.5 - np.abs(x - 6.0)) / 0.3, 0.0, 1.0)
    plate = extruded(profile, rows=121, pitch_mm=PITCH)
    touch = replace(TOUCH, tip_radius_mm=0.0)
    felt = edge_map(
        trace_scan(plate, touch=touch, plan=plan_of(plate), fidelity=Fidelity.POINTWISE), ideal=True
    )
    at = felt.origin_mm[0] + felt.pitch_mm * np.arange(felt.shape[1])
    middle = {
        d: layer[felt.shape[0] // 2] for d, layer in zip(felt.directions, felt.enhancement, strict=True)
    }
    forward, back = middle[TraceDirection.FORWARD_X], middle[TraceDirection.BACK_X]
    for layer in (forward, back):
        np.testing.assert_allclose(layer[np.abs(at - 6.0) > 2.0], 0.0, atol=1e-5)
        np.testing.assert_allclose(layer[np.abs(at - 6.0) < 1.0], -0.3 / D0, atol=1e-5)
    # half-way down the wall: 0.15 deep. A pixel averages 0.125 mm of wall to either side: still all of it wall.
    falls, rises = (float(moment_ratio(p, touch.friction, touch.tip)) for p in (-1.0, 1.0))
    pixel = int(np.argmin(np.abs(at - 4.65)))
    h = float(np.interp(at[pixel], x, profile))
    assert forward[pixel] == pytest.approx((1.0 + h / D0) * falls - 1.0, abs=0.005)
    assert back[pixel] == pytest.approx((1.0 + h / D0) * rises - 1.0, abs=0.005)
    assert falls > 1.08 > 0.92 > rises
    # along the groove there is no slope: nothing but the profile
    for direction in (TraceDirection.FORWARD_Y, TraceDirection.BACK_Y):
        assert middle[direction][pixel] == pytest.approx(h / D0, abs=0.005)


def test_estimated_land_is_the_nominal_one_on_a_flat_plate(scan: Scan) -> None:
    assert rms(edge_map(scan), edge_map(scan, ideal=True)) < 0.01 * strength(edge_map(scan))


def test_land_is_zero_beside_the_marks(scan: Scan, stamped: HeightMap) -> None:
    felt = edge_map(scan)
    rows = slice(0, round(2.0 / felt.pitch_mm))  # the margin is 4 mm wide
    assert (stamped.z_mm[: round(3.0 / PITCH)] == 0.0).all()
    beside = felt.enhancement[:, rows]
    assert float(np.sqrt((beside**2).mean())) < 1e-3
    # a line that runs in a stroke nearly from end to end takes a little of it for drift
    assert np.abs(beside).max() < 0.01
    assert np.abs(felt.enhancement).max() > 0.1


def test_the_grid_lies_on_the_plate(scan: Scan, stamped: HeightMap) -> None:
    felt = edge_map(scan)
    assert felt.directions == ALL_DIRECTIONS
    assert felt.pitch_mm == pytest.approx(5.0 / 40)
    assert felt.origin_mm == pytest.approx((0.0, 0.0), abs=1e-9)
    assert felt.valid.all()
    for have, whole in zip(felt.shape[::-1], stamped.size_mm, strict=True):
        assert whole - felt.pitch_mm - 1e-6 < (have - 1) * felt.pitch_mm < whole + 1e-6


# --- what the sensor and the mounting add


def bent(plate: HeightMap) -> HeightMap:
    """The plate mounted 0.3 degrees askew and domed by 0.05 mm."""
    y, x = np.mgrid[: plate.shape[0], : plate.shape[1]] * plate.pitch_mm
    x, y = x - x.mean(), y - y.mean()
    return HeightMap((plate.z_mm + 0.004 * x - 0.003 * y + 3e-4 * x * x).astype(np.float32), plate.pitch_mm)


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_tilt_dome_gains_offsets_and_drift_are_taken_off(fidelity: Fidelity, stamped: HeightMap) -> None:
    plan, plate = plan_of(stamped), bent(stamped)
    ideal = edge_map(trace_scan(stamped, touch=TOUCH, plan=plan, fidelity=fidelity))
    mounted = edge_map(trace_scan(plate, touch=TOUCH, plan=plan, fidelity=fidelity))
    rng = np.random.default_rng(3)
    chain = draw_sensor_chain(8, rng=rng, gain_sd=0.03)
    noisy = edge_map(trace_scan(plate, touch=TOUCH, plan=plan, fidelity=fidelity, sensor=chain, rng=rng))
    assert np.ptp(chain.gain) > 0.05
    # marks are 0.055 rms. The mounting moves d0 itself by up to 7 % at the corners, and h / d0 with it.
    assert rms(mounted, ideal) < 0.0025
    # vibration of 0.2 % and noise of 2e-4 of full scale (0.06 % of the land), averaged over four samples
    assert rms(noisy, mounted) < 0.002
    assert np.abs(noisy.enhancement - mounted.enhancement).max() < 0.01


def test_calibration_removes_what_it_knows(stamped: HeightMap) -> None:
    plan = plan_of(stamped)
    chain = SensorChain(gain=np.linspace(0.8, 1.2, 8), offset_n_mm=np.linspace(-1.0, 1.0, 8))
    ideal = trace_scan(stamped, touch=TOUCH, plan=plan)
    raw = trace_scan(stamped, touch=TOUCH, plan=plan, sensor=chain, rng=np.random.default_rng(0))
    known = replace(raw, calibration=Calibration(chain.gain, chain.offset_n_mm))
    for got, sweep in zip(known.sweeps, ideal.sweeps, strict=True):
        np.testing.assert_allclose(calibrated_moments(known, got), sweep.moment_n_mm, atol=2e-5)
    assert rms(edge_map(known), edge_map(ideal)) < 1e-4
    # without calibration, air gives the offsets and the borders of the whiskers their gains
    assert rms(edge_map(raw), edge_map(ideal)) < 5e-4
    # an offset that the calibration has wrong is corrected by the air
    wrong = replace(raw, calibration=Calibration(chain.gain, np.zeros(8)))
    assert rms(edge_map(wrong), edge_map(ideal)) < 1e-4


# --- registration


def displaced(scan: Scan, direction: TraceDirection, pixels: float) -> Scan:
    """The scan as it would be recorded if the stage stood that much further along than one sweep believes."""
    sweeps = []
    for sweep in scan.sweeps:
        if sweep.plan.direction == direction:
            start = sweep.plan.start_mm + pixels * scan.line_pitch_mm
            sweep = replace(sweep, plan=replace(sweep.plan, start_mm=start))
        sweeps.append(sweep)
    return replace(scan, sweeps=tuple(sweeps))


def difference(edges: EdgeMap, clean: EdgeMap, shift_x: float) -> NDArray[np.float64]:
    """rms of each layer against the clean map moved by shift_x, both on their common pixels."""
    p = clean.pitch_mm
    c0 = round((edges.origin_mm[0] - shift_x) / p)
    r0 = round(edges.origin_mm[1] / p)
    rows = min(edges.shape[0], clean.shape[0] - r0)
    skip = max(0, -c0)
    cols = min(edges.shape[1], clean.shape[1] - c0)
    mine = edges.enhancement[:, :rows, skip:cols]
    other = clean.enhancement[:, r0 : r0 + rows, c0 + skip : c0 + cols]
    valid = edges.valid[:rows, skip:cols]
    out: NDArray[np.float64] = np.sqrt(((mine - other)[:, valid] ** 2).mean(axis=1))
    return out


@pytest.mark.parametrize("pixels", [2.0, -4.0])
@pytest.mark.parametrize("direction", [TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y])
def test_play_is_found_and_removed(scan: Scan, direction: TraceDirection, pixels: float) -> None:
    clean = edge_map(scan, register=False)
    played = displaced(scan, direction, pixels)
    # play along x is shared by both ways, and the passes along y follow; play along y is laid on x
    shift_x = 0.5 * pixels * scan.line_pitch_mm if direction.along_x else 0.0
    before = difference(edge_map(played, register=False), clean, shift_x)
    after = difference(edge_map(played), clean, shift_x)
    assert before.max() > 0.3 * strength(clean)
    # positions are found to a few hundredths of a pixel
    assert after.max() < 0.1 * strength(clean)


def test_no_play_is_invented(scan: Scan) -> None:
    np.testing.assert_array_equal(edge_map(scan).enhancement, edge_map(scan, register=False).enhancement)


# --- flags


def test_unusable_samples_never_enter(scan: Scan) -> None:
    rng = np.random.default_rng(6)
    maps = []
    for wrong in (1e6, -3.0, 0.0):
        sweeps = []
        for i, sweep in enumerate(scan.sweeps):
            bad = np.random.default_rng(i).random(sweep.flags.shape) < 0.02
            flag = rng.choice([int(f) for f in SampleFlag if f & UNUSABLE], size=bad.shape).astype(np.uint8)
            moment = np.where(bad, np.float32(wrong), sweep.moment_n_mm)
            sweeps.append(
                replace(sweep, moment_n_mm=moment, flags=np.where(bad, sweep.flags | flag, sweep.flags))
            )
        maps.append(edge_map(replace(scan, sweeps=tuple(sweeps))))
    for other in maps[1:]:
        np.testing.assert_array_equal(other.enhancement, maps[0].enhancement)
    # a pixel averages about 4 by 2 samples: with 2 % of them gone it is still known, and much the same
    clean = edge_map(scan)
    assert maps[0].valid.mean() > 0.99
    assert rms(maps[0], clean) < 0.15 * strength(clean)


def test_a_region_without_samples_is_not_valid(scan: Scan) -> None:
    first = scan.sweeps[0]
    flags = first.flags.copy()
    at = first.plan.position_mm()
    flags[:, :, (at > 5.0) & (at < 7.0)] |= np.uint8(SampleFlag.DROPOUT)
    felt = edge_map(replace(scan, sweeps=(replace(first, flags=flags), *scan.sweeps[1:])))
    x = felt.origin_mm[0] + felt.pitch_mm * np.arange(felt.shape[1])
    assert not felt.valid[:, (x > 5.1) & (x < 6.9)].any()
    assert felt.valid[:, (x < 4.8) | (x > 7.2)].all()
    assert (felt.enhancement[:, ~felt.valid] == 0.0).all()


# --- refusals


def test_refusals_say_what_is_wrong(scan: Scan) -> None:
    first, rest = scan.sweeps[0], scan.sweeps[1:]
    lost = replace(first, flags=np.full_like(first.flags, np.uint8(SampleFlag.CONTACT_LOST)))
    with pytest.raises(MapError, match=r"no usable samples in the 0° sweep: the whisker lost contact"):
        edge_map(replace(scan, sweeps=(lost, *rest)))
    silent = replace(first, moment_n_mm=np.zeros_like(first.moment_n_mm))
    with pytest.raises(MapError, match="no land"):
        edge_map(replace(scan, sweeps=(silent, *rest)))
    away = replace(first, plan=replace(first.plan, start_mm=first.plan.start_mm + 100.0))
    with pytest.raises(MapError, match="do not overlap"):
        edge_map(replace(scan, sweeps=(away, *rest)))
    assert math.isclose(edge_map(replace(scan, sweeps=rest)).pitch_mm, scan.line_pitch_mm)


# ---------------------------------------------------------------------------------------------------------- gridding

Lines = NDArray[np.float64]


def full(position: Lines, pixel: Lines, pitch: float) -> Lines:
    """(pixels, samples) weights, sample by sample: a triangle to the neighbours, one pitch to each side at least."""
    step = float(np.median(np.diff(np.sort(position))))
    weights = np.zeros((pixel.size, position.size))
    for i, x in enumerate(position):
        below, above = position[position < x], position[position > x]
        for j, p in enumerate(pixel):
            beside = above if p > x else below
            apart = abs(beside - x).min() if beside.size else step
            reach = max(pitch, apart if apart <= 2.1 * step else step) * (1.0 + 1e-6)
            weights[j, i] = max(0.0, 1.0 - abs(p - x) / reach)
    return weights


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), holes=st.sampled_from([0.0, 0.2, 0.9]), step=st.floats(0.02, 0.4))
def test_layers_are_those_of_full_matrices(seed: int, holes: float, step: float) -> None:
    rng = np.random.default_rng(seed)
    along, across = step * np.arange(60)[::-1], 0.1 * np.arange(17) + rng.uniform(0.0, 0.02, 17)
    pixel_along, pixel_across = np.arange(-0.1, 2.5, 0.1), np.arange(0.0, 1.5, 0.1)
    values = rng.normal(size=(17, 60))
    values[rng.uniform(size=values.shape) < holes] = np.nan
    a, c = full(along, pixel_along, 0.1), full(across, pixel_across, 0.1)
    known = np.isfinite(values)
    expected, weight = c.sum(axis=1)[:, None] * a.sum(axis=1), c @ known.astype(float) @ a.T
    total = c @ np.where(known, values, 0.0) @ a.T
    weights = [averaging_weights(a, p, 0.1) for a, p in ((along, pixel_along), (across, pixel_across))]
    layer, valid = average_onto(values, *weights)
    # half of the weight, give or take its rounding
    clear = np.abs(weight - 0.5 * expected) > 1e-9 * (1.0 + expected)
    np.testing.assert_array_equal(valid[clear], ((weight > 0.5 * expected) & (expected > 0.0))[clear])
    mean = total / np.maximum(weight, 1e-12)
    np.testing.assert_allclose(layer[valid], mean[valid], atol=1e-12)
    assert (layer[~valid] == 0.0).all()


def test_one_sample_alone_is_reached_within_a_pitch() -> None:
    weights = averaging_weights(np.array([1.0]), np.array([0.4, 0.5, 1.0, 1.9]), 0.5)
    np.testing.assert_array_equal(np.diff(weights.indptr), [0, 1, 1, 0])


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), fine=st.booleans())
def test_lines_of_uneven_distance_are_joined_by_straight_lines(seed: int, fine: bool) -> None:
    rng = np.random.default_rng(seed)
    # no gap is wider than twice another, as where passes were laid between passes
    position = np.cumsum(rng.uniform(1.0, 2.0, 30))
    pixel = np.linspace(position[0], position[-1], 301 if fine else 200)
    weights = averaging_weights(position, pixel, 0.05)
    slanted = (weights @ (3.0 * position - 1.0)) / weights.sum(axis=1)
    # reaches are a millionth longer than the gaps, which run to 2
    np.testing.assert_allclose(slanted, 3.0 * pixel - 1.0, atol=3e-5)


def test_a_gap_of_many_steps_stays_open() -> None:
    position = np.array([0.0, 1.0, 2.0, 3.0, 7.0, 8.0, 9.0])
    weights = averaging_weights(position, np.array([1.5, 5.0 + 0.2, 7.5]), 0.1).sum(axis=1)
    assert (weights > 0.0).tolist() == [True, False, True]


def test_a_whisker_that_jams_on_the_land_has_no_play() -> None:
    coupled = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    tip = replace(TOUCH.tip, compliance_mm_per_n=coupled)
    with pytest.raises(WhiskerError, match="jams"):
        play_pixels(*np.zeros((2, 5, 40)), touch=replace(TOUCH, tip=tip, friction=1.2), pitch_mm=0.125)


# -------------------------------------------------------------------------------------------------------------- land

LEVEL = -6.5


def marks(shape: tuple[int, int]) -> Lines:
    """Bars across a band of the sweep that stand 10 to 40 % off the land, on one side as grooves do."""
    rng = np.random.default_rng(1)
    out = np.zeros(shape)
    band = slice(shape[0] // 4, 3 * shape[0] // 4)
    while (out != 0.0).mean() < 0.2:
        start, width = int(rng.integers(0, shape[1] - 12)), int(rng.integers(4, 12))
        out[band, start : start + width] = -rng.uniform(0.1, 0.4)
    return out


def tilted(shape: tuple[int, int], tilt: float, dome: float) -> Lines:
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    return LEVEL * (1.0 + tilt * (u - 0.7 * v) + dome * (u * u + 0.5 * v * v - 0.4 * u * v))


def plate_land(moment: Lines) -> Lines:
    return land_surface(land_coefficients(moment), moment.shape)


def drift_of(ratio: Lines) -> Lines:
    return ratio / remove_drift(ratio.copy())


def test_shorth_stays_on_the_land_where_the_median_leaves_it() -> None:
    rng = np.random.default_rng(2)
    mixed = np.concatenate([rng.normal(1.0, 0.01, 400), rng.uniform(0.5, 0.9, 500)])
    assert np.median(mixed) < 0.95
    assert shorth(mixed[None])[0] == pytest.approx(1.0, abs=0.01)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 60))
def test_shorth_is_the_first_of_the_shortest_intervals(seed: int, n: int) -> None:
    values = np.round(np.random.default_rng(seed).normal(size=n), 1)
    ordered, width = np.sort(values), max(1, int(0.35 * n))
    first = int(np.argmin([ordered[i + width - 1] - ordered[i] for i in range(n - width + 1)]))
    holed = np.concatenate([[values, np.full(n, np.nan)], np.full((2, 3), np.nan)], axis=1)
    assert shorth(holed)[0] == 0.5 * (ordered[first] + ordered[first + width - 1])
    assert np.isnan(shorth(holed)[1])


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("tilt", "dome"), [(0.0, 0.02), (0.1, 0.0), (0.3, 0.02)])
def test_the_land_of_a_tilted_domed_plate_is_found_between_the_marks(
    tilt: float, dome: float, side: float
) -> None:
    shape = (90, 300)
    land = tilted(shape, tilt, dome)
    noise = np.random.default_rng(4).normal(0.0, 0.002, shape)
    moment = land * (1.0 + side * marks(shape) + noise)
    moment[:, 40:60], moment[7] = np.nan, np.nan
    # noise 0.002 over thousands of samples, and grooves at 10 % outside the window of 5 %
    np.testing.assert_allclose(plate_land(moment) / land, 1.0, atol=5e-4)


def test_where_nothing_is_felt_there_is_no_land() -> None:
    np.testing.assert_array_equal(plate_land(np.zeros((20, 60))), 0.0)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), lines_each=st.integers(2, 9), blocks=st.integers(1, 3))
def test_gains_are_exact_where_the_surface_goes_on_smoothly(seed: int, lines_each: int, blocks: int) -> None:
    rng = np.random.default_rng(seed)
    true = 1.0 + 0.03 * rng.standard_normal(5)
    whisker = np.tile(np.repeat(np.arange(5), lines_each), blocks)
    # a surface that grows by the same ratio from line to line: what the neighbours say of the slope is exact
    profile = LEVEL * np.exp(0.1 * rng.standard_normal(60))
    surface = profile * np.exp(0.004 * np.arange(whisker.size))[:, None]
    found = whisker_gain(surface * true[whisker, None], whisker)
    relative = np.exp(np.log(true) - np.log(true).mean())
    np.testing.assert_allclose(found, relative[whisker], rtol=1e-9)


def test_gains_of_single_lines_have_no_slope_to_take_off() -> None:
    true = np.array([1.0, 1.05, 0.97])
    whisker = np.tile(np.arange(3), 4)
    found = whisker_gain(np.full((whisker.size, 40), LEVEL) * true[whisker, None], whisker)
    np.testing.assert_allclose(found, (true / np.exp(np.log(true).mean()))[whisker], rtol=1e-9)


def test_gains_that_cannot_be_known_are_one() -> None:
    lines = np.full((6, 40), LEVEL)
    np.testing.assert_array_equal(whisker_gain(lines, np.zeros(6, dtype=np.int64)), 1.0)
    few = lines.copy()
    few[3:, 10:] = np.nan  # ten samples in common at the border: too few
    np.testing.assert_allclose(whisker_gain(2.0 * few, np.repeat([0, 1], 3)), 1.0)


def test_drift_of_single_lines_is_found_beside_marks() -> None:
    shape = (60, 240)
    rng = np.random.default_rng(5)
    t = np.linspace(-1.0, 1.0, shape[1])
    offset, slope = np.zeros(shape[0]), np.zeros(shape[0])
    drifting = np.arange(3, 56, 7)  # the outermost line is taken at its word: it has no neighbours beyond
    offset[drifting] = rng.uniform(-0.015, 0.015, drifting.size)
    slope[drifting] = rng.uniform(-0.01, 0.01, drifting.size)
    drift = 1.0 + offset[:, None] + slope[:, None] * t
    found = drift_of(drift * (1.0 + marks(shape)))
    # the ridge on the slope gives back all but 5 / 38 of it; level lines stay
    np.testing.assert_allclose(found, drift, atol=0.002)
    np.testing.assert_allclose(np.delete(found, drifting, axis=0), 1.0, atol=5e-4)


def test_form_of_the_surface_is_no_drift() -> None:
    shape = (60, 240)
    v = np.linspace(-1.0, 1.0, shape[0])[:, None]
    form = 1.0 + 0.02 * v + 0.01 * np.sin(2.0 * v) * np.ones(shape)
    # a line departs from the median of nine only at the rim of the sweep
    np.testing.assert_allclose(drift_of(form)[5:-5], 1.0, atol=1e-4)


def test_drift_is_bounded_and_says_nothing_within_marks() -> None:
    lines = np.ones((30, 100))
    lines[10] = 1.045  # within the window of 5 % but more than a sensor drifts
    lines[20] = 0.7  # a line that runs in a mark from end to end
    found = drift_of(lines)
    assert np.abs(found - 1.0).max() <= 2 * 0.03
    np.testing.assert_allclose(found[20], 1.0, atol=1e-9)
