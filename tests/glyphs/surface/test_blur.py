"""Blurring and sampling: scipy's results, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.surface.blur import gaussian_blur, sample_bilinear


@pytest.mark.parametrize("shape", [(60, 90), (3, 5), (2, 40), (1, 1)])
@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.7, 3.0, 12.0])
@pytest.mark.parametrize("truncate", [3.0, 4.0])
def test_blurred_is_scipys_filter(shape: tuple[int, int], sigma: float, truncate: float) -> None:
    from scipy.ndimage import gaussian_filter

    z = np.random.default_rng(1).standard_normal(shape, dtype=np.float32)
    expected = gaussian_filter(z, sigma, mode="nearest", truncate=truncate)
    np.testing.assert_array_equal(gaussian_blur(z, sigma, truncate=truncate), expected)
    wide = np.repeat(z[:, :, None], 2, axis=2)[:, :, 1]  # not contiguous
    np.testing.assert_array_equal(gaussian_blur(wide, sigma, truncate=truncate), expected)


def test_sampled_is_scipys_interpolation_inside_and_beyond() -> None:
    from scipy.ndimage import map_coordinates

    rng = np.random.default_rng(2)
    z = rng.standard_normal((40, 70), dtype=np.float32)
    row, col = rng.uniform(-5.0, 45.0, (30, 50)), rng.uniform(-5.0, 75.0, (30, 50))
    row[0], col[1], row[2], col[3] = 7.0, 11.0, 39.0, 69.0  # on samples and on the last ones
    expected = map_coordinates(
        z, np.stack([row, col]), output=np.float32, order=1, mode="mirror", prefilter=False
    )
    np.testing.assert_array_equal(sample_bilinear(z, row, col), expected)
