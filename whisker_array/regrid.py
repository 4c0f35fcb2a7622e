"""Bringing a height map to the grid of a scan: interpolated if it is coarser, averaged if much finer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import MAX_PIXELS, HeightMap, MapError
from whisker_array.surface import Friction, fill_dropouts


def fit_pitch(height_map: HeightMap, friction: Friction, *, target_mm: float) -> tuple[HeightMap, Friction]:
    """Bring a map to a grid that suits steps of `target_mm`: interpolated if coarser, averaged if much finer.

    Coarser maps are interpolated (bicubic) to the step itself or a little finer: slopes of a coarse grid
    would be steps of their own. Maps finer than half the step are averaged in blocks. The top left sample's
    centre stays where it was.

    Args:
        height_map: the surface, (rows, cols).
        friction: one coefficient, or a map of the same shape, which is brought along.
        target_mm: step of the samples that will be taken, mm.

    Raises:
        MapError: a map so coarse and wide that the fine grid would exceed the limit of samples.
    """
    pitch = height_map.pitch_mm
    ratio = pitch / target_mm
    if ratio > 1.0 + 1e-6:
        factor = int(np.ceil(ratio - 1e-6))
        rows, cols = height_map.shape
        if rows * cols * factor**2 > MAX_PIXELS:
            raise MapError(
                f"{rows} x {cols} samples {pitch:g} mm apart, felt in steps of {target_mm:g} mm, would be "
                f"more than {MAX_PIXELS:,}; crop the map, or scan it in coarser steps"
            )
        filled, dropout = fill_dropouts(height_map.z_mm)
        z = _interpolate(filled, factor, order=3)
        z[_repeat(dropout, factor)[: z.shape[0], : z.shape[1]]] = np.nan
        if isinstance(friction, np.ndarray):
            # linear: a cubic would swing below zero beside the rim of an oil patch
            friction = _interpolate(friction, factor, order=1)
        return HeightMap(z, pitch / factor), friction
    block = int(np.floor(0.5 / ratio + 1e-6))
    # an odd block has its centre on a sample; the padding makes sample 0 the centre of block 0
    block -= 1 - block % 2
    if block < 2:
        return height_map, friction
    z = _average(height_map.z_mm, block)
    if isinstance(friction, np.ndarray):
        friction = _average(friction, block)
    return HeightMap(z, pitch * block), friction


def _interpolate(values: NDArray[np.float32], factor: int, *, order: int) -> NDArray[np.float32]:
    from scipy import ndimage

    rows, cols = values.shape
    shape = ((rows - 1) * factor + 1, (cols - 1) * factor + 1)
    # grid_mode=False maps first and last samples onto each other, so the pitch divides exactly
    out: NDArray[np.float32] = ndimage.zoom(
        values, (shape[0] / rows, shape[1] / cols), order=order, mode="nearest", grid_mode=False
    ).astype(np.float32)
    return out


def _repeat(mask: NDArray[np.bool_], factor: int) -> NDArray[np.bool_]:
    """Each sample's mask on the interpolated grid, centred on it."""
    half = factor // 2
    return np.repeat(np.repeat(mask, factor, axis=0), factor, axis=1)[half:, half:]


def _average(values: NDArray[np.float32], block: int) -> NDArray[np.float32]:
    """Mean over odd blocks centred on samples 0, block, 2 block ...; NaN only where a whole block is NaN."""
    half = block // 2
    rows, cols = values.shape
    n_rows, n_cols = (rows - 1) // block + 1, (cols - 1) // block + 1
    padded = np.pad(
        values,
        ((half, max(0, n_rows * block - rows - half)), (half, max(0, n_cols * block - cols - half))),
        mode="edge",
    )[: n_rows * block, : n_cols * block]
    blocks = padded.reshape(n_rows, block, n_cols, block)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3), dtype=np.float64)
    with np.errstate(invalid="ignore"):
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)
