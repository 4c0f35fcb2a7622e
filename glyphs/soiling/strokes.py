"""Draw thin objects on a grid as points along and across a line; each sample keeps the largest value."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


def record_array(**columns: NDArray[Any]) -> Any:
    """A numpy record array of columns (n,); an index selects from all of them."""
    return np.rec.fromarrays(list(columns.values()), names=list(columns))  # type: ignore[call-overload]


def across(width_mm: float, pitch_mm: float) -> tuple[NDArray[np.float64], float]:
    """Symmetric offsets (n,) across a line of this width, at most 0.6 samples apart, and their spacing, mm."""
    half = 0.5 * width_mm + 0.5 * pitch_mm
    count = 2 * int(np.ceil(half / (0.6 * pitch_mm))) + 1
    offsets = np.linspace(-half, half, count)
    return offsets, float(offsets[1] - offsets[0])


def spread(line: Points, side: Points, offsets: NDArray[np.float64]) -> Points:
    """(points, offsets, 2): every point of a line moved along `side` ((2,) or (points, 2)) by every offset."""
    side = np.broadcast_to(side, line.shape)
    return np.asarray(line[:, None, :] + offsets[None, :, None] * side[:, None, :])


def drop(grid: NDArray[np.float32], points: Points, values: NDArray[np.float64], *, pitch_mm: float) -> None:
    """Raise each sample of `grid`, in place, to the largest value dropped on it at (..., 2) x, y in mm."""
    pixel = np.rint(points.reshape(-1, 2) / pitch_mm).astype(np.int64)
    v = values.reshape(-1).astype(np.float32)
    inside = (
        (pixel[:, 0] >= 0)
        & (pixel[:, 0] < grid.shape[1])
        & (pixel[:, 1] >= 0)
        & (pixel[:, 1] < grid.shape[0])
    )
    np.maximum.at(grid, (pixel[inside, 1], pixel[inside, 0]), v[inside])


def along(line: Points, step_mm: float) -> Points:
    """The line resampled every `step_mm` or closer."""
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    s = np.linspace(0.0, lengths[-1], max(2, int(np.ceil(lengths[-1] / step_mm)) + 1))
    return np.stack([np.interp(s, lengths, line[:, 0]), np.interp(s, lengths, line[:, 1])], axis=1)
