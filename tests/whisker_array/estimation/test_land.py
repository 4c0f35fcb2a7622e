"""The land of a sweep: its level, the gains of the whiskers and the drift of the lines."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from whisker_array.estimation.land import land_coefficients, land_surface, remove_drift, shorth, whisker_gain

Lines = NDArray[np.float64]
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
