"""A relief as depth into the mark, looked up along lines of points that are moved, turned and sized."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel
from whisker_array.estimation.relief import Relief

Floats: TypeAlias = NDArray[np.float64]


class DepthField:
    """A relief as depth into the mark, with a margin of unknown samples.

    Attributes:
        depth_mm: (rows, cols), NaN where not known.
        pitch_mm: of its samples.
    """

    def __init__(self, relief: Relief, *, raised: bool) -> None:
        felt = relief.height_mm if raised else -relief.height_mm
        self.depth_mm = np.pad(felt.astype(np.float64), 1, constant_values=np.nan)
        self.pitch_mm, self._origin_mm = relief.pitch_mm, relief.origin_mm

    def samples(self, places_mm: Floats) -> Floats:
        """(n, 2) row and column of places x, y."""
        return np.asarray((places_mm - self._origin_mm)[..., ::-1] / self.pitch_mm + 1.0)


def turn_matrix(angle_deg: float) -> Floats:
    """Matrix that turns row vectors (right, down) by an angle, from +u towards +v."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[cos, sin], [-sin, cos]])


@kernel()
def _mean_depths(depth, poses, middle, moves, out):  # type: ignore[no-untyped-def]
    """As `mean_depths`, bilinear."""
    n = poses.shape[1]
    for p in range(poses.shape[0]):
        for i in range(moves.size):
            for j in range(moves.size):
                total = 0.0
                down, right = middle[0] + moves[i], middle[1] + moves[j]
                for k in range(n):
                    row = min(max(poses[p, k, 0] + down, 0.0), depth.shape[0] - 1.001)
                    col = min(max(poses[p, k, 1] + right, 0.0), depth.shape[1] - 1.001)
                    r, c = int(row), int(col)
                    row, col = row - r, col - c
                    upper = depth[r, c] * (1.0 - col) + depth[r, c + 1] * col
                    lower = depth[r + 1, c] * (1.0 - col) + depth[r + 1, c + 1] * col
                    value = upper * (1.0 - row) + lower * row
                    total += value if abs(value) < np.inf else 0.0
                out[p, i, j] = total / n


def mean_depths(depth: Floats, poses: Floats, middle: Floats, moves: NDArray[np.floating]) -> Floats:
    """(poses, moves down, moves right) mean depth of (poses, n, 2) points; places not felt count as land."""
    out = np.empty((poses.shape[0], moves.size, moves.size))
    # as views they would be compiled for once more
    _mean_depths(depth, np.ascontiguousarray(poses), middle, moves, out)
    return out
