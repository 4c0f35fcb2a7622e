"""Cracks of a drying layer: a network in which each generation halves the plates of the generation before.

 ________________
|      |         |     1 is the oldest and widest; 2 ends at 1, and 3 at both, at about right angles
|      1____2____|     (A. Groisman and E. Kaplan, Europhys. Lett. 25, 1994)
|__3___|         |
|______|____ ____|
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.noise import Field


def nearest_crack(
    x_mm: Field,  # (rows, cols) x positions of the samples; distorted positions give curved cracks
    y_mm: Field,
    plate_mm: Field,  # (rows, cols) width of the widest plate that does not crack at each sample
    *,
    size_mm: NDArray[np.float64],
    finest_mm: float,
    rng: np.random.Generator,
    gape_ratio: float = 1.7,
    points_a_plate: int = 5,
) -> Field:
    """Distance to the nearest crack, (rows, cols), mm, at most 0.3 `plate_mm`. A crack opens where it halves a plate
    wider than `plate_mm`. Older cracks are wider, so they count as nearer."""
    generations = int(np.clip(np.ceil(np.log2(np.prod(size_mm) / finest_mm**2)), 4, 12))
    points = rng.random((points_a_plate << generations, 2)) * size_mm
    turns = rng.normal(0.0, 0.28, (generations, 1 << generations))
    places = rng.uniform(-0.35, 0.35, (generations, 1 << generations))
    away, widest = np.float32(0.3) * plate_mm, float(plate_mm.max())
    cell, cell_of = np.zeros(x_mm.shape, dtype=np.int64), np.zeros(len(points), dtype=np.int64)
    for generation in range(generations):
        cells = 1 << generation
        nx, ny, middle, width = _halve_cells(
            points, cell_of, turns[generation, :cells], places[generation, :cells]
        )
        s = nx[cell] * x_mm + ny[cell] * y_mm - middle[cell]
        off = np.abs(s)
        if width.min() > gape_ratio * widest:
            off /= np.float32(gape_ratio)
        else:
            relative = width[cell] / plate_mm
            off /= np.clip(relative, 1.0, gape_ratio)
            off += plate_mm * np.clip(0.85 - relative, 0.0, 0.35)
        np.minimum(away, off, out=away)
        cell = 2 * cell + (s > 0.0)
        cell_of = 2 * cell_of + (nx[cell_of] * points[:, 0] + ny[cell_of] * points[:, 1] > middle[cell_of])
    return away


def _halve_cells(
    points: NDArray[np.float64],
    cell_of: NDArray[np.int64],
    turn_rad: NDArray[np.float64],
    place: NDArray[np.float64],
) -> tuple[Field, Field, Field, Field]:
    n = np.maximum(np.bincount(cell_of, minlength=len(place)), 1)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(cell_of, values, len(place)) / n)

    mx, my = mean(points[:, 0]), mean(points[:, 1])
    dx, dy = points[:, 0] - mx[cell_of], points[:, 1] - my[cell_of]
    xx, yy, xy = mean(dx * dx), mean(dy * dy), mean(dx * dy)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + turn_rad
    nx, ny = np.cos(angle), np.sin(angle)
    along = np.sqrt(np.maximum(xx * nx * nx + yy * ny * ny + 2.0 * xy * nx * ny, 1e-12))
    # points spread evenly over a length L have standard deviation L / sqrt(12)
    lines = np.stack([nx, ny, nx * mx + ny * my + place * along, np.sqrt(12.0) * along]).astype(np.float32)
    return lines[0], lines[1], lines[2], lines[3]
