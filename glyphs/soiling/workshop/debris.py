"""Swarf and chips: hard metal lying on the land and across strokes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.coat import STEEL_FRICTION, STEEL_HARDNESS_MPA, Coat
from glyphs.soiling.strokes import across, along, drop, spread

LOWEST_MM, HIGHEST_MM = 0.05, 0.4
_TINTS = ((0.34, 0.34, 0.34), (0.36, 0.31, 0.22), (0.20, 0.22, 0.32), (0.16, 0.15, 0.14))


def add_swarf(coat: Coat, amount: float, *, rng: np.random.Generator, most_a_mm2: float = 0.28) -> Coat:
    """Add curls, slivers and grains, 0.05 to 0.4 mm high, that rest on the highest points below them.

    ::

          __.--.__           a curl or sliver bridges a groove;
        _/        \\_____o_   a grain lies wherever it fell
          \\______/
    """
    most = max(1, round(most_a_mm2 * coat.area_mm2))
    # shares of curls, slivers and grains differ from part to part
    kinds = rng.choice(3, size=most, p=rng.dirichlet((1.5, 2.5, 3.0)))
    # one stream per piece, so that a larger amount adds pieces to the same ones
    streams = rng.spawn(most)
    count = round(most * amount)
    top = np.full(coat.shape, -np.inf, dtype=np.float32)
    tint = np.zeros((*coat.shape, 3), dtype=np.float32)
    for kind, stream in zip(kinds[:count], streams[:count], strict=True):
        _lay(top, tint, coat, int(kind), stream)
    # a piece never lowers the surface
    lies = top > coat.z_mm + 1e-3
    if not lies.any():
        return coat
    z = np.where(lies, top, coat.z_mm)
    coat = replace(
        coat,
        z_mm=z.astype(np.float32),
        soft_mm=np.where(lies, np.float32(0.0), coat.soft_mm),
        hardness_mpa=np.where(lies, np.float32(STEEL_HARDNESS_MPA), coat.hardness_mpa),
        friction=np.where(lies, np.float32(STEEL_FRICTION), coat.friction),
    )
    return coat.shaded(lies.astype(np.float32), albedo=tint, roughness=0.22, reflectance=0.6)


def _lay(
    top: NDArray[np.float32],
    tint: NDArray[np.float32],
    coat: Coat,
    kind: int,
    rng: np.random.Generator,
) -> None:
    rows, cols = coat.shape
    place = rng.uniform(size=2) * (cols, rows) * np.float64(coat.pitch_mm)
    if kind == 2:
        line, radius, rise = _grain(rng)
    else:
        line, radius, rise = _curl(rng, coat.height_mm) if kind == 0 else _sliver(rng, coat.height_mm)
    line = along(line, 0.5 * coat.pitch_mm) + place
    n = len(line)
    s = np.linspace(0.0, 1.0, n)
    ahead = np.gradient(line, axis=0)
    side = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.maximum(np.hypot(*ahead.T), 1e-12)[:, None]
    taper = np.sqrt(np.clip(1.0 - (2.0 * s - 1.0) ** 2, 0.0, 1.0)) ** (0.6 if kind < 2 else 1.0)
    wave = 1.0 if kind == 2 else 0.75 + 0.25 * np.sin(2 * np.pi * (rng.uniform(1, 4) * s + rng.uniform()))
    offset, _ = across(2.0 * radius, coat.pitch_mm)
    profile = np.sqrt(np.clip(1.0 - (offset / (radius + 0.5 * coat.pitch_mm)) ** 2, 0.0, 1.0))
    pixel = np.clip(np.rint(line / coat.pitch_mm).astype(int), 0, (cols - 1, rows - 1))
    under = coat.z_mm[pixel[:, 1], pixel[:, 0]]
    bottom = float(np.quantile(under, 0.8 if kind < 2 else 0.5))
    height = np.clip(rise * taper * wave, 0.0, HIGHEST_MM)
    values = bottom + height[:, None] * profile[None, :]
    # slivers are pointed and grains round; a curl keeps its width
    narrowing = np.ones(n) if kind == 0 else taper
    points = spread(line, side * narrowing[:, None], offset)
    drop(top, points, values, pitch_mm=coat.pitch_mm)
    colour = np.array(_TINTS[rng.integers(len(_TINTS))]) * rng.uniform(0.7, 1.5)
    px = np.rint(points.reshape(-1, 2) / coat.pitch_mm).astype(int)
    seen = (px[:, 0] >= 0) & (px[:, 0] < cols) & (px[:, 1] >= 0) & (px[:, 1] < rows)
    tint[px[seen, 1], px[seen, 0]] = np.clip(colour, 0.02, 1.0)


def _curl(rng: np.random.Generator, size_mm: float) -> tuple[NDArray[np.float64], float, float]:
    turns = 0.3 + rng.exponential(0.6)
    t = np.linspace(0.0, 1.0, 60)
    angle = 2 * np.pi * turns * t * rng.choice((-1.0, 1.0)) + rng.uniform(0, 2 * np.pi)
    reach = size_mm * rng.uniform(0.05, 0.22)
    radius = reach * (0.5 + 0.5 * t)
    drift = reach * rng.uniform(0.3, 3.0) * t
    heading = rng.uniform(0, 2 * np.pi)
    line = np.stack(
        [radius * np.cos(angle) + drift * np.cos(heading), radius * np.sin(angle) + drift * np.sin(heading)],
        axis=1,
    )
    return line, rng.uniform(0.04, 0.14), rng.uniform(LOWEST_MM + 0.05, HIGHEST_MM)


def _sliver(rng: np.random.Generator, size_mm: float) -> tuple[NDArray[np.float64], float, float]:
    length = size_mm * float(np.clip(rng.lognormal(np.log(0.28), 0.6), 0.05, 1.2))
    s = np.linspace(-0.5, 0.5, 20)
    heading, bend = rng.uniform(0, 2 * np.pi), 0.25 * rng.standard_normal()
    u, v = length * s, length * bend * (4 * s**2 - 1) / 2
    line = np.stack(
        [u * np.cos(heading) - v * np.sin(heading), u * np.sin(heading) + v * np.cos(heading)], axis=1
    )
    return line, rng.uniform(0.03, 0.12), rng.uniform(LOWEST_MM, 0.28)


def _grain(rng: np.random.Generator) -> tuple[NDArray[np.float64], float, float]:
    radius = float(np.clip(rng.lognormal(np.log(0.1), 0.45), 0.05, 0.3))
    length, heading = 2.0 * radius * rng.uniform(1.0, 1.8), rng.uniform(0, 2 * np.pi)
    s = np.linspace(-0.5, 0.5, 8) * length
    line = np.stack([s * np.cos(heading), s * np.sin(heading)], axis=1)
    return line, radius, float(np.clip(radius * rng.uniform(0.7, 1.6), LOWEST_MM, HIGHEST_MM))
