"""Round pits and blisters, scattered over a plate, that grow and merge.

      .-"-.      .-"-.-.        height h (1 - r^2)^blunt over an ellipse with a ragged outline;
_____/     \\____/       \\____   where two overlap, the higher one counts
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.strokes import record_array
from glyphs.surface.noise import Field

Bumps: TypeAlias = Any
"""A numpy record array of round bumps on a plate:

- x_mm, y_mm: centre.
- radius_mm, height_mm: full size; for a pit the height is its depth.
- blunt: exponent of the profile (1 - r^2)^blunt: 0.25 flat with steep walls, 1 a dish.
- stretch, turn_rad: ratio of the long axis to the mean axis, and direction of the long axis.
- born: amount at which it begins to grow, 0 to 1.
"""


def scatter_bumps(
    coat: Coat,
    density: float,
    rng: np.random.Generator,
    *,
    width: float,
    spread: float,
    slope: float,
    blunt: float,
    born: float,
) -> Bumps:
    """Draw bumps at random places, log-normal in width and height; `blunt` is at most 1, `born` 0.8 more."""
    n = int(rng.poisson(density * coat.area_mm2 / coat.height_mm**2))
    log = spread * np.clip(rng.standard_normal((2, n)), -2.5, 2.5)
    radius = 0.5 * width * coat.height_mm * np.exp(log[0])
    return record_array(
        x_mm=rng.random(n) * coat.shape[1] * coat.pitch_mm,
        y_mm=rng.random(n) * coat.shape[0] * coat.pitch_mm,
        radius_mm=radius,
        height_mm=slope * radius * np.exp(0.8 * log[1]),
        blunt=rng.uniform(blunt, 1.0, n),
        stretch=np.exp(rng.uniform(0.0, 0.35, n)),
        turn_rad=rng.uniform(0.0, np.pi, n),
        born=born + 0.8 * rng.random(n),
    )


def union_mm(coat: Coat, bumps: Bumps, age: float, ragged: Field) -> Field:
    """Height of the union of the bumps at an age, mm; `ragged` makes their outlines irregular."""
    rows, cols = coat.shape
    grid = np.zeros(rows * cols, dtype=np.float32)
    grown = np.clip((age - bumps.born) / (1.05 - bumps.born), 0.0, 1.0)
    alive = np.flatnonzero(grown > 0.0)
    radius = bumps.radius_mm * grown**0.5
    # bumps of similar size share one window
    for some in np.array_split(alive[np.argsort(radius[alive])], 10):
        if not some.size:
            continue
        b = bumps[some]
        half = int(np.ceil(1.18 * float((radius[some] * b.stretch).max()) / coat.pitch_mm))
        step = np.arange(-half, half + 1)
        col = np.rint(b.x_mm / coat.pitch_mm).astype(np.int64)[:, None, None] + step[None, None, :]
        row = np.rint(b.y_mm / coat.pitch_mm).astype(np.int64)[:, None, None] + step[None, :, None]
        dx = (col * coat.pitch_mm - b.x_mm[:, None, None]).astype(np.float32)
        dy = (row * coat.pitch_mm - b.y_mm[:, None, None]).astype(np.float32)
        c, s = (f(b.turn_rad).astype(np.float32)[:, None, None] for f in (np.cos, np.sin))
        long, short = (
            (radius[some] * e).astype(np.float32)[:, None, None] for e in (b.stretch, 1 / b.stretch)
        )
        r2 = ((c * dx + s * dy) / long) ** 2 + ((c * dy - s * dx) / short) ** 2
        inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols) & (r2 < 1.38)
        cell = (row * cols + col)[inside]
        which = np.nonzero(inside)[0]
        dome = np.clip(1.0 - r2[inside] - 0.25 * np.clip(ragged.reshape(-1)[cell], -1.5, 1.5), 0.0, 1.0)
        high = (b.height_mm * grown[some] ** 0.7).astype(np.float32)[which]
        np.maximum.at(grid, cell, high * dome ** b.blunt.astype(np.float32)[which])
    return grid.reshape(rows, cols)
