"""Resample a height map to the grid of a scan: interpolate if it is coarser, average if it is much finer."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import MAX_PIXELS, HeightMap, MapError
from whisker_array.arrays import Floats, Mask
from whisker_array.simulation.surface import Friction, fill_dropouts

_NOTHING_MM = 1e-6
"""Rounding error between two equal interpolated maps is less than this."""


def fit_pitch(height_map: HeightMap, friction: Friction, *, target_mm: float) -> tuple[HeightMap, Friction]:
    """Resample a map for steps of `target_mm`: coarser maps are interpolated (bicubic), those finer than half the step
    averaged in blocks. The centre of the top left sample stays. Raises MapError: too many samples."""
    pitch = height_map.pitch_mm
    factor, block = _scale(pitch / target_mm)
    if factor > 1:
        rows, cols = height_map.shape
        if rows * cols * factor**2 > MAX_PIXELS:
            raise MapError(
                f"{rows} x {cols} samples {pitch:g} mm apart, scanned in steps of {target_mm:g} mm, "
                f"would be more than {MAX_PIXELS:,}",
                hint="crop the map, or scan it in coarser steps",
            )
        filled, dropout = fill_dropouts(height_map.z_mm)
        z = _interpolate(filled, factor, order=3)
        z[_repeat(dropout, factor)[: z.shape[0], : z.shape[1]]] = np.nan
        return HeightMap(z, pitch / factor), _fit_beside(friction, factor, 1)
    if block == 1:
        return height_map, friction
    return HeightMap(_average(height_map.z_mm, block), pitch * block), _fit_beside(friction, 1, block)


def pad_soil(soil: Soil, samples: int) -> Soil:
    """Extend the dirt on all sides by its edge values."""
    return Soil(*(np.pad(getattr(soil, f.name), samples, mode="edge") for f in fields(soil)))


def fit_soil(soil: Soil, top: HeightMap, fitted: HeightMap, *, target_mm: float) -> Soil:
    """Resample the dirt on a map to the grid of `fit_pitch`. The surface below the dirt is resampled like the map, and
    the thickness is the difference: a cubic would overshoot from the edge of the dirt into the metal."""
    if fitted is top:
        return soil
    factor, block = _scale(top.pitch_mm / target_mm)
    friction, hardness = (
        np.asarray(_fit_beside(beside, factor, block)) for beside in (soil.friction, soil.hardness_mpa)
    )
    thickness = np.zeros(fitted.shape, dtype=np.float32)
    if soil.thickness_mm.any():
        below, _ = fit_pitch(HeightMap(top.z_mm - soil.thickness_mm, top.pitch_mm), 0.0, target_mm=target_mm)
        between = np.nan_to_num(fitted.z_mm - below.z_mm)
        thickness = np.where(between > _NOTHING_MM, between, 0.0).astype(np.float32)
    return Soil(thickness_mm=thickness, hardness_mpa=hardness, friction=friction)


def _scale(ratio: float) -> tuple[int, int]:
    """Number of samples interpolated for one, and of those averaged to one, an odd number."""
    if ratio > 1.0 + 1e-6:
        return int(np.ceil(ratio - 1e-6)), 1
    block = int(np.floor(0.5 / ratio + 1e-6))
    return 1, max(block - (1 - block % 2), 1)


def _fit_beside(beside: Friction, factor: int, block: int) -> Friction:
    if not isinstance(beside, np.ndarray):
        return beside
    if factor > 1:
        # linear, because a cubic would overshoot below zero beside an oil patch
        return _interpolate(beside, factor, order=1)
    return _average(beside, block) if block > 1 else beside


def _interpolate(values: NDArray[np.float32], factor: int, *, order: int) -> NDArray[np.float32]:
    from scipy import ndimage

    rows, cols = values.shape
    shape = ((rows - 1) * factor + 1, (cols - 1) * factor + 1)
    # grid_mode=False maps first and last samples onto each other, so the pitch divides exactly
    scale = (shape[0] / rows, shape[1] / cols)
    zoomed = ndimage.zoom(values, scale, order=order, mode="nearest", grid_mode=False)
    return np.asarray(zoomed, dtype=np.float32)


def _repeat(mask: Mask, factor: int) -> Mask:
    half = factor // 2
    return np.repeat(np.repeat(mask, factor, axis=0), factor, axis=1)[half:, half:]


def _average(values: NDArray[np.float32], block: int) -> NDArray[np.float32]:
    n_rows, n_cols = ((n - 1) // block + 1 for n in values.shape)
    padded = np.pad(values, block // 2, mode="edge")[: n_rows * block, : n_cols * block]
    blocks = padded.reshape(n_rows, block, n_cols, block)
    return mean_of_known(blocks, axis=(1, 3)).astype(np.float32)


def mean_of_known(values: NDArray[np.floating], *, axis: int | tuple[int, ...]) -> Floats:
    """Mean of the known values along axes; NaN if none is known."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis, dtype=np.float64)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
