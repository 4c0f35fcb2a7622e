"""From an instrument's rectangular grid to the square one of a HeightMap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.files.npz import MAX_HEIGHT_MM, check_pitch, check_size, make_map

SAME_PITCH = 1e-3
"""Relative difference of two pitches that is taken for none: 1 in 1000 shears no character."""
MUCH_FINER = 4.0


def square_map(path: Path, z_mm: NDArray[np.float64], *, x_pitch_mm: float, y_pitch_mm: float) -> HeightMap:
    """A height map from heights (rows, cols), row 0 at the top, whose pitches may differ.

    The coarser axis is resampled linearly to the finer pitch; where one pitch is more than four times the
    other, the finer axis is resampled to the coarser pitch instead. What touches a dropout stays one. Heights
    beyond a metre are the bad points of some instrument and become dropouts.

    Raises:
        FileError: sizes, pitches or heights that cannot be used.
    """
    if z_mm.ndim != 2 or min(z_mm.shape) < 2:
        raise FileError(path, f"is a profile or point list of shape {z_mm.shape}", "measure a surface")
    for pitch in (x_pitch_mm, y_pitch_mm):
        check_pitch(path, pitch)
    z = np.where(np.abs(z_mm) <= MAX_HEIGHT_MM, z_mm, np.nan)  # NaN compares false and stays NaN
    finer, coarser = sorted((x_pitch_mm, y_pitch_mm))
    if coarser / finer - 1.0 <= SAME_PITCH:
        return make_map(path, z, 0.5 * (finer + coarser))
    pitch = coarser if coarser / finer > MUCH_FINER else finer
    rows, cols = (_count(n, p, pitch) for n, p in zip(z.shape, (y_pitch_mm, x_pitch_mm), strict=True))
    check_size(path, rows, cols)
    z = _resampled(z, rows, pitch / y_pitch_mm)
    z = _resampled(z.T, cols, pitch / x_pitch_mm).T
    return make_map(path, z, pitch)


def _count(n: int, old_mm: float, new_mm: float) -> int:
    return max(2, int((n - 1) * old_mm / new_mm + 1e-9) + 1)


def _resampled(z: NDArray[np.float64], n_rows: int, step: float) -> NDArray[np.float64]:
    """Rows taken at multiples of `step` rows, linearly between neighbours."""
    if n_rows == z.shape[0] and abs(step - 1.0) < 1e-12:
        return z
    at = np.minimum(np.arange(n_rows) * step, z.shape[0] - 1)
    low = np.minimum(at.astype(np.intp), z.shape[0] - 2)
    weight = (at - low)[:, None]
    # a row that is hit exactly does not look at its neighbour, which may be a dropout
    between = (1.0 - weight) * z[low] + weight * z[low + 1]
    return np.asarray(np.where(weight == 0.0, z[low], np.where(weight == 1.0, z[low + 1], between)))
