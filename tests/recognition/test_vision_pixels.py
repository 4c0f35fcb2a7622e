"""Compiled sums over pixels against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.vision_edges import limited
from recognition.vision_pixels import all_beyond, mean_of_table

RNG = np.random.default_rng(7)


@pytest.mark.parametrize("colours", [1, 3])
def test_the_table_and_the_limits(colours: int) -> None:
    pixels = RNG.integers(0, 256, (40, 50, colours), dtype=np.uint8)
    pixels[:5], pixels[5:9] = 255, 0
    table = RNG.normal(0.0, 1.0, 256).astype(np.float32)
    np.testing.assert_allclose(mean_of_table(pixels, table), table[pixels].mean(axis=2), rtol=1e-6, atol=1e-6)
    expected = (pixels.min(axis=2) >= 250) | (pixels.max(axis=2) <= 2)
    np.testing.assert_array_equal(all_beyond(pixels, 2, 250), expected)


def test_limited_edges_by_the_plain_formula() -> None:
    layers = RNG.standard_t(2, (2, 30, 40)).astype(np.float32)
    valid = RNG.random((30, 40)) > 0.2
    size = np.hypot(*layers)
    cut = layers * np.minimum(1.0, 0.8 * np.median(size[valid]) / size)
    expected = np.where(valid, cut / np.sqrt((cut[:, valid] ** 2).mean()), 0.0)
    # single precision
    np.testing.assert_allclose(limited(layers, valid=valid), expected, rtol=1e-5, atol=1e-6)
    assert not limited(layers, valid=np.zeros_like(valid)).any()
    assert not limited(np.zeros_like(layers)).any()
