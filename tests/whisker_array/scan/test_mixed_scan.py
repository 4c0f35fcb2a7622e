"""Arrays of several kinds or rows of whiskers, and passes felt again on the way back: plan, scan, recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from tests.support.h5_edits import Edit, attribute, drop, put
from tests.support.scans import assert_same_scan
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.recording import load_scan, save_scan
from whisker_array.scan.scan import Scan, only, trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.scan.stagger import to_instants, to_places
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.enhancement import land_moment_n_mm
from whisker_array.whisker.touch import default_touch, profiling_touch

# -------------------------------------------------------------------------------------------------------- mixed scan

N = 4
PITCH = 0.05
# the paper's sensor, l3 = l2, for which eq. (24) holds
TOUCH = default_touch(5.0).with_whisker(replace(default_whisker(5.0), l3_mm=None))
PROFILER = profiling_touch(5.0)
PLAN = RasterPlan(
    array=WhiskerArray(N, 0.5),
    region_mm=(0.5, 0.25, 7.5, 3.25),
    line_pitch_mm=0.125,
    sample_pitch_mm=0.05,
    directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_Y),
    lead_mm=0.5,
    air_samples=4,
)
TWO_WAYS = replace(PLAN, two_way=True)
MIXED = replace(TWO_WAYS, array=WhiskerArray(N, 0.5, kinds=2))


def surface() -> HeightMap:
    """Land with one hollow off the middle, so that no direction may be taken for another."""
    y, x = np.mgrid[:81, :161] * PITCH
    hollow = -0.2 * np.exp(-((x - 3.0) ** 2) / 0.3 - (y - 1.5) ** 2 / 0.2)
    return HeightMap(hollow.astype(np.float32), PITCH)


def mixed(part: HeightMap | None = None, *, fidelity: Fidelity = Fidelity.POINTWISE, **more: Any) -> Scan:
    return trace_scan(
        part or surface(), touch=TOUCH, others=(PROFILER,), plan=MIXED, fidelity=fidelity, **more
    )


def test_every_pass_comes_back_pushed_over_the_same_places() -> None:
    dragged, pushed = MIXED.sweeps()[:2], MIXED.sweeps()[2:]
    assert [s.pushed for s in MIXED.sweeps()] == [False, False, True, True]
    for there, back in zip(dragged, pushed, strict=True):
        assert int(back.direction) == (int(there.direction) + 180) % 360
        np.testing.assert_array_equal(there.line_mm, back.line_mm)
        np.testing.assert_allclose(there.position_mm(), back.position_mm()[::-1], atol=1e-9)
    assert TWO_WAYS.n_passes == 2 * PLAN.n_passes
    assert TWO_WAYS.n_samples == 2 * PLAN.n_samples
    assert TWO_WAYS.scan_time_s == pytest.approx(2.0 * PLAN.scan_time_s)


@pytest.mark.parametrize("fidelity", list(Fidelity))
def test_each_kind_feels_as_if_it_were_alone(fidelity: Fidelity) -> None:
    scan = mixed(fidelity=fidelity)
    for kind, touch in enumerate(scan.touches):
        alone = trace_scan(surface(), touch=touch, plan=TWO_WAYS, fidelity=fidelity)
        ours = only(scan, kind=kind, pushed=None)
        assert ours.touch is touch
        assert (ours.others, ours.kind, ours.n_whiskers) == ((), (0,) * N, N)
        for a, b in zip(ours.sweeps, alone.sweeps, strict=True):
            np.testing.assert_array_equal(a.moment_n_mm, b.moment_n_mm)
            np.testing.assert_array_equal(a.flags, b.flags)
            np.testing.assert_array_equal(a.plan.line_mm, b.plan.line_mm)


@pytest.mark.parametrize("fidelity", list(Fidelity))
@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_pushed_on_land_is_friction_with_the_other_sign(fidelity: Fidelity, mu: float) -> None:
    flat = HeightMap(np.zeros((81, 161), dtype=np.float32), PITCH)
    scan = mixed(flat, fidelity=fidelity, friction=mu)
    for kind, touch in enumerate(scan.touches):
        for sweep in only(scan, kind=kind, pushed=None).sweeps:
            tip = touch.tip.pushed() if sweep.plan.pushed else touch.tip
            land = land_moment_n_mm(tip, preload_mm=touch.preload_mm, mu=mu)
            good = sweep.flags == 0
            assert good.mean() > 0.5
            # the contact walk ends at 1e-3 of the land, the pointwise formula in float32
            np.testing.assert_allclose(sweep.moment_n_mm[good], land, rtol=1e-3)
    # with l3 = l2, beta = 0: the moment is 1 / (1 + 1.5 k mu) of mu = 0's dragged, 1 / (1 - 1.5 k mu) pushed
    there, back = (float(np.median(s.moment_n_mm[s.flags == 0])) for s in only(scan, pushed=None).sweeps[::2])
    k = 0.117
    assert there / back == pytest.approx((1.0 - 1.5 * k * mu) / (1.0 + 1.5 * k * mu), rel=1e-3)


def test_only_chooses_kind_way_and_calibration() -> None:
    rng = np.random.default_rng(0)
    calibration = Calibration(rng.uniform(0.9, 1.1, 2 * N), rng.normal(0.0, 0.1, 2 * N), from_land=True)
    scan = replace(mixed(), calibration=calibration)
    assert [s.plan.pushed for s in only(scan).sweeps] == [False, False]
    assert [s.plan.pushed for s in only(scan, pushed=True).sweeps] == [True, True]
    assert len(only(scan, pushed=None).sweeps) == 4
    second = only(scan, kind=1)
    np.testing.assert_array_equal(second.calibration.gain, calibration.gain[N:])
    np.testing.assert_array_equal(second.calibration.offset_n_mm, calibration.offset_n_mm[N:])
    assert second.calibration.from_land
    assert only(second).sweeps == second.sweeps


def test_only_refuses_what_is_not_there() -> None:
    scan = mixed()
    for kind in (-1, 2):
        with pytest.raises(MapError, match=f"kind {kind}"):
            only(scan, kind=kind)
    with pytest.raises(MapError, match="no pushed sweep"):
        only(trace_scan(surface(), touch=TOUCH, plan=PLAN, fidelity=Fidelity.POINTWISE), pushed=True)
    with pytest.raises(MapError, match="no dragged sweep"):
        only(only(scan, pushed=True))


def test_touches_and_sensors_must_fit_the_rows() -> None:
    with pytest.raises(ValueError, match=r"2 kinds of whiskers, but 1 touches"):
        trace_scan(surface(), touch=TOUCH, plan=MIXED)
    with pytest.raises(ValueError, match=r"1 kinds of whiskers, but 2 touches"):
        trace_scan(surface(), touch=TOUCH, others=(PROFILER,), plan=PLAN)


def test_every_row_has_its_own_sensors() -> None:
    rng = np.random.default_rng(5)
    off = {"noise": 0.0, "drift_a_minute": 0.0, "vibration": 0.0, "adc_bits": None}
    chain = draw_sensor_chain(2 * N, rng=rng, **off)
    raw = mixed(sensor=chain, rng=rng)
    for a, b in zip(mixed().sweeps, raw.sweeps, strict=True):
        expected = a.moment_n_mm * chain.gain[:, None] + chain.offset_n_mm[:, None]
        np.testing.assert_allclose(b.moment_n_mm, expected, atol=1e-4)  # float32 of 10 N mm


def test_a_scan_refuses_kinds_that_do_not_fit() -> None:
    scan = mixed()
    for change in (
        {"kind": (0, 1)},
        {"kind": (0,) * N + (2,) * N},
        {"kind": (0,) * N + (-1,) * N},
        {"others": ()},
    ):
        with pytest.raises(MapError, match="do not fit 8 whiskers"):
            replace(scan, **change)
    dragged = scan.sweeps[0]
    with pytest.raises(MapError, match="once pushed"):
        replace(scan, sweeps=(dragged, dragged))
    again = replace(dragged, plan=replace(dragged.plan, pushed=True))
    assert (
        len(replace(scan, sweeps=(dragged, again)).sweeps) == 2
    )  # the same direction, the other way of holding


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("mixed") / "scan.h5"
    save_scan(mixed(), path)
    return path.read_bytes()


def test_round_trip_is_exact(recording: Path) -> None:
    calibration = Calibration(np.linspace(0.9, 1.1, 2 * N), np.linspace(-0.1, 0.1, 2 * N), from_land=True)
    for scan in (mixed(), replace(mixed(), calibration=calibration)):
        save_scan(scan, recording)
        assert_same_scan(scan, load_scan(recording))


def renumber(values: list[int]) -> Edit:
    return put("whisker/kind", np.array(values, dtype=np.int32))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (renumber([0] * N + [2] * N), "does not number the kinds"),
        (renumber([1] * N + [2] * N), "does not number the kinds"),
        (renumber([-1] * N + [0] * N), "does not number the kinds"),
        (renumber([0] * N), "/whisker/kind has shape"),
        (renumber([0] * N + [1] * (N - 1) + [2]), "has no dataset /whisker_2"),
        (put("whisker/kind", np.full(2 * N, 0.5)), "not whole numbers"),
        (drop("whisker_1"), "has no dataset /whisker_1"),
        (drop("whisker_1/moment_arm_mm"), "has no dataset /whisker_1/moment_arm_mm"),
        (put("whisker_1/compliance_mm_per_n", -np.eye(3)), "whisker is impossible"),
        (attribute("preload_mm", -1.0, "whisker_1"), "preload_mm"),
        (put("passes/pushed", np.zeros(3, dtype=np.uint8)), "/passes/pushed has shape"),
        (put("passes/pushed", np.zeros(MIXED.n_passes)), "not whole numbers"),
    ],
)
def test_damaged_files_say_what_is_wrong(recording: Path, change: Edit, message: str) -> None:
    with h5py.File(recording, "r+") as file:
        change(file)
    with pytest.raises(FileError, match=message):
        load_scan(recording)


# ----------------------------------------------------------------------------------------------------------- stagger

SMALL_TOUCH = default_touch(2.0)
LEVEL = RasterPlan(
    array=WhiskerArray(4, 0.5),
    region_mm=(0.5, 0.5, 6.0, 3.0),
    line_pitch_mm=0.25,
    sample_pitch_mm=0.125,
    directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_Y),
    lead_mm=0.5,
)
STAGGERED = replace(LEVEL, array=WhiskerArray(4, 0.5, rows=3, stagger_mm=2.0))


def bumpy() -> HeightMap:
    x, y = np.meshgrid(np.linspace(0.0, 7.0, 141), np.linspace(0.0, 4.0, 81))
    return HeightMap(
        (-0.1 * np.exp(-(((x - 3.0) / 0.4) ** 2) - ((y - 2.0) / 0.6) ** 2)).astype(np.float32), 0.05
    )


def scan(plan: RasterPlan, *, seed: int | None = None) -> Scan:
    if seed is None:
        return trace_scan(bumpy(), touch=SMALL_TOUCH, plan=plan)
    rng = np.random.default_rng(seed)
    chain = draw_sensor_chain(4, rng=rng, full_scale_n_mm=3.0 * abs(SMALL_TOUCH.land_moment_n_mm()))
    return trace_scan(bumpy(), touch=SMALL_TOUCH, plan=plan, sensor=chain, rng=rng)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 7), min_size=1, max_size=5), st.integers(1, 6), st.integers(0, 2**31))
def test_taken_and_laid_again_is_the_same(behind: list[int], n: int, seed: int) -> None:
    laid = np.random.default_rng(seed).normal(size=(2, len(behind), n)).astype(np.float32)
    late = np.array(behind)
    taken = to_instants(laid, late)
    assert taken.shape[2] == n + max(behind)
    for whisker, first in enumerate(behind):
        np.testing.assert_array_equal(taken[:, whisker, first : first + n], laid[:, whisker])
    np.testing.assert_array_equal(to_places(taken, late), laid)


def test_a_row_between_two_samples_is_laid_by_straight_lines() -> None:
    instants = np.tile(np.arange(10.0), (1, 3, 1))
    laid = to_places(instants, np.array([0.0, 2.25, 3.0]))
    np.testing.assert_allclose(laid[0], np.arange(7.0) + np.array([[0.0], [2.25], [3.0]]))
    flags = np.zeros((1, 2, 5), np.uint8)
    flags[0, 1, 2] = 4
    # a place between a good sample and a bad one is bad
    np.testing.assert_array_equal(to_places(flags, np.array([0.0, 0.5]))[0, 1], [0, 4, 4, 0])


def test_ideal_sensors_feel_the_same_whatever_the_stagger() -> None:
    for one, other in zip(scan(LEVEL).sweeps, scan(STAGGERED).sweeps, strict=True):
        np.testing.assert_array_equal(one.moment_n_mm, other.moment_n_mm)
        np.testing.assert_array_equal(one.flags, other.flags)
        np.testing.assert_array_equal(other.plan.behind, [0, 16, 32, 0])


def test_a_shake_of_the_base_comes_to_the_rows_at_other_places() -> None:
    """What all whiskers share in time is shared in time after registration too, not at the same place."""

    def noise(plan: RasterPlan) -> np.ndarray:
        raw, clean = scan(plan, seed=3).sweeps[0], scan(plan).sweeps[0]
        left = raw.moment_n_mm - clean.moment_n_mm
        return np.asarray(left - left.mean(axis=2, keepdims=True))

    level, staggered = noise(LEVEL), noise(STAGGERED)
    late = STAGGERED.sweeps()[0].behind
    in_time = to_instants(staggered, late)[..., late.max() : staggered.shape[2]]

    def alike(a: np.ndarray) -> float:
        """Mean correlation of whiskers 0 and 1 (rows 0 and 1)."""
        return float(np.mean([np.corrcoef(p[0], p[1])[0, 1] for p in a]))

    assert alike(level) > 0.3
    assert alike(in_time) > 0.3
    assert alike(staggered) < 0.5 * alike(in_time)


def test_recordings_keep_the_offsets(tmp_path: Path) -> None:
    made = scan(STAGGERED, seed=2)
    path = tmp_path / "scan.h5"
    save_scan(made, path)
    again = load_scan(path)
    assert_same_scan(made, again)
    for one, other in zip(made.sweeps, again.sweeps, strict=True):
        assert one.plan.offset_mm == pytest.approx(other.plan.offset_mm)
    with h5py.File(path, "r+") as file:
        np.testing.assert_allclose(file["whisker/offset_mm"], [0.0, 2.0, 4.0, 0.0])
        # one row of the file is one instant: passes are longer by the last row's offset
        assert np.sum((file["stage/pass"][()] == 0) & (file["stage/phase"][()] == 1)) == (
            made.sweeps[0].plan.n_samples + 32
        )
        file["whisker/offset_mm"][...] = [0.0, 2.0, -1.0, 0.0]
    with pytest.raises(FileError, match="count offsets from whisker 0"):
        load_scan(path)
