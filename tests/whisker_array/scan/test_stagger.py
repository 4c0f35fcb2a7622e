"""Staggered rows feel the same places later: scans, sensors and recordings keep them in register."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap, TraceDirection
from whisker_array.scan.recording import load_scan, save_scan
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.scan.stagger import to_instants, to_places
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.touch import default_touch

TOUCH = default_touch(2.0)
LEVEL = RasterPlan(
    array=WhiskerArray(4, 0.5),
    region_mm=(0.5, 0.5, 6.0, 3.0),
    line_pitch_mm=0.25,
    sample_pitch_mm=0.125,
    directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_Y),
    lead_mm=0.5,
)
STAGGERED = replace(LEVEL, array=WhiskerArray(4, 0.5, rows=3, stagger_mm=2.0))


def surface() -> HeightMap:
    x, y = np.meshgrid(np.linspace(0.0, 7.0, 141), np.linspace(0.0, 4.0, 81))
    return HeightMap(
        (-0.1 * np.exp(-(((x - 3.0) / 0.4) ** 2) - ((y - 2.0) / 0.6) ** 2)).astype(np.float32), 0.05
    )


def scan(plan: RasterPlan, *, seed: int | None = None) -> Scan:
    if seed is None:
        return trace_scan(surface(), touch=TOUCH, plan=plan)
    rng = np.random.default_rng(seed)
    chain = draw_sensor_chain(4, rng=rng, full_scale_n_mm=3.0 * abs(TOUCH.land_moment_n_mm()))
    return trace_scan(surface(), touch=TOUCH, plan=plan, sensor=chain, rng=rng)


@settings(max_examples=60, deadline=None)
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
    for one, other in zip(made.sweeps, again.sweeps, strict=True):
        np.testing.assert_array_equal(one.moment_n_mm, other.moment_n_mm)
        np.testing.assert_array_equal(one.flags, other.flags)
        assert one.plan.offset_mm == pytest.approx(other.plan.offset_mm)
        assert (one.plan.start_mm, one.plan.n_samples) == (other.plan.start_mm, other.plan.n_samples)
    with h5py.File(path, "r+") as file:
        np.testing.assert_allclose(file["whisker/offset_mm"], [0.0, 2.0, 4.0, 0.0])
        # one row of the file is one instant: passes are longer by the last row's offset
        assert np.sum((file["stage/pass"][()] == 0) & (file["stage/phase"][()] == 1)) == (
            made.sweeps[0].plan.n_samples + 32
        )
        file["whisker/offset_mm"][...] = [0.0, 2.0, -1.0, 0.0]
    with pytest.raises(FileError, match="count offsets from whisker 0"):
        load_scan(path)
