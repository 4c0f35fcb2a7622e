"""Sums over lists of ink against products of whole windows, in plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from recognition.correlation import (
    add_stretches,
    ink_lists,
    normalise,
    products,
    running_sums,
    window_sums,
)

FLOAT32 = 2e-5
"""Relative to the sum of magnitudes, of some hundred terms in single precision."""
WINDOW = (4, 3)
"""Half rows and half columns of the templates here."""


def windows_of(layers: np.ndarray, half_rows: int, half_cols: int) -> np.ndarray:
    """(rows, cols, channels, window rows, window cols), zero beyond the image."""
    wide = np.pad(layers, ((0, 0), (half_rows, half_rows), (half_cols, half_cols)))
    seen = sliding_window_view(wide, (2 * half_rows + 1, 2 * half_cols + 1), axis=(1, 2))
    return seen.transpose(1, 2, 0, 3, 4).astype(np.float64)


def some(seed: int, *, rows: int = 14, cols: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Layers and sparse templates."""
    rng = np.random.default_rng(seed)
    layers = rng.normal(size=(3, rows, cols)).astype(np.float32)
    templates = rng.normal(size=(5, 3, 2 * WINDOW[0] + 1, 2 * WINDOW[1] + 1))
    templates *= rng.random(templates.shape) < 0.3
    return layers, templates.astype(np.float32)


@pytest.mark.parametrize("n_ink", [0, 1, 7, 8, 9, 19])
def test_stretches_are_added_whatever_their_number(n_ink: int) -> None:
    rng = np.random.default_rng(n_ink)
    flat, value = rng.normal(size=200).astype(np.float32), rng.normal(size=n_ink).astype(np.float32)
    at = rng.integers(0, 150, n_ink)
    total = np.ones(37, dtype=np.float32)
    add_stretches(total, 0, total.size, flat, at, value, 0, n_ink)
    expected = 1.0 + sum((float(v) * flat[a : a + 37] for v, a in zip(value, at, strict=True)), np.zeros(37))
    np.testing.assert_allclose(total, expected, atol=FLOAT32 * 10)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([9, 10, 14, 80]))
def test_products_are_windows_times_templates(seed: int, rows: int) -> None:
    layers, templates = some(seed, rows=rows)
    ink = ink_lists(templates, np.zeros((5, 3)))
    out = np.zeros((5, *layers.shape[1:]), dtype=np.float32)
    low, high = WINDOW[0], rows - WINDOW[0]
    products(layers, ink, low, high, out)
    expected = np.einsum("ijkrc,tkrc->tij", windows_of(layers, *WINDOW), templates)
    # within half a window of the sides stands what the product is not asked for
    inside = (slice(None), slice(low, high), slice(WINDOW[1], -WINDOW[1]))
    np.testing.assert_allclose(out[inside], expected[inside], atol=FLOAT32 * 100)
    assert not out[:, :low].any()
    assert not out[:, high:].any()


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6), st.integers(0, 9))
def test_window_sums_are_sums_over_windows(seed: int, half_rows: int, half_cols: int) -> None:
    layers, _ = some(seed, rows=8, cols=13)
    rim = half_cols + seed % 3
    total, spread = window_sums(running_sums(layers, half_rows, rim), rim, half_rows, half_cols)
    seen = windows_of(layers, half_rows, half_cols)
    np.testing.assert_allclose(total, seen.sum(axis=(3, 4)).transpose(2, 0, 1), atol=1e-4)
    about_mean = seen - seen.mean(axis=(3, 4), keepdims=True)
    # double precision, of differences of sums of some hundred squares of about 1
    np.testing.assert_allclose(spread, (about_mean**2).sum(axis=(2, 3, 4)), atol=1e-9)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_products_made_normal_are_correlation_coefficients(seed: int) -> None:
    layers, templates = some(seed)
    mean = templates.mean(axis=(2, 3))
    centred = templates - mean[:, :, None, None]
    norm = np.sqrt((centred.astype(np.float64) ** 2).sum(axis=(1, 2, 3)))
    ink = ink_lists(templates, mean)
    low, high = WINDOW[0], layers.shape[1] - WINDOW[0]
    score = np.zeros((5, *layers.shape[1:]), dtype=np.float32)
    products(layers, ink, low, high, score)
    which, halves = np.zeros(5, dtype=np.int64), np.array([WINDOW[1]])
    energy = normalise(layers, score, which, halves, ink.mean, norm, WINDOW[0], low, high)
    for r, c in ((low, WINDOW[1]), (7, 20), (high - 1, layers.shape[2] - WINDOW[1] - 1)):
        seen = layers[:, r - WINDOW[0] : r + WINDOW[0] + 1, c - WINDOW[1] : c + WINDOW[1] + 1]
        seen = seen.astype(np.float64) - seen.mean(axis=(1, 2), keepdims=True, dtype=np.float64)
        for t in range(5):
            expected = (seen * centred[t]).sum() / (np.sqrt((seen**2).sum()) * norm[t])
            assert score[t, r, c] == pytest.approx(expected, abs=FLOAT32)
        assert energy[0, r, c] == pytest.approx((seen**2).mean(), rel=1e-5)
    assert not score[:, :, : WINDOW[1]].any()
    assert not score[:, :, layers.shape[2] - WINDOW[1] :].any()
    assert not score[:, :low].any()
    assert not score[:, high:].any()
