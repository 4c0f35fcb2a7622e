"""Noise and means of a length well above the pitch, made on grids as coarse as that allows."""

from __future__ import annotations

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field, smooth_noise


def coarse_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Smooth noise on a grid as coarse as its length allows; `_fine` brings it to the part's."""
    step = max(1, int(length_mm / coat.pitch_mm / 6.0))
    shape = (coat.shape[0] // step + 2, coat.shape[1] // step + 2)
    return smooth_noise(shape, pitch_mm=coat.pitch_mm * step, length_mm=length_mm, rng=rng)


def refined(values: Field, shape: tuple[int, ...]) -> Field:
    """A coarse field on the part's grid."""
    from glyphs.opencv import cv2

    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def slow_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Smooth noise of a length well above the pitch."""
    return refined(coarse_noise(coat, length_mm, rng), coat.shape)


def blurred(z: Field, width_mm: float, pitch_mm: float) -> Field:
    """Gaussian mean of `width_mm`, on a grid thinned where that is wide."""
    from glyphs.opencv import cv2

    step = max(1, int(width_mm / pitch_mm / 2.0))
    thin = (max(2, z.shape[1] // step), max(2, z.shape[0] // step))
    mean = cv2.resize(z, thin, interpolation=cv2.INTER_AREA)
    cv2.GaussianBlur(mean, (0, 0), width_mm / pitch_mm / step, dst=mean, borderType=cv2.BORDER_REPLICATE)
    return refined(np.asarray(mean, dtype=np.float32), z.shape)
