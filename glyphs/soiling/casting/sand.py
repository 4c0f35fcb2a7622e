"""Sand of the mould: prints of its grains, grains fused to the metal, and loose grains.

- Sand: the metal wets the wall of the mould no deeper than half its first grains ("rough surface" in the ladder rough
  surface, burn-on, burn-in, penetration: "Avoiding Penetration Defects"): sharp crests round shallow bowls, and a
  knob where a grain was missing. Grains 0.1 to 0.6 mm; Ra 12 to 28 um of green sand (YB Metal Solution, "Surface
  Roughness on Iron Castings"), 3 to 50 um of all sand castings (ZHY Casting, "Non-contact roughness assessment").
- Burn-on: grains held in metal and fayalite, one layer or more, as hard as the metal. Sand in a narrow recess has metal
  on three sides and the hottest corners, so burn-on begins in the mark.
- Loose sand: sand that blasting left in grooves; it crumbles at the compressive strength of moulding sand, 0.1 to
  0.3 MPa.

On a grid too coarse for single grains, clumps of them are drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.casting.fields import slow_noise
from glyphs.soiling.coat import Coat
from glyphs.surface.display import OneLine
from glyphs.surface.noise import Field, ramp

GRAIN_MM = (0.1, 0.6)
"""Least and largest mean diameter of the grains."""
SAND_HARDNESS_MPA = 0.2
MARK = 0.045
"""Usual depth of a mark, character heights."""


@dataclass(frozen=True, eq=False, repr=False)
class Mould(OneLine):
    """The mould wall of one part; it does not depend on the amount."""

    grain_mm: float
    # (rows, cols) squared distance from the middle of the nearest grain, squared radii, 0 to 1.4
    around: Field
    rank: Field  # (rows, cols) random number of the grain, uniform from 0 to 1
    tone: Field  # (rows, cols) relative brightness of the grain, 0.5 to 1.5
    warmth: Field  # (rows, cols) Gaussian noise about a character long
    ragged: Field  # (rows, cols) Gaussian noise about a stroke wide


def draw_mould(coat: Coat, rng: np.random.Generator) -> Mould:
    """Draw grains rammed against the pattern: a jittered lattice, so that they touch but differ."""
    from glyphs.opencv import cv2

    grain = float(np.clip(0.05 * coat.height_mm * rng.uniform(0.75, 1.3), *GRAIN_MM))
    spacing = max(grain / coat.pitch_mm, 2.5)
    rows, cols = coat.shape
    v, u = np.mgrid[-1 : rows / spacing + 1, -1 : cols / spacing + 1]
    centres = np.stack([v, u + 0.5 * (v % 2)]) + rng.uniform(-0.4, 0.4, (2, *v.shape))
    y, x = (spacing * centres).reshape(2, -1).astype(np.float32)
    i, j = np.rint(y).astype(int), np.rint(x).astype(int)
    inside = (i >= 0) & (i < rows) & (j >= 0) & (j < cols)
    empty = np.ones(coat.shape, dtype=np.uint8)
    empty[i[inside], j[inside]] = 0
    labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1]
    nearest: NDArray[np.intp] = labels.astype(np.intp)
    middles = np.zeros((2, int(nearest.max()) + 1), dtype=np.float32)
    middles[:, nearest[i[inside], j[inside]]] = np.stack([y, x])[:, inside]
    far = (np.take(middles[0], nearest) - np.arange(rows, dtype=np.float32)[:, None]) ** 2
    far += (np.take(middles[1], nearest) - np.arange(cols, dtype=np.float32)) ** 2
    rank, tone = rng.random((2, middles.shape[1]), dtype=np.float32)
    return Mould(
        grain_mm=grain,
        around=np.minimum(far / np.float32(0.25 * spacing**2), np.float32(1.4)),
        rank=np.take(rank, nearest),
        tone=np.take(tone + np.float32(0.5), nearest),
        warmth=slow_noise(coat, 0.9 * coat.height_mm, rng),
        ragged=slow_noise(coat, 0.18 * coat.height_mm, rng),
    )


def prints(mould: Mould, amount: float) -> Field:
    """Added height, mm, of grain prints: crests between bowls, deeper where hot, and knobs for missing grains."""
    wet = np.clip(1.0 + np.float32(0.45) * mould.warmth, 0.25, 1.8)
    bowls = mould.around * (np.float32(0.4) + mould.rank)
    knobs = np.maximum(1.0 - mould.around, 0.0) * (mould.rank > 0.93)
    deep = np.float32(0.3 * mould.grain_mm * min(1.0, 1.6 * amount))
    return np.asarray(deep * wet * (bowls + 2.2 * knobs - np.float32(0.45)), dtype=np.float32)


def burn_on(coat: Coat, z: Field, mould: Mould, amount: float) -> tuple[Field, Field]:
    """Fuse grains onto the metal, in the mark first: share of each that is held, and added height, mm."""
    recess = np.clip((coat.brim_mm - z) / np.float32(MARK * coat.height_mm), 0.0, 1.0)
    hot = mould.warmth + np.float32(0.6) * mould.ragged + np.float32(0.8) * recess
    onset = 2.7 - 3.4 * amount
    cover = ramp(hot, onset - 0.5, onset + 1.5)
    held = np.clip((cover - mould.rank) / np.float32(0.15), 0.0, 1.0)
    thick = np.float32((0.015 + 0.075 * amount) * coat.height_mm)
    layers = thick * cover * (0.5 + np.float32(0.9) * mould.rank)
    dome = np.float32(0.4 * mould.grain_mm) * np.sqrt(np.maximum(1.0 - mould.around, 0.0))
    return held, held * (layers + dome)


def loose_sand(coat: Coat, z: Field, mould: Mould, amount: float, rng: np.random.Generator) -> Field:
    """Add loose sand to the remaining hollows of `z`, in place; return its thickness, mm."""
    patches = slow_noise(coat, 0.7 * coat.height_mm, rng)
    onset = 2.0 - 3.0 * amount
    gap = np.float32(coat.height_mm * MARK * (0.6 - 0.5 * amount))
    sand = ramp(patches, onset, onset + 1.2) * np.maximum(coat.brim_mm - z - gap, 0.0)
    sand *= 1.0 - np.float32(0.25) * mould.around
    z += sand
    return np.asarray(sand, dtype=np.float32)
