"""A hand-held grinder: arcs of furrows, burrs, and swathes in which the mark loses its depth::

            burr  burr      lip smeared over an edge
    ____     ^  ^^  ^   __==          land
        \\_/\\/\\_/  \\/\\_/    \\        /  disc: metal above it is removed,
                            \\______/   metal below it stays

Sources: see `glyphs.soiling.weld.plate`.
"""

from __future__ import annotations

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import axes_mm, stretch
from glyphs.soiling.weld.grid import cells
from glyphs.surface.noise import Field, ramp

FURROW_MM = (0.005, 0.08)
"""Depth of a grain's furrow."""
_DISC_RADIUS_MM = (57.5, 62.5)
_GRIP = 0.04
"""Clearance of the disc above a plate that is not ground, as a share of the greatest depth."""


def crown(coat: Coat) -> Field:
    """Surface on which a disc rides: the highest point within half a character, smoothed; sunk marks stay below it."""
    from scipy.ndimage import gaussian_filter, maximum_filter

    step = max(1, int(0.06 * coat.height_mm / coat.pitch_mm))
    near = 0.5 * coat.height_mm / (coat.pitch_mm * step)
    top = maximum_filter(coat.z_mm[::step, ::step], size=2 * int(0.5 * near) + 1, mode="nearest")
    return stretch(gaussian_filter(top, 0.4 * near, mode="nearest"), step, coat.shape)


def grind(coat: Coat, z: Field, level: Field, amount: float, rng: np.random.Generator) -> tuple[Field, Field]:
    """Grind the plate twice, the second time lighter and at an angle; return top and cover of bright metal."""
    depth_mm = float(np.quantile((level - coat.clean_mm)[::3, ::3], 0.97))
    turn = rng.choice([-1.0, 1.0]) * rng.uniform(50.0, 120.0)
    z, bright = _grind_once(coat, z, level, amount, depth_mm * rng.uniform(0.9, 1.2), np.deg2rad(turn), rng)
    turn += rng.choice([-1.0, 1.0]) * rng.uniform(25.0, 60.0)
    z, more = _grind_once(coat, z, level, amount, depth_mm * rng.uniform(0.4, 0.8), np.deg2rad(turn), rng)
    return z, np.maximum(bright, more)


def _grind_once(
    coat: Coat, z: Field, level: Field, amount: float, press_mm: float, turn: float, rng: np.random.Generator
) -> tuple[Field, Field]:
    pitch = coat.pitch_mm
    size = np.array(coat.shape[::-1]) * pitch
    radius = rng.choice(_DISC_RADIUS_MM) * rng.uniform(0.8, 1.0)
    middle = size * rng.uniform(0.3, 0.7, 2)
    x, y = (axis - np.float32(origin) for axis, origin in zip(axes_mm(coat), middle, strict=True))
    c, s = np.float32(np.cos(turn)), np.float32(np.sin(turn))
    arc = x * c + y * s
    side = y * c - x * s
    side += np.sqrt(np.float32(radius**2) - np.minimum(arc * arc, np.float32((0.95 * radius) ** 2)))
    side -= side.min()
    step = 0.5 * pitch
    line = (side * np.float32(1 / step)).astype(np.intp)
    lines = step * np.arange(int(line.max()) + 1, dtype=np.float32)
    first, length = float(arc.min()), float(np.ptp(arc))
    depth, notch, ridge = _furrows(coat, lines, length, rng)
    cell = (arc - np.float32(first)) * np.float32((depth.shape[1] - 1.001) / length)
    left = cell.astype(np.intp)
    near = line * depth.shape[1] + left
    cut = depth.ravel()[near]
    cut += (cell - left) * (depth.ravel()[near + 1] - cut)
    # where it is pressed hardest the disc bites from the start, elsewhere at larger amounts
    bite = 1.25 * amount - 0.6 * (1 - _swathes(lines, coat.height_mm, rng)) - _GRIP
    sunk = np.float32(press_mm) * bite.astype(np.float32)[line]
    grip = ramp(sunk, -_GRIP * press_mm, 0.2 * press_mm)
    cut *= grip
    disc = level - sunk - cut * notch[line]
    removed = np.clip((z - disc) * np.float32(1 / 0.003), 0.0, 1.0)
    new = np.minimum(z, disc) + removed * cut * ridge[line]
    lip = _behind(removed, c, s, max(1, round(0.02 * coat.height_mm / pitch))) * (1 - removed) * grip
    return new + 0.7 * lip * np.maximum(disc - new, 0.0), np.maximum(removed * grip, lip)


def _swathes(lines_mm: Field, height_mm: float, rng: np.random.Generator) -> Field:
    pressed = np.zeros_like(lines_mm)
    position = -rng.uniform(0.0, 2.0) * height_mm
    while position < lines_mm[-1]:
        width, force = height_mm * rng.uniform(0.8, 2.2), rng.uniform(0.6, 1.0)
        edge = np.clip((0.5 * width - np.abs(lines_mm - position - 0.5 * width)) / (0.4 * width), 0.0, 1.0)
        pressed = np.maximum(pressed, force * np.sqrt(edge))
        position += width * rng.uniform(0.8, 1.5)
    return pressed.astype(np.float32)


def _furrows(
    coat: Coat, lines_mm: Field, length_mm: float, rng: np.random.Generator
) -> tuple[Field, Field, Field]:
    coarse = np.sqrt(coat.height_mm / 5.0)
    width = max(rng.uniform(0.1, 0.18) * coarse, 1.6 * coat.pitch_mm)
    grain, within = cells(lines_mm, width, rng)
    n = (int(grain.max()) + 1, int(length_mm / (0.9 * coat.height_mm)) + 3)
    deep = np.clip(rng.uniform(0.014, 0.028) * coarse * np.exp(0.6 * rng.standard_normal(n)), *FURROW_MM)
    deep *= rng.random(n) < 0.75
    edge = np.abs(2 * within - 1)
    return deep.astype(np.float32)[grain], 1 - edge, 0.35 * ramp(edge, 0.5, 1.0)


def _behind(removed: Field, c: np.float32, s: np.float32, steps: int) -> Field:
    lip = np.zeros_like(removed)
    rows, cols = removed.shape
    for k in range(1, steps + 1):
        dx, dy = round(float(c) * k), round(float(s) * k)
        to = (slice(max(dy, 0), rows + min(dy, 0)), slice(max(dx, 0), cols + min(dx, 0)))
        of = (slice(max(-dy, 0), rows + min(-dy, 0)), slice(max(-dx, 0), cols + min(-dx, 0)))
        lip[to] += removed[of]
    return lip / np.float32(steps)
