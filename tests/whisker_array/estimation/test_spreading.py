"""Averaging onto a grid against the same with full matrices of weights."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from whisker_array.estimation.spreading import averaging, spread

Lines = NDArray[np.float64]


def full(position: Lines, pixel: Lines, pitch: float) -> Lines:
    """(pixels, samples) weights of a triangle one pitch, or one step if larger, to each side."""
    step = float(np.median(np.diff(np.sort(position))))
    reach = max(pitch, step) * (1.0 + 1e-6)
    return np.clip(1.0 - np.abs(pixel[:, None] - position[None, :]) / reach, 0.0, None)


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
    layer, valid = spread(values, averaging(along, pixel_along, 0.1), averaging(across, pixel_across, 0.1))
    # half of the weight, give or take its rounding
    clear = np.abs(weight - 0.5 * expected) > 1e-9 * (1.0 + expected)
    np.testing.assert_array_equal(valid[clear], ((weight > 0.5 * expected) & (expected > 0.0))[clear])
    mean = total / np.maximum(weight, 1e-12)
    np.testing.assert_allclose(layer[valid], mean[valid], atol=1e-12)
    assert (layer[~valid] == 0.0).all()


def test_the_sparse_weights_are_the_full_ones() -> None:
    rng = np.random.default_rng(3)
    position, pixel = rng.permutation(0.05 * np.arange(80)), 0.13 * np.arange(30)
    np.testing.assert_allclose(
        averaging(position, pixel, 0.13).toarray(), full(position, pixel, 0.13), atol=1e-14
    )


def test_one_sample_alone_is_reached_within_a_pitch() -> None:
    weights = averaging(np.array([1.0]), np.array([0.4, 0.5, 1.0, 1.9]), 0.5)
    np.testing.assert_array_equal(np.diff(weights.indptr), [0, 1, 1, 0])
