"""The shapes that paint takes on a part: streaks, runs and curtains, orange peel, over-spray, flakes.

Sizes and their sources: `glyphs.soiling.paint.coats`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import axes_mm, resize
from glyphs.surface.display import OneLine
from glyphs.surface.noise import Field, ramp, smooth_noise

TENSION_N_PER_M = 0.03
_DENSITY_KG_PER_M3 = 1200.0
_GRAVITY_M_PER_S2 = 9.81


@dataclass(frozen=True, repr=False)
class Can(OneLine):
    """The paint of one part and its method of application."""

    wet_mm: float
    solids: float
    rubber: float  # 0 enamel, 1 chassis paint
    brushed: float  # 0 sprayed, 1 brushed
    seconds_per_pa_s: float  # time for which it stays fluid, divided by its viscosity
    downhill: tuple[float, float]  # unit vector x, y

    @property
    def finger_mm(self) -> float:
        """Distance between the fingers of a sagging film (Huppert)."""
        h = 1e-3 * 1.5 * self.wet_mm
        bond = _DENSITY_KG_PER_M3 * _GRAVITY_M_PER_S2 * h * h / TENSION_N_PER_M
        return float(1e3 * 14.0 * h * bond ** (-1 / 3))


def thin_coat(coat: Coat) -> Coat:
    """The surface on a grid of about a sixtieth of a character: fine enough for smooth films."""
    step = max(1, round(coat.height_mm / (55.0 * coat.pitch_mm)))
    return replace(coat, pitch_mm=step * coat.pitch_mm, z_mm=coat.z_mm[::step, ::step])


def coat_unevenness(coat: Coat, can: Can, rng: np.random.Generator) -> Field:
    """Unevenness left by brush or gun, a factor with a mean of about 1. Bristles leave streaks of 0.3 to 1.5 mm."""
    bristle = rng.uniform(0.15, 0.4) * (coat.height_mm / 5.0) ** 0.5
    streaks = _streaks(coat, bristle, 40 * bristle, rng.normal(0.0, 0.5), rng)
    streaks *= np.float32(0.5 * can.brushed)
    return np.asarray(np.exp(np.float32(0.3) * _slow_noise(coat, 0.9 * coat.height_mm, rng) + streaks))


def _streaks(coat: Coat, across_mm: float, along_mm: float, angle: float, rng: np.random.Generator) -> Field:
    from glyphs.opencv import cv2

    c, s = float(np.cos(angle)), float(np.sin(angle))
    x, y = axes_mm(coat)
    u, v = x * c + y * s, y * c - x * s
    su, sv = 0.3 * along_mm, max(0.3 * across_mm, 0.5 * coat.pitch_mm)
    u, v = (u - u.min()) / su, (v - v.min()) / sv
    shape = (int(v.max()) + 3, int(u.max()) + 3)
    table = smooth_noise(shape, pitch_mm=0.3, length_mm=1.0, rng=rng)
    return np.asarray(cv2.remap(table, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR))


def _slow_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    step = max(1.0, length_mm / (4.0 * coat.pitch_mm))
    rows, cols = (int(np.ceil(n / step)) + 3 for n in coat.shape)
    coarse = smooth_noise(
        (rows, cols), pitch_mm=0.25, length_mm=min(1.0, 0.25 * length_mm / coat.pitch_mm), rng=rng
    )
    size = (max(coat.shape[0], int(rows * step)), max(coat.shape[1], int(cols * step)))
    return resize(coarse, size, how="cubic")[: coat.shape[0], : coat.shape[1]]


def _size_mm(coat: Coat) -> tuple[float, float]:
    return coat.shape[1] * coat.pitch_mm, coat.shape[0] * coat.pitch_mm


def _count(coat: Coat, per_character: float, most: int) -> int:
    return int(np.clip(round(per_character * coat.area_mm2 / coat.height_mm**2), 2, most))


def _box(
    coat: Coat, x_mm: float, y_mm: float, across_mm: float, down_mm: float
) -> tuple[tuple[slice, slice], Field, Field]:
    x, y = axes_mm(coat)
    (i0, i1), (j0, j1) = (
        (max(0, int((middle - reach) / coat.pitch_mm)), max(0, int((middle + reach) / coat.pitch_mm) + 2))
        for middle, reach in ((y_mm, down_mm), (x_mm, across_mm))
    )
    return (slice(i0, i1), slice(j0, j1)), x[:, j0:j1] - x_mm, y[i0:i1] - y_mm


def runs(coat: Coat, can: Can, excess: float, rng: np.random.Generator) -> Field:
    """Wet height of runs and of one sagging curtain over a level film, mm; they grow from `excess` 0 to 1."""
    caps = _curtain(coat, can, excess, rng)
    n, size, (dx, dy) = _count(coat, 0.8, 80), coat.height_mm, can.downhill
    u, bend = rng.uniform(size=(n, 6)), rng.normal(size=(n, 2))
    for (at_x, at_y, wide, far, angle, late), (sway, phase) in zip(u.tolist(), bend.tolist(), strict=True):
        grown = min(max((excess - 0.7 * late) / 0.3, 0.0), 1.0)
        if grown == 0.0:
            continue
        half = 0.5 * min(max((0.15 + 0.3 * wide) * can.finger_mm, 0.18 * size), 0.6 * size)
        length = (0.6 + 2.4 * far) * size * grown
        steep = float(np.tan(np.radians(7.5 + 10.0 * angle))) * grown
        x0, y0 = (
            (1.2 * position - 0.1) * e - 0.3 * size * d
            for position, e, d in zip((at_x, at_y), _size_mm(coat), can.downhill, strict=True)
        )
        reach = (0.5 * length * abs(dx) + 1.7 * half, 0.5 * length * abs(dy) + 1.7 * half)
        box, x, y = _box(coat, x0 + 0.5 * length * dx, y0 + 0.5 * length * dy, *reach)
        s = x * dx + y * dy + 0.5 * length
        c = y * dx - x * dy + 0.15 * half * sway * np.sin(s / (2.0 * half) + phase)
        wide_here = half * (0.6 + 0.4 * np.clip(s / max(length, half), 0.0, 1.0))
        wide_here *= 1.0 + 0.45 * np.exp(-(((s - length) / (1.5 * half)) ** 2))
        beyond = np.maximum(s - length, 0.0) - 0.5 * np.minimum(s, 0.0)
        section = np.maximum(1.0 - (c * c + beyond * beyond) / wide_here**2, 0.0)
        caps[box] = np.maximum(caps[box], steep * wide_here * section)
    return caps


def _curtain(coat: Coat, can: Can, excess: float, rng: np.random.Generator) -> Field:
    x, y = axes_mm(coat)
    (dx, dy), size = can.downhill, coat.height_mm
    (start, turn, thick), wave = rng.uniform(size=3).tolist(), rng.normal(size=(2, 3))
    down, side = x * dx + y * dy, y * dx - x * dy
    low, high = float(side.min()), float(side.max())
    along = np.linspace(low, high, 500)
    period = min(0.6 * can.finger_mm, 1.6 * size)
    front = (
        0.35 * size * np.abs(np.sin(np.pi * along / period + 6.3 * turn + wave[0, 0] * np.sin(along / size)))
    )
    for k in range(3):
        front += 0.15 * size * wave[0, k] * np.sin(along / ((1.0 + k) * size) + 3.0 * wave[1, k])
    front += down.min() + (0.1 + 0.8 * start) * (down.max() - down.min()) + 0.5 * size * min(excess, 1.0)
    place = (side - low) * (498.0 / (high - low))
    left = place.astype(np.int32)
    table, rise = front.astype(np.float32), np.diff(front).astype(np.float32)
    back = table[left] + rise[left] * (place - left.astype(np.float32)) - down
    nose = can.finger_mm / 14.0
    falls = np.where(back > 0.0, back * (-2.0 / size), -((back * (1.0 / nose)) ** 2))
    height = can.wet_mm * (0.6 + thick) * min(max(excess, 0.0), 1.0)
    return np.asarray(np.exp(np.maximum(falls, -40.0)) * np.float32(height), dtype=np.float32)


def orange_peel(coat: Coat, can: Can, rng: np.random.Generator) -> Field:
    """Orange peel, a factor on the film: waves slightly too long to level, and waves as wide as strokes."""
    short = _slow_noise(coat, max(3.0 * can.wet_mm, 1.5 * coat.pitch_mm), rng)
    waves = np.float32(0.6) * short + np.float32(0.7) * _slow_noise(coat, 0.15 * coat.height_mm, rng)
    return np.float32(1.0) + np.clip(waves, -2.5, 2.5) * np.float32(0.18 * (1.0 - 0.6 * can.brushed))


def over_spray(coat: Coat, can: Can, rng: np.random.Generator) -> Field:
    """Lumps of droplets that dried in flight, and a few spits of the gun, mm; less on brushed parts."""
    where = np.clip(
        _slow_noise(coat, 1.2 * coat.height_mm, rng) * np.float32(0.6) + np.float32(0.1), 0.0, 1.0
    )
    lumps = np.maximum(_slow_noise(coat, max(0.09, 0.018 * coat.height_mm, 1.2 * coat.pitch_mm), rng), 0.0)
    dust = np.float32(min(0.045, 0.25 * can.wet_mm)) * where * lumps
    (wide_mm, high_mm) = _size_mm(coat)
    for x, y, size, steep in rng.uniform(size=(_count(coat, 1.2, 100), 4)).tolist():
        radius = (0.025 + 0.05 * size**3) * coat.height_mm
        box, u, v = _box(coat, x * wide_mm, y * high_mm, radius, radius)
        cap = np.maximum(1.0 - (u * u + v * v) / radius**2, 0.0) * (radius * (0.15 + 0.2 * steep))
        dust[box] = np.maximum(dust[box], cap)
    return np.asarray(dust * np.float32(1.0 - 0.7 * can.brushed), dtype=np.float32)


def chip_off(coat: Coat, much: float, rng: np.random.Generator) -> tuple[Field, Field]:
    """Share left, 0 to 1, of the first coat and of later ones: chips have sharp facets, grooves stay."""
    left = np.ones((2, *coat.shape), dtype=np.float32)
    hollow = coat.hollow_mm()
    depth = max(float(np.percentile(hollow[::3, ::3], 98.0)), 1e-3)
    (wide_mm, high_mm) = _size_mm(coat)
    for x, y, size, late, deep, *corners in rng.uniform(size=(_count(coat, 0.6, 60), 12)).tolist():
        radius = (0.08 + 0.4 * size**2) * coat.height_mm * min(max((much - 0.8 * late) / 0.6, 0.0), 1.0)
        if radius < 0.5 * coat.pitch_mm:
            continue
        box, u, v = _box(coat, x * wide_mm, y * high_mm, 2.0 * radius, 2.0 * radius)
        edge = np.full(hollow[box].shape, -radius, dtype=np.float32)
        for k, corner in enumerate(corners):
            turn = 2.0 * np.pi * (k + 0.7 * corners[-1 - k]) / len(corners)
            edge = np.maximum(
                edge, u * float(np.cos(turn)) + v * float(np.sin(turn)) - radius * (0.5 + corner)
            )
        off = np.clip(0.5 - edge / (1.2 * coat.pitch_mm), 0.0, 1.0)
        off *= 1.0 - 0.85 * ramp(hollow[box] / np.float32(depth), 0.25, 0.6)
        for layer in left if deep > 0.5 else left[1:]:
            layer[box] = np.minimum(layer[box], 1.0 - off)
    return left[0], left[1]
