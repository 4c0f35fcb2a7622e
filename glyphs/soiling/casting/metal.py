"""Defects of the metal: misruns, laps, veins from cracks of the mould, and gas holes.

- Misrun: oxide skin and surface tension keep the metal out of details finer than some radius; edges round off, then the
  mark disappears. The capillary radius alone, 2 gamma / (rho g head) with 1.5 N/m, 7000 kg/m3 and 0.1 to 0.3 m, is
  0.15 to 0.45 mm (Campbell, "Castings", ch. 2, surface-tension-controlled filling); freezing metal stops at a larger
  one.
- Wrinkles and cold shuts: an arrested front rolls over itself in rounded laps; where two fronts meet, a smooth-edged
  crack remains (St. Paul Foundry, defect glossary).
- Veins: metal in cracks of sand that expands at 573 C (Foseco, glossary, "Veining"), 0.1 to 1 mm wide ("Veining
  (metallurgy)"); fettling leaves stumps.
- Gas: smooth round holes in clusters, open at the skin; pinholes up to 2 mm (Matson, "Pinholes and blow holes").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.casting.fields import blur, coarse_noise, slow_noise
from glyphs.soiling.casting.sand import MARK, Mould
from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import resize
from glyphs.soiling.strokes import across, along, drop, spread
from glyphs.surface.noise import Field, ramp


def misrun(coat: Coat, mould: Mould, amount: float) -> Field:
    """Surface after a misrun, mm: where it is cold, the metal follows the mould only down to a radius."""
    near = blur(coat.z_mm, 0.05 * coat.height_mm, coat.pitch_mm)
    wide = blur(coat.z_mm, 0.20 * coat.height_mm, coat.pitch_mm)
    # a raised character is a thin section in a narrow recess of the mould: it freezes before the land does
    thin = np.clip((near - coat.brim_mm) / np.float32(MARK * coat.height_mm), 0.0, 1.0)
    onset = 1.9 - 2.6 * amount
    cold = ramp(np.float32(1.5) * thin - mould.warmth, onset - 0.6, onset + 1.0)
    cold *= np.float32(min(1.0, 2.0 * amount))
    z = coat.z_mm + np.minimum(2.0 * cold, 1.0) * (near - coat.z_mm)
    return np.asarray(z + np.maximum(2.0 * cold - 1.0, 0.0) * (wide - near), dtype=np.float32)


def laps(coat: Coat, mould: Mould, amount: float, rng: np.random.Generator) -> Field:
    """Added height, mm, of laps (a front that stops and starts) and of the smooth seam where two fronts met."""
    size, (rows, cols) = coat.height_mm, coat.shape
    heading, spacing = rng.uniform(0.0, 2.0 * np.pi), size * rng.uniform(0.25, 0.5)
    wander = slow_noise(coat, rng.uniform(1.0, 1.6) * size, rng)
    meet = coarse_noise(coat, rng.uniform(1.0, 1.6) * size, rng)
    x = np.arange(cols, dtype=np.float32) * np.float32(np.cos(heading) * coat.pitch_mm / spacing)
    y = np.arange(rows, dtype=np.float32) * np.float32(np.sin(heading) * coat.pitch_mm / spacing)
    front = x + y[:, None] + np.float32(1.1) * wander
    lap = np.sqrt(1.0 - (front - np.floor(front)) ** 2) - np.float32(np.pi / 4)
    onset = 1.9 - 2.0 * amount
    cold = ramp(np.float32(0.3) * mould.ragged - mould.warmth, onset, onset + 1.2)
    near = ramp(-mould.warmth, onset - 0.9, onset)
    # distance from the line where the two fronts are level, in widths of the crack
    slope = np.hypot(*np.gradient(meet)) * meet.shape[0] / (rows * coat.pitch_mm)
    far = (meet / (slope + 0.1 / size) / (0.025 * size)).astype(np.float32)
    away = resize(far, coat.shape, how="cubic")
    lips = np.exp(-((away / 3.0) ** 2))
    crack = lips * lips * lips
    seam = np.float32(0.35) * lips - np.float32(1.35) * crack * crack * crack
    lapped = np.float32(0.035) * cold * lap + np.float32(0.05) * near * seam
    return np.asarray(np.float32(amount * size) * lapped, dtype=np.float32)


def veins(coat: Coat, amount: float, rng: np.random.Generator) -> Field:
    """Height, mm, of thin stumps of metal that ran into cracks of the mould, each crack with a branch."""
    size, pitch = coat.height_mm, coat.pitch_mm
    fins = np.zeros(coat.shape, dtype=np.float32)
    room = np.array(coat.shape[::-1]) * pitch
    for _ in range(int(rng.poisson(0.35 * coat.area_mm2 / size**2))):
        start, heading, order = rng.random(2) * room, rng.uniform(0.0, 2.0 * np.pi), rng.random()
        turns, length = rng.standard_normal((2, 24)), size * rng.uniform(0.06, 0.16)
        tall, wide = size * rng.uniform(0.02, 0.06), size * rng.uniform(0.02, 0.05)
        wide, teeth = max(0.1, min(1.0, wide)), rng.uniform(0.2, 1.0, 48)
        grown = max(0.0, min(1.0, (amount - 0.8 * order) / 0.5))
        if grown == 0.0:
            continue
        offsets, _ = across(wide, pitch)
        ridge = np.clip(1.3 - 2.6 * np.abs(offsets) / (wide + pitch), 0.0, 1.0)
        for branch, turn in enumerate(turns):
            angle = heading + 0.9 * branch + np.cumsum(0.35 * turn)
            step = (0.3 + 0.7 * grown) * length / (1 + branch)
            way = step * np.cumsum(np.stack([np.cos(angle), np.sin(angle)], axis=1), axis=0)
            line = along(start + way, 0.9 * pitch)
            start = line[len(line) // 2]
            edge = np.gradient(line, axis=0)
            side = edge[:, ::-1] * [1.0, -1.0] / np.maximum(np.hypot(*edge.T), 1e-9)[:, None]
            crest = np.interp(np.linspace(0, 47, len(line)), np.arange(48), teeth)
            heights = grown * tall / (1 + 0.4 * branch) * crest[:, None] * ridge
            drop(fins, spread(line, side, offsets), heights, pitch_mm=pitch)
    return fins


def blow_holes(
    coat: Coat, top: Field, sand: Field, amount: float, rng: np.random.Generator
) -> tuple[Field, Field]:
    """Cut round gas holes. Return the new top, mm, and the holes' mask; no sand lies in them, as they open last."""
    pitch, (rows, cols) = coat.pitch_mm, coat.shape
    z, hole = top.copy(), np.zeros(coat.shape, dtype=np.float32)
    for middle, radius, order, under in _bubbles(coat, rng):
        r = radius * max(0.0, min(1.0, (amount - 0.75 * order) / 0.5))
        y, x = middle / pitch
        if r == 0.0 or not (0 <= y <= rows - 1 and 0 <= x <= cols - 1):
            continue
        reach = r / pitch + 1.0
        i, j = (slice(max(0, int(c - reach)), int(c + reach) + 2) for c in (y, x))
        v, u = np.arange(rows)[i, None], np.arange(cols)[None, j]
        inside = r**2 - ((v - y) ** 2 + (u - x) ** 2) * pitch**2
        mouth = (round(y), round(x))
        floor = top[mouth] - sand[mouth] - under * r - np.sqrt(np.maximum(inside, 0.0))
        cut = (inside > 0.0) & (floor < z[i, j])
        z[i, j] = np.where(cut, floor, z[i, j])
        hole[i, j] = np.maximum(hole[i, j], cut)
    return z, hole


def _bubbles(coat: Coat, rng: np.random.Generator) -> list[tuple[NDArray[np.float64], float, float, float]]:
    size, room = coat.height_mm, np.array(coat.shape) * coat.pitch_mm
    part = coat.area_mm2 / size**2
    bubbles = []
    for _ in range(1 + int(rng.poisson(0.3 * part))):
        nest, order = rng.random(2) * room, rng.random()
        for _ in range(int(rng.poisson(14))):
            radius = max(0.05, min(1.0, size * 0.03 * float(np.exp(0.45 * rng.standard_normal()))))
            centre = nest + 0.4 * size * rng.standard_normal(2)
            bubbles.append((centre, radius, min(1.0, order + 0.3 * rng.random()), rng.uniform(-0.3, 0.5)))
    for _ in range(int(rng.poisson(0.25 * part))):
        centre, radius = rng.random(2) * room, size * rng.uniform(0.08, 0.2)
        bubbles.append((centre, radius, rng.random(), rng.uniform(-0.6, 0.2)))
    return bubbles
