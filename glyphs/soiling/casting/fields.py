"""Noise and means with a length well above the pitch, computed on coarse grids."""

from __future__ import annotations

import numpy as np

from glyphs.soiling import grids
from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field


def coarse_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Smooth noise on the coarsest grid that its length allows."""
    return grids.coarse_noise(coat, length_mm, max(1, int(length_mm / coat.pitch_mm / 6.0)), rng)


def slow_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Smooth noise of a length well above the pitch."""
    return grids.resize(coarse_noise(coat, length_mm, rng), coat.shape, how="cubic")


def blur(z: Field, width_mm: float, pitch_mm: float) -> Field:
    """Blur by a Gaussian of `width_mm`, computed on a coarser grid if it is wide."""
    step = max(1, int(width_mm / pitch_mm / 2.0))
    mean = grids.resize(z, (max(2, z.shape[0] // step), max(2, z.shape[1] // step)), how="area")
    return grids.resize(grids.blur(mean, width_mm / pitch_mm / step), z.shape, how="cubic")
