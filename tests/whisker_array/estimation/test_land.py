"""The land of a sweep: its level, the gains of the whiskers and the drift of the lines."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from whisker_array.estimation.land import MAX_DRIFT, line_drift, plate_land, shorth, whisker_gain

LEVEL = -6.5


def marks(shape: tuple[int, int], *, seed: int = 1, share: float = 0.2) -> NDArray[np.float64]:
    """Bars across a band of the sweep that stand 10 to 40 % off the land, on one side as grooves do."""
    rng = np.random.default_rng(seed)
    out = np.zeros(shape)
    band = slice(shape[0] // 4, 3 * shape[0] // 4)
    while (out != 0.0).mean() < share:
        start, width = int(rng.integers(0, shape[1] - 12)), int(rng.integers(4, 12))
        out[band, start : start + width] = -rng.uniform(0.1, 0.4)
    return out


def tilted(shape: tuple[int, int], tilt: float, dome: float) -> NDArray[np.float64]:
    v, u = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    return LEVEL * (1.0 + tilt * (u - 0.7 * v) + dome * (u * u + 0.5 * v * v - 0.4 * u * v))


# --- shorth


def test_shorth_stays_on_the_land_where_the_median_leaves_it() -> None:
    rng = np.random.default_rng(2)
    land = rng.normal(1.0, 0.01, 400)
    groove = rng.uniform(0.5, 0.9, 500)
    mixed = np.concatenate([land, groove])
    assert np.median(mixed) < 0.95
    assert shorth(mixed[None])[0] == pytest.approx(1.0, abs=0.01)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), scale=st.floats(0.1, 10.0), shift=st.floats(-5.0, 5.0))
def test_shorth_moves_with_its_samples(seed: int, scale: float, shift: float) -> None:
    values = np.random.default_rng(seed).normal(size=(3, 57))
    np.testing.assert_allclose(shorth(scale * values + shift), scale * shorth(values) + shift, atol=1e-9)
    shuffled = np.random.default_rng(seed + 1).permutation(values, axis=1)
    np.testing.assert_array_equal(shorth(shuffled), shorth(values))


def test_shorth_leaves_out_what_is_missing() -> None:
    values = np.random.default_rng(3).normal(size=(4, 40))
    holed = np.concatenate([values, np.full((4, 9), np.nan)], axis=1)
    holed[2] = np.nan
    got = shorth(holed)
    np.testing.assert_allclose(got[[0, 1, 3]], shorth(values)[[0, 1, 3]])
    assert np.isnan(got[2])


# --- plate_land


@pytest.mark.parametrize("tilt", [0.0, 0.02, 0.1, 0.3])
@pytest.mark.parametrize("dome", [0.0, 0.02])
def test_the_land_of_a_tilted_domed_plate_is_found_between_the_marks(tilt: float, dome: float) -> None:
    shape = (90, 300)
    land = tilted(shape, tilt, dome)
    noise = np.random.default_rng(4).normal(0.0, 0.002, shape)
    found = plate_land(land * (1.0 + marks(shape) + noise))
    # noise 0.002 over thousands of samples, and grooves at 10 % outside the window of 5 %
    np.testing.assert_allclose(found / land, 1.0, atol=5e-4)


def test_missing_samples_have_no_say() -> None:
    shape = (60, 200)
    land = tilted(shape, 0.05, 0.01)
    moment = land * (1.0 + marks(shape))
    moment[:, 40:60] = np.nan
    moment[7] = np.nan
    found = plate_land(moment)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found / land, 1.0, atol=1e-3)


def test_where_nothing_is_felt_there_is_no_land() -> None:
    np.testing.assert_array_equal(plate_land(np.zeros((20, 60))), 0.0)


def test_raised_marks_are_as_good_as_sunk_ones() -> None:
    shape = (60, 200)
    land = tilted(shape, 0.05, 0.01)
    np.testing.assert_allclose(plate_land(land * (1.0 - marks(shape))) / land, 1.0, atol=1e-3)


# --- whisker_gain


def interlaced(gains: NDArray[np.float64], lines_each: int, blocks: int) -> NDArray[np.int64]:
    return np.tile(np.repeat(np.arange(gains.size), lines_each), blocks)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), lines_each=st.integers(2, 9), blocks=st.integers(1, 3))
def test_gains_are_exact_where_the_surface_goes_on_smoothly(seed: int, lines_each: int, blocks: int) -> None:
    rng = np.random.default_rng(seed)
    true = 1.0 + 0.03 * rng.standard_normal(5)
    whisker = interlaced(true, lines_each, blocks)
    # a surface that grows by the same ratio from line to line: what the neighbours say of the slope is exact
    profile = LEVEL * np.exp(0.1 * rng.standard_normal(60))
    surface = profile * np.exp(0.004 * np.arange(whisker.size))[:, None]
    found = whisker_gain(surface * true[whisker, None], whisker)
    relative = np.exp(np.log(true) - np.log(true).mean())
    np.testing.assert_allclose(found, relative[whisker], rtol=1e-9)


def test_gains_of_single_lines_have_no_slope_to_take_off() -> None:
    true = np.array([1.0, 1.05, 0.97])
    whisker = interlaced(true, 1, 4)
    found = whisker_gain(np.full((whisker.size, 40), LEVEL) * true[whisker, None], whisker)
    np.testing.assert_allclose(found, (true / np.exp(np.log(true).mean()))[whisker], rtol=1e-9)


def test_gains_that_cannot_be_known_are_one() -> None:
    lines = np.full((6, 40), LEVEL)
    np.testing.assert_array_equal(whisker_gain(lines, np.zeros(6, dtype=np.int64)), 1.0)
    few = lines.copy()
    few[3:, 10:] = np.nan  # ten samples in common at the border: too few
    np.testing.assert_allclose(whisker_gain(2.0 * few, np.repeat([0, 1], 3)), 1.0)


# --- line_drift


def test_drift_of_single_lines_is_found_beside_marks() -> None:
    shape = (60, 240)
    rng = np.random.default_rng(5)
    t = np.linspace(-1.0, 1.0, shape[1])
    offset, slope = np.zeros(shape[0]), np.zeros(shape[0])
    drifting = np.arange(3, 56, 7)  # the outermost line is taken at its word: it has no neighbours beyond
    offset[drifting] = rng.uniform(-0.015, 0.015, drifting.size)
    slope[drifting] = rng.uniform(-0.01, 0.01, drifting.size)
    drift = 1.0 + offset[:, None] + slope[:, None] * t
    found = line_drift(drift * (1.0 + marks(shape)))
    # the ridge on the slope gives back all but 5 / 38 of it; level lines stay
    np.testing.assert_allclose(found, drift, atol=0.002)
    np.testing.assert_allclose(np.delete(found, drifting, axis=0), 1.0, atol=5e-4)


def test_form_of_the_surface_is_no_drift() -> None:
    shape = (60, 240)
    v = np.linspace(-1.0, 1.0, shape[0])[:, None]
    form = 1.0 + 0.02 * v + 0.01 * np.sin(2.0 * v) * np.ones(shape)
    # a line departs from the median of nine only at the rim of the sweep
    np.testing.assert_allclose(line_drift(form)[5:-5], 1.0, atol=1e-4)


def test_drift_is_bounded_and_says_nothing_within_marks() -> None:
    lines = np.ones((30, 100))
    lines[10] = 1.045  # within the window of 5 % but more than a sensor drifts
    lines[20] = 0.7  # a line that runs in a mark from end to end
    found = line_drift(lines)
    assert np.abs(found - 1.0).max() <= 2 * MAX_DRIFT
    np.testing.assert_allclose(found[20], 1.0, atol=1e-9)
