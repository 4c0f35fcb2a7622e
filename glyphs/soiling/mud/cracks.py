"""Cracks of a drying layer: a net in which each generation halves the plates of the one before.

 ________________
|      |         |     1: oldest, widest; 2 ends at 1, and 3 at both, at about right angles
|      1____2____|     (A. Groisman and E. Kaplan, Europhys. Lett. 25, 1994)
|__3___|         |
|______|____ ____|
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.noise import Field


def nearest_crack(
    x_mm: Field,
    y_mm: Field,
    plate_mm: Field,
    *,
    size_mm: NDArray[np.float64],
    finest_mm: float,
    rng: np.random.Generator,
    gapes: float = 1.7,
    dots_a_plate: int = 5,
) -> Field:
    """Distance to the nearest crack.

    A crack opens where the plate that it halves is wider than `plate_mm`: the net is drawn once, and thicker layers
    leave its younger cracks closed. Older cracks gape wider, as if they were nearer.

    Args:
        x_mm: (rows, cols) where samples lie; bend them for bent cracks.
        y_mm: (rows, cols).
        plate_mm: (rows, cols) width of the widest plate that does not crack there.
        size_mm: (2,) width and height of the plate.
        finest_mm: width of the smallest plates.
        rng: the only source of randomness; what is drawn does not depend on `plate_mm`.
        gapes: width of the oldest cracks over that of the youngest.
        dots_a_plate: by which the plates of the last generation are measured.

    Returns:
        (rows, cols) mm, at most 0.3 `plate_mm`.
    """
    generations = int(np.clip(np.ceil(np.log2(np.prod(size_mm) / finest_mm**2)), 4, 12))
    dots = rng.random((dots_a_plate << generations, 2)) * size_mm
    turns = rng.normal(0.0, 0.28, (generations, 1 << generations))
    places = rng.uniform(-0.35, 0.35, (generations, 1 << generations))
    away, widest = np.float32(0.3) * plate_mm, float(plate_mm.max())
    cell, of = np.zeros(x_mm.shape, dtype=np.int64), np.zeros(len(dots), dtype=np.int64)
    for generation in range(generations):
        cells = 1 << generation
        nx, ny, at, width = _halve_cells(dots, of, turns[generation, :cells], places[generation, :cells])
        s = nx[cell] * x_mm + ny[cell] * y_mm - at[cell]
        off = np.abs(s)
        if width.min() > gapes * widest:
            off /= np.float32(gapes)
        else:
            relative = width[cell] / plate_mm
            off /= np.clip(relative, 1.0, gapes)
            off += plate_mm * np.clip(0.85 - relative, 0.0, 0.35)
        np.minimum(away, off, out=away)
        cell = 2 * cell + (s > 0.0)
        of = 2 * of + (nx[of] * dots[:, 0] + ny[of] * dots[:, 1] > at[of])
    return away


def _halve_cells(
    dots: NDArray[np.float64],
    of: NDArray[np.int64],
    turn_rad: NDArray[np.float64],
    place: NDArray[np.float64],
) -> tuple[Field, Field, Field, Field]:
    """Lines that halve each cell of dots across its longer way: normal x, y, offset; and the cell's width, mm."""
    n = np.maximum(np.bincount(of, minlength=len(place)), 1)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(of, values, len(place)) / n)

    mx, my = mean(dots[:, 0]), mean(dots[:, 1])
    dx, dy = dots[:, 0] - mx[of], dots[:, 1] - my[of]
    xx, yy, xy = mean(dx * dx), mean(dy * dy), mean(dx * dy)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) + turn_rad
    nx, ny = np.cos(angle), np.sin(angle)
    along = np.sqrt(np.maximum(xx * nx * nx + yy * ny * ny + 2.0 * xy * nx * ny, 1e-12))
    # a bar of length L spreads by L / sqrt(12)
    lines = np.stack([nx, ny, nx * mx + ny * my + place * along, np.sqrt(12.0) * along]).astype(np.float32)
    return lines[0], lines[1], lines[2], lines[3]
