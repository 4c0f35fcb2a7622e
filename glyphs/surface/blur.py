"""Blurring and sampling of fields by `scipy.ndimage`, with one treatment of borders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.noise import Field


def gaussian_blur(z: Field, sigma: float, *, truncate: float = 4.0) -> Field:
    """Blur a field by a Gaussian of `sigma` samples; beyond the borders it continues constant."""
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(z, sigma, mode="nearest", truncate=truncate))


def sample_bilinear(z: Field, row: NDArray[np.float64], col: NDArray[np.float64]) -> Field:
    """Sample a field at fractional rows and columns; beyond the borders it is mirrored."""
    from scipy.ndimage import map_coordinates

    return np.asarray(
        map_coordinates(z, [row, col], output=np.float32, order=1, mode="mirror", prefilter=False)
    )
