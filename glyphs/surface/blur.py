"""Compiled blurring and sampling of fields: the same bits as `scipy.ndimage`, several times as fast.

Sums are in float64 and in scipy's order, so that both give the same picture; only the inner loop runs along rows, so
that it is vectorised.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel, read_only
from glyphs.surface.noise import Field


@kernel()
def _add(row, other, weight, total):  # type: ignore[no-untyped-def]
    for c in range(total.size):
        total[c] += (np.float64(row[c]) + np.float64(other[c])) * weight


@kernel()
def _blur(z, weights, out, line, total):  # type: ignore[no-untyped-def]
    rows, cols = z.shape
    size = weights.size - 1
    for r in range(rows):
        row = z[r]
        for c in range(cols):
            total[c] = np.float64(row[c]) * weights[0]
        for j in range(size, 0, -1):
            _add(z[max(r - j, 0)], z[min(r + j, rows - 1)], weights[j], total)
        for c in range(cols):
            line[size + c] = np.float32(total[c])
        for c in range(size):
            line[c] = line[size]
            line[cols + size + c] = line[size + cols - 1]
        for c in range(cols):
            total[c] = np.float64(line[size + c]) * weights[0]
        for j in range(size, 0, -1):
            _add(line[size - j : size - j + cols], line[size + j : size + j + cols], weights[j], total)
        for c in range(cols):
            out[r, c] = total[c]


def gaussian_blur(z: Field, sigma: float, *, truncate: float = 4.0) -> Field:
    """Blur a field, as `scipy.ndimage.gaussian_filter(z, sigma, mode="nearest", truncate=truncate)` does."""
    heights = read_only(z, np.float32)
    if sigma <= 1e-15:
        return np.array(heights)
    reach = int(truncate * sigma + 0.5)
    bell = np.exp(-0.5 / (sigma * sigma) * np.arange(-reach, reach + 1) ** 2)
    weights = (bell / bell.sum())[reach:]
    out = np.empty_like(heights)
    line, total = np.empty(heights.shape[1] + 2 * reach, np.float32), np.empty(heights.shape[1])
    _blur(heights, read_only(weights), out, line, total)
    return out


@kernel()
def _sample(z, row, col, out):  # type: ignore[no-untyped-def]
    rows, cols = z.shape
    for i in range(row.size):
        r0, c0 = np.floor(row[i]), np.floor(col[i])
        fr, fc = row[i] - r0, col[i] - c0
        a, b = int(r0), int(c0)
        if a >= 0 and b >= 0 and a < rows - 1 and b < cols - 1:
            value = np.float64(z[a, b]) * (1.0 - fr) * (1.0 - fc)
            value += np.float64(z[a, b + 1]) * (1.0 - fr) * fc
            value += np.float64(z[a + 1, b]) * fr * (1.0 - fc)
            value += np.float64(z[a + 1, b + 1]) * fr * fc
            out[i] = value


def sample_bilinear(z: Field, row: NDArray[np.float64], col: NDArray[np.float64]) -> Field:
    """Sample a field, as `scipy.ndimage.map_coordinates(z, [row, col], order=1, mode="mirror")` does."""
    from scipy.ndimage import map_coordinates

    heights, rows, cols = read_only(z, np.float32), read_only(row.ravel()), read_only(col.ravel())
    out = np.empty(rows.size, dtype=np.float32)
    _sample(heights, rows, cols, out)
    beyond = (rows < 0.0) | (cols < 0.0) | (rows >= z.shape[0] - 1) | (cols >= z.shape[1] - 1)
    if beyond.any():
        outer = np.stack([rows[beyond], cols[beyond]])
        out[beyond] = map_coordinates(
            heights, outer, output=np.float32, order=1, mode="mirror", prefilter=False
        )
    return out.reshape(row.shape)
