"""Irregular cracks of the layers beside a weld."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.noise import Field


def cells(along_mm: Field, spacing_mm: float, rng: np.random.Generator) -> tuple[NDArray[np.intp], Field]:
    """Number of the interval between irregular cracks at each sample, and the position within it, 0 to 1."""
    low, high = float(along_mm.min()), float(along_mm.max())
    width = spacing_mm * rng.uniform(0.45, 1.55, int((high - low) / (0.45 * spacing_mm)) + 3)
    ends = np.cumsum(width)
    step = spacing_mm / 40.0
    table = np.searchsorted(ends, np.arange(0.0, high - low + 2 * step, step))
    offset = along_mm - np.float32(low)
    cell = table[(offset * np.float32(1 / step)).astype(np.intp)]
    start, slope = (ends - width).astype(np.float32), (1 / width).astype(np.float32)
    return cell, np.clip((offset - start[cell]) * slope[cell], 0.0, 1.0)
