"""Molten steel on a plate: drops that weld on, and arc strikes. Sources: see `glyphs.soiling.weld.plate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import axes_mm
from glyphs.soiling.strokes import record_array
from glyphs.surface.display import OneLine
from glyphs.surface.noise import Field, ramp

DROP_MM = (0.1, 3.0)
"""Diameters of spatter."""
_DROP_SPREAD = 0.55
"""Standard deviation of the logarithm of a diameter."""
_EDGE_MM = 0.02
"""Thickness at which a drop hides the ground."""
Numbers = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Seam(OneLine):
    """The bead of a weld beside the plate, from which drops and heat decrease by e every `reach_mm`."""

    away: Numbers
    start_mm: float
    reach_mm: float

    def nearness(self, x_mm: Numbers, y_mm: Numbers) -> Numbers:
        """1 at the seam, falling by a factor of e per `reach_mm`."""
        a, b = self.away / self.reach_mm
        return np.asarray(np.exp(self.start_mm / self.reach_mm - a * x_mm) * np.exp(-b * y_mm))


def draw_seam(coat: Coat, rng: np.random.Generator) -> Seam:
    """Draw a bead along one side, more often the top or bottom, up to 12 degrees askew."""
    size = np.array(coat.shape[::-1]) * coat.pitch_mm
    side = np.deg2rad(
        rng.choice([90.0, 270.0, 0.0, 180.0], p=[0.35, 0.35, 0.15, 0.15]) + rng.uniform(-12, 12)
    )
    away = np.array([np.cos(side), np.sin(side)])
    corners = (np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * size * away).sum(axis=1)
    return Seam(away, float(corners.min()), float(np.ptp(corners) * rng.uniform(0.6, 1.6)))


def add_spatter(
    coat: Coat, z: Field, seam: Seam, amount: float, share: float, rng: np.random.Generator
) -> tuple[Field, Field]:
    """Add drops that fly from the seam, freeze and weld on, covering at most `share`; return top and cover."""
    median = 0.45 * np.sqrt(coat.height_mm / 5.0)
    n = int(np.ceil(share * coat.area_mm2 / (0.25 * np.pi * median**2 * np.exp(2 * _DROP_SPREAD**2))))
    size = np.array(coat.shape[::-1]) * coat.pitch_mm
    places = rng.uniform(0.0, 1.0, (n, 2)) * size
    diameter = np.clip(median * np.exp(_DROP_SPREAD * rng.standard_normal(n)), *DROP_MM)
    onset = rng.random(n) / seam.nearness(*places.T)
    heading = np.arctan2(seam.away[1], seam.away[0]) + 0.4 * rng.standard_normal(n)
    # satellites burst off large drops and lie ahead of them
    parent = rng.choice(n, n // 2, p=diameter**3 / np.sum(diameter**3))
    small = np.maximum(diameter[parent] * rng.uniform(0.1, 0.3, n // 2), DROP_MM[0])
    ahead = diameter[parent] * (0.6 + rng.exponential(0.5, n // 2))
    fan = heading[parent] + 0.6 * rng.standard_normal(n // 2)
    places = np.concatenate(
        [places, places[parent] + ahead[:, None] * np.stack([np.cos(fan), np.sin(fan)], axis=1)]
    )
    diameter, onset = np.append(diameter, small), np.append(onset, onset[parent])
    n = len(places)
    splat = rng.random(n) < np.clip(0.9 * diameter / median - 0.8, 0.05, 0.7)
    # a cap of contact angle t has height over radius tan(t / 2)
    high = np.where(splat, rng.uniform(0.14, 0.3, n), np.tan(np.deg2rad(rng.uniform(20.0, 45.0, n))))
    stretch = 1.0 + np.where(splat, 0.8, 0.35) * rng.random(n) ** 2
    lobe = np.where(splat, 0.16, 0.06) * rng.uniform(-1.0, 1.0, n)
    grown = np.clip((amount - onset) / 0.25, 0.0, 1.0) ** (1 / 3)
    radius, heading = 0.5 * diameter * grown, np.append(heading, fan)
    drops = record_array(
        x_mm=places[:, 0], y_mm=places[:, 1], radius_mm=radius, high=high, stretch=stretch, lobe=lobe, heading=heading,
        splat=splat,
    )  # fmt: skip
    return _lay_drops(z, drops[grown > 0.05], coat.pitch_mm)


def _lay_drops(z: Field, drops: Any, pitch_mm: float) -> tuple[Field, Field]:
    rows, cols = z.shape
    centre = np.stack([drops.x_mm, drops.y_mm], axis=1)
    half = drops.radius_mm * drops.stretch * 1.1
    low = np.clip(np.ceil((centre - half[:, None]) / pitch_mm), 0, [cols, rows]).astype(np.intp)
    high = np.clip(np.floor((centre + half[:, None]) / pitch_mm) + 1, 0, [cols, rows]).astype(np.intp)
    wide, tall = np.maximum(high - low, 0).T
    count = wide * tall
    # the samples of all windows one after the other; `owner` is the drop
    owner = np.repeat(np.arange(len(count)), count)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    down = place // wide[owner]
    row, col = low[owner, 1] + down, low[owner, 0] + place - down * wide[owner]

    def of(values: Numbers) -> Field:
        return np.asarray(values.astype(np.float32)[owner])

    dx, dy = (
        k.astype(np.float32) * np.float32(pitch_mm) - of(centre[:, i]) for i, k in enumerate((col, row))
    )
    r, c, s = of(drops.radius_mm), of(np.cos(drops.heading)), of(np.sin(drops.heading))
    u, w = (dx * c + dy * s) / (r * of(drops.stretch)), (dy * c - dx * s) / r
    q = u * u + w * w
    q *= 1 - of(drops.lobe) * u * (4 * u * u - 3 * q) / (np.maximum(q, 1e-6) * np.sqrt(np.maximum(q, 1e-6)))
    inside = q < 1.0
    owner, cell, q = owner[inside], row[inside] * cols + col[inside], q[inside]
    # a spherical cap; a flat splash is lower in its middle than near its edge
    tip = drops.high
    ball = of((1 + tip * tip) / (2 * tip))
    cap = np.sqrt(np.maximum(ball * ball - q, 0.0)) - ball + of(tip)
    cap *= np.where(drops.splat[owner], 0.5 + 1.3 * q, 1.0)
    flat = z.ravel()
    base = np.bincount(owner, weights=flat[cell], minlength=len(count)) / np.maximum(
        np.bincount(owner, minlength=len(count)), 1
    )
    level = np.maximum(of(base) + of(drops.radius_mm) * cap, flat[cell]).astype(np.float32)
    top = flat.copy()
    top[cell] = level
    while (under := top[cell] < level).any():  # another drop came last on this sample; the higher one shows
        cell, level = cell[under], level[under]
        top[cell] = level
    return top.reshape(z.shape), np.minimum((top - flat) * np.float32(1 / _EDGE_MM), 1.0).reshape(z.shape)


def add_arc_strikes(coat: Coat, z: Field, amount: float, rng: np.random.Generator) -> tuple[Field, Field]:
    """Add arc strikes: a slipping, dragging electrode leaves remelted craters with rims; return top and cover."""
    z, cover = z.copy(), np.zeros_like(z)
    size = np.array(coat.shape[::-1]) * coat.pitch_mm
    for onset in (0.1, 0.35, 0.6):
        centre, way = rng.uniform(0.0, 1.0, 2) * size, rng.uniform(0.0, 2 * np.pi)
        touches = 1 + int(rng.integers(5))
        radii = np.sqrt(coat.height_mm / 5.0) * rng.uniform(0.6, 1.6) * rng.uniform(0.6, 1.0, touches)
        for k, radius in enumerate(radii):
            grown = np.sqrt(np.clip((amount - onset - 0.04 * k) / 0.3, 0.0, 1.0))
            shape = (rng.uniform(0.12, 0.3), rng.uniform(0.04, 0.14), *rng.uniform(0.0, 2 * np.pi, 2))
            if radius * grown > 0.5 * coat.pitch_mm:
                _crater(coat, z, cover, centre, radius * float(grown), shape)
            centre = centre + rng.uniform(0.5, 1.1) * radius * np.array([np.cos(way), np.sin(way)])
            way += 0.4 * rng.standard_normal()
    return z, cover


def _crater(
    coat: Coat, z: Field, cover: Field, at_mm: Numbers, radius_mm: float, shape: tuple[float, ...]
) -> None:
    deep, rim, p, q = shape
    low, high = ((at_mm + side * 1.6 * radius_mm) / coat.pitch_mm for side in (-1, 1))
    box = tuple(slice(max(0, int(low[i])), max(0, int(high[i]) + 1)) for i in (1, 0))
    if not z[box].size:
        return
    x, y = axes_mm(coat)
    dx = (x[:, box[1]] - np.float32(at_mm[0])) / np.float32(radius_mm)
    dy = (y[box[0]] - np.float32(at_mm[1])) / np.float32(radius_mm)
    far = np.hypot(dx, dy) * (1 + np.float32(0.14) * np.sin(2.3 * dx + p) * np.sin(2.7 * dy + q))
    bowl = np.minimum(far**2 - 1, 0) * (deep + 0.05 * np.cos(10 * far + p)) * radius_mm
    pool = 1 - ramp(far, 0.85, 1.15)
    z[box] += pool * (bowl + z[box].mean() - z[box]) + rim * radius_mm * np.exp(-(((far - 1.05) / 0.18) ** 2))
    cover[box] = np.maximum(cover[box], 1 - ramp(far, 0.95, 1.5))
