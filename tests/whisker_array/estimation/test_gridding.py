"""Averaging onto a grid against the same with full matrices of weights."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from whisker_array.estimation.gridding import average_onto, averaging_weights

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
