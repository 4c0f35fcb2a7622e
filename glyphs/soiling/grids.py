"""Axes of a coat, and fields on the coarsest grids that their lengths allow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field, bilinear, smooth_noise


def axes_mm(coat: Coat) -> tuple[Field, Field]:
    """x (1, cols) and y (rows, 1) of the samples, mm."""
    rows, cols = coat.shape
    x, y = (np.arange(n, dtype=np.float32) * np.float32(coat.pitch_mm) for n in (cols, rows))
    return x[None, :], y[:, None]


def coarse_noise(coat: Coat, length_mm: float, step: float, rng: np.random.Generator) -> Field:
    """Smooth noise on samples `step` apart, with a margin at the far borders; see `smooth_noise`."""
    shape = (int(coat.shape[0] / step) + 2, int(coat.shape[1] / step) + 2)
    return smooth_noise(shape, pitch_mm=coat.pitch_mm * step, length_mm=length_mm, rng=rng)


def slow_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """`Coat.noise` with a long length, drawn on a thinned grid."""
    step = max(1.0, length_mm / (4.0 * coat.pitch_mm))
    return stretch(coarse_noise(coat, length_mm, step, rng), step, coat.shape)


def stretch(values: Field, step: float, shape: tuple[int, int]) -> Field:
    """Interpolate linearly between samples that lie `step` apart; the first sample stays in place."""
    row, col = (np.arange(n, dtype=np.float32) / np.float32(step) for n in shape)
    return bilinear(values, row, col)


def resize(values: Field, shape: tuple[int, ...], *, how: str = "linear") -> Field:
    """Resize a field (rows, cols) as an image; the borders stay in place."""
    from glyphs.opencv import cv2

    flag = {"linear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC, "area": cv2.INTER_AREA}[how]
    return np.asarray(cv2.resize(values, shape[::-1], interpolation=flag), dtype=np.float32)


def blur(values: NDArray[Any], sigma: float, *, mirror: bool = False) -> Field:
    """Blur a field by a Gaussian of `sigma` samples; beyond the borders it continues constant, or mirrored."""
    from glyphs.opencv import cv2

    border = cv2.BORDER_REFLECT if mirror else cv2.BORDER_REPLICATE
    return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma, borderType=border), dtype=np.float32)
