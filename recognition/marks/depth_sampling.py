"""Depths looked up at many places: along lines moved and turned, across strokes, and the plane of their land."""

from __future__ import annotations

from typing import Any, TypeAlias

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
        origin_mm: x, y of the first.
    """

    def __init__(self, relief: Relief, *, raised: bool) -> None:
        felt = relief.height_mm if raised else -relief.height_mm
        self.depth_mm = np.pad(felt.astype(np.float64), 1, constant_values=np.nan)
        self.pitch_mm = relief.pitch_mm
        self.origin_mm = (relief.origin_mm[0] - relief.pitch_mm, relief.origin_mm[1] - relief.pitch_mm)


def turn_matrix(angle_deg: float) -> Floats:
    """Matrix that turns row vectors (right, down) by an angle, from +u towards +v."""
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[cos, sin], [-sin, cos]])


def percentile(values: NDArray[np.floating], percent: float) -> float:
    """As numpy's, linear between two values, but by one partition: those of large maps take long."""
    flat = values.ravel()
    at = percent / 100.0 * (flat.size - 1)
    k = int(at)
    parted = np.partition(flat, k)
    low = float(parted[k])
    high = float(parted[k + 1 :].min()) if at > k else low
    return low + (high - low) * (at - k)


def bilinear(depth: Floats, row: Floats, col: Floats) -> Floats:
    """Depth at places, in rows and columns of any shape; they are moved onto the map, and NaN beside what was felt."""
    row, col = np.clip(row, 0.0, depth.shape[0] - 1.001), np.clip(col, 0.0, depth.shape[1] - 1.001)
    r, c = row.astype(np.int64), col.astype(np.int64)
    down, right = row - r, col - c
    upper = depth[r, c] * (1.0 - right) + depth[r, c + 1] * right
    lower = depth[r + 1, c] * (1.0 - right) + depth[r + 1, c + 1] * right
    return np.asarray(upper * (1.0 - down) + lower * down)


@kernel()
def _mean_depths(depth, poses, middle, moves, out):  # type: ignore[no-untyped-def]
    """As `mean_depths`; looked up like `bilinear`."""
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


def mean_depths(depth: Floats, poses: Floats, middle: Floats, moves: NDArray[np.floating[Any]]) -> Floats:
    """(poses, moves down, moves right) mean depth of (poses, n, 2) points; places not felt count as land."""
    out = np.empty((poses.shape[0], moves.size, moves.size))
    # as views they would be compiled for once more
    _mean_depths(depth, np.ascontiguousarray(poses), middle, moves, out)
    return out


def across(depth: Floats, points: Floats, normals: Floats, aside: Floats, plane: Floats) -> Floats:
    """(aside, n) depth below a plane across a stroke at each of (n, 2) points."""
    row, col = (points[:, axis] + aside[:, None] * normals[:, axis] for axis in (0, 1))
    return np.asarray(bilinear(depth, row, col) - plane[0] - (row * plane[1] + col * plane[2]))


def deepest(depth: Floats, most_points: int) -> Floats:
    """(n,) depth where the stroke's middle is, looked for over neighbouring points together."""
    at = np.argmax(_together(depth, most_points), axis=0)
    return np.asarray(depth[at, np.arange(depth.shape[1])])


def crest(rise: Floats, most_points: int) -> Floats:
    """(n,) height of a rim where it is highest across, averaged over neighbouring points: one grain is no rim."""
    there = _together(np.ones_like(rise), most_points)
    return np.asarray((_together(rise, most_points) / there).max(axis=0))


def _together(values: Floats, most_points: int) -> Floats:
    """Sums of (aside, n) values over neighbouring points."""
    n = values.shape[1]
    window = min(most_points, n)
    ahead = (window - 1) // 2
    wide = np.pad(values, ((0, 0), (window - 1 - ahead, ahead)))
    return np.asarray(np.sum([wide[:, j : j + n] for j in range(window)], axis=0))


def robust_plane(level: Floats, row: Floats, col: Floats, *, rounds: int = 3) -> Floats:
    """(3,) level and slopes of samples at (row, col), by Tukey's weights, which leave out what lies off.

    Of land in a line the least slopes.
    """
    design = np.column_stack([np.ones(level.size), row, col])
    terms = np.array([percentile(level, 50.0), 0.0, 0.0])
    for _ in range(rounds):
        residual = level - design @ terms
        spread = 1.4826 * percentile(np.abs(residual), 50.0)
        if spread <= 0.0:
            break
        weighted = design * (np.clip(1.0 - (residual / (3.0 * spread)) ** 2, 0.0, None) ** 2)[:, None]
        terms = np.linalg.lstsq(weighted.T @ design, weighted.T @ level, rcond=None)[0]
    return terms
