"""Fit the curve of a line of text to points of its characters: straight, or an arc of a circle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

_ARC_POINTS = 33


def straight_through(points: Points, *, before: float, after: float) -> Points:
    """(2, 2) ends of the best line through (n, 2) middles in the order of reading, lengthened before and after."""
    points = np.asarray(points, dtype=np.float64)
    if len(points) < 2:
        return np.array([points[0] - (before, 0.0), points[0] + (after, 0.0)])
    middle, along, u, _ = _axes(points)
    ends = np.array([u[0] - before, u[-1] + after])
    return np.asarray(middle + ends[:, None] * along)


def arc_through(
    points: Points, *, height: float, before: float, after: float, least_sag: float = 0.04
) -> Points | None:
    """(n, 2) points on the nearest circle (Kasa's fit); None for too few, or a sagitta below `least_sag` heights."""
    points = np.asarray(points, dtype=np.float64)
    if len(points) < 4:
        return None
    middle, along, u, v = _axes(points)
    terms = np.stack([u, v, np.ones_like(u)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(terms, -(u * u + v * v), rcond=None)
    centre = np.array([-a / 2, -b / 2])
    radius = np.sqrt(max(centre @ centre - c, 0.0))
    half = (u.max() - u.min()) / 2
    if not radius > half or radius - np.sqrt(radius * radius - half * half) < least_sag * height:
        return None
    side = 1.0 if centre[1] > 0.0 else -1.0  # the middle of the circle lies below the text, or above
    angles = np.arctan2((u - centre[0]), side * (centre[1] - v))
    ends = np.linspace(angles[0] - before / radius, angles[-1] + after / radius, _ARC_POINTS)[:, None]
    across = np.array([-along[1], along[0]])
    on, down = centre[0] + radius * np.sin(ends), centre[1] - side * radius * np.cos(ends)
    return np.asarray(middle + on * along + down * across)


def _axes(points: Points) -> tuple[Points, Points, Points, Points]:
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    along = axes[0] if axes[0] @ (points[-1] - points[0]) >= 0.0 else -axes[0]
    return middle, along, (points - middle) @ along, (points - middle) @ np.array([-along[1], along[0]])
