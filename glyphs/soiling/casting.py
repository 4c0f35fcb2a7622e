r"""Casting: the rough skin of a green-sand casting, on which or in which the mark stands.

One melt, hot here and cold there, makes all of it. Cold metal bridges and laps; hot metal soaks into the sand::

       cold: skin bridges, laps            |  hot: soaks in, cracks and burns the sand
    ___      __/)__/)__/)__      __        |     n  vein    .oo.                          ____
       \____/   wrinkles   \_  _/  \_gas_/ | ^v^v|^v^v^v^v.o.oOo.. burnt on  ^v^v\:::::/v^
       bridged mark        cold shut  U    |  prints of grains                     loose sand in a groove

- Misrun: oxide skin and surface tension carry the metal over what is finer than some radius; edges round off, then the
  mark goes. The capillary radius alone, 2 gamma / (rho g head) with 1.5 N/m, 7000 kg/m3 and 0.1 to 0.3 m, is 0.15 to
  0.45 mm (Campbell, "Castings", ch. 2, surface-tension-controlled filling); metal that freezes stops at a larger one.
- Wrinkles and cold shuts: an arrested front rolls over itself in rounded laps; where two fronts meet, a smooth-edged
  crack stays (St. Paul Foundry, defect glossary).
- Sand: the metal wets the wall of the mould no deeper than half its first grains ("rough surface" in the ladder rough
  surface, burn-on, burn-in, penetration: "Avoiding Penetration Defects"): sharp crests round shallow bowls, and a
  knob where a grain was missing. Grains 0.1 to 0.6 mm; Ra 12 to 28 um of green sand (YB Metal Solution, "Surface
  Roughness on Iron Castings"), 3 to 50 um of all sand castings (ZHY Casting, "Non-contact roughness assessment").
- Burn-on: grains held in metal and fayalite, one layer or more, as hard as the rest. Sand in a narrow recess has metal
  on three sides and the hottest corners, so it begins in the mark.
- Veins: metal in cracks of sand that expands at 573 C (Foseco, glossary, "Veining"), 0.1 to 1 mm wide ("Veining
  (metallurgy)"); what fettling leaves is a stump.
- Gas: smooth round holes in clusters, opened by the skin; pinholes up to 2 mm (Matson, "Pinholes and blow holes").
- Shrinkage: shallow dishes over what froze last.
- Loose sand: what blasting left in grooves; it crumbles at the compressive strength of moulding sand, 0.1 to 0.3 MPa.

Large castings are poured in coarse sand and their skins are thicker, so lengths go with the height of the characters,
inside the ranges above. A grid too coarse for the grains gets clumps of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.soiling.coat import Coat
from glyphs.soiling.strokes import across, along, drop, spread
from glyphs.surface.noise import Field, ramp, smooth_noise

GRAIN_MM = (0.1, 0.6)
"""Least and largest mean diameter of the grains."""
SAND_HARDNESS_MPA = 0.2
_SAND_FRICTION, _SKIN_FRICTION = np.float32(0.6), np.float32(0.35)
_MARK = 0.045
"""Usual depth of a mark, in heights of its characters."""


@dataclass(frozen=True, eq=False)
class _Mould:
    """The mould wall of one part, drawn before anything depends on the amount.

    Attributes:
        grain_mm: mean diameter.
        around: (rows, cols) squared distance from the middle of the nearest grain, in its radii, 0 to 1.4.
        rank: (rows, cols) uniform, the same all over a grain.
        tone: (rows, cols) how light the grain is, 0.5 to 1.5.
        warmth: (rows, cols) Gaussian, of about a character's length.
        ragged: (rows, cols) Gaussian, of a stroke's length.
    """

    grain_mm: float
    around: Field
    rank: Field
    tone: Field
    warmth: Field
    ragged: Field


def casting(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """A worse and worse sand casting."""
    if amount <= 0.0:
        return coat
    poured = min(1.0, amount * rng.uniform(0.85, 1.3))
    # one part is cold, another gassy; misrun and burn-on take whole characters, so they come late
    slowness = rng.uniform([0.7, 0.7, 0.7, 1.0, 1.0], [1.6, 1.6, 1.6, 2.2, 2.2])
    gassy, cracked, dirty, cold, burnt = (poured**slowness).tolist()
    streams = rng.spawn(7)
    mould = _mould(coat, streams[0])
    z = _bridged(coat, mould, cold) + _laps(coat, mould, cold, streams[1])
    # shrinkage: dishes a character or two wide over what froze last
    dishes = np.maximum(_slow(coat, 1.4 * coat.height_mm, streams[2]) - np.float32(0.6), 0.0)
    z -= np.float32(0.035 * poured * coat.height_mm) * dishes
    z += _prints(mould, poured) + _veins(coat, cracked, streams[3])
    held, crust = _burnt(coat, z, mould, burnt)
    z += crust
    sand = _sand(coat, z, mould, dirty, streams[4])
    z, hole = _blown(coat, z, sand, gassy, streams[5])
    sand *= 1.0 - hole
    there = np.minimum(sand / np.float32(0.3 * mould.grain_mm), 1.0)
    skin = np.float32(1.0 - np.exp(-4.0 * poured))
    friction = coat.friction + skin * np.maximum(_SKIN_FRICTION - coat.friction, 0.0)
    cast = replace(
        coat,
        z_mm=z,
        soft_mm=np.maximum(coat.soft_mm * (1.0 - np.maximum(held, hole)), sand),
        hardness_mpa=np.where(sand > 0.0, np.float32(SAND_HARDNESS_MPA), coat.hardness_mpa),
        friction=friction + there * (_SAND_FRICTION - friction),
    )
    return _looked(cast, mould, (skin, held, there, hole), streams[6])


def _coarse(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Smooth noise on a grid as coarse as its length allows; `_fine` brings it to the part's."""
    step = max(1, int(length_mm / coat.pitch_mm / 6.0))
    shape = (coat.shape[0] // step + 2, coat.shape[1] // step + 2)
    return smooth_noise(shape, pitch_mm=coat.pitch_mm * step, length_mm=length_mm, rng=rng)


def _fine(values: Field, shape: tuple[int, ...]) -> Field:
    """A coarse field on the part's grid."""
    from glyphs.opencv import cv2

    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def _slow(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Smooth noise of a length well above the pitch."""
    return _fine(_coarse(coat, length_mm, rng), coat.shape)


def _blurred(z: Field, width_mm: float, pitch_mm: float) -> Field:
    """Gaussian mean of `width_mm`, on a grid thinned where that is wide."""
    from glyphs.opencv import cv2

    step = max(1, int(width_mm / pitch_mm / 2.0))
    thin = (max(2, z.shape[1] // step), max(2, z.shape[0] // step))
    mean = cv2.resize(z, thin, interpolation=cv2.INTER_AREA)
    cv2.GaussianBlur(mean, (0, 0), width_mm / pitch_mm / step, dst=mean, borderType=cv2.BORDER_REPLICATE)
    return _fine(np.asarray(mean, dtype=np.float32), z.shape)


def _mould(coat: Coat, rng: np.random.Generator) -> _Mould:
    """Grains rammed against the pattern: a shaken lattice, so that they touch and none is like the next."""
    from glyphs.opencv import cv2

    grain = float(np.clip(0.05 * coat.height_mm * rng.uniform(0.75, 1.3), *GRAIN_MM))
    spacing = max(grain / coat.pitch_mm, 2.5)
    rows, cols = coat.shape
    v, u = np.mgrid[-1 : rows / spacing + 1, -1 : cols / spacing + 1]
    at = np.stack([v, u + 0.5 * (v % 2)]) + rng.uniform(-0.4, 0.4, (2, *v.shape))
    y, x = (spacing * at).reshape(2, -1).astype(np.float32)
    i, j = np.rint(y).astype(int), np.rint(x).astype(int)
    inside = (i >= 0) & (i < rows) & (j >= 0) & (j < cols)
    empty = np.ones(coat.shape, dtype=np.uint8)
    empty[i[inside], j[inside]] = 0
    labels = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1]
    whose: NDArray[np.intp] = labels.astype(np.intp)
    middles = np.zeros((2, int(whose.max()) + 1), dtype=np.float32)
    middles[:, whose[i[inside], j[inside]]] = np.stack([y, x])[:, inside]
    far = (np.take(middles[0], whose) - np.arange(rows, dtype=np.float32)[:, None]) ** 2
    far += (np.take(middles[1], whose) - np.arange(cols, dtype=np.float32)) ** 2
    rank, tone = rng.random((2, middles.shape[1]), dtype=np.float32)
    return _Mould(
        grain_mm=grain,
        around=np.minimum(far / np.float32(0.25 * spacing**2), np.float32(1.4)),
        rank=np.take(rank, whose),
        tone=np.take(tone + np.float32(0.5), whose),
        warmth=_slow(coat, 0.9 * coat.height_mm, rng),
        ragged=_slow(coat, 0.18 * coat.height_mm, rng),
    )


def _bridged(coat: Coat, mould: _Mould, amount: float) -> Field:
    """Misrun: where it is cold, the metal follows the mould only down to a radius. Height, mm.

    A raised character is a thin section in a narrow recess of the mould: it freezes before the land does.
    """
    near = _blurred(coat.z_mm, 0.05 * coat.height_mm, coat.pitch_mm)
    wide = _blurred(coat.z_mm, 0.20 * coat.height_mm, coat.pitch_mm)
    thin = np.clip((near - coat.brim_mm) / np.float32(_MARK * coat.height_mm), 0.0, 1.0)
    onset = 1.9 - 2.6 * amount
    cold = ramp(np.float32(1.5) * thin - mould.warmth, onset - 0.6, onset + 1.0)
    cold *= np.float32(min(1.0, 2.0 * amount))
    z = coat.z_mm + np.minimum(2.0 * cold, 1.0) * (near - coat.z_mm)
    return np.asarray(z + np.maximum(2.0 * cold - 1.0, 0.0) * (wide - near), dtype=np.float32)


def _laps(coat: Coat, mould: _Mould, amount: float, rng: np.random.Generator) -> Field:
    """Wrinkles, laps of a front that stops and goes, and the smooth seam where two fronts met. Added height, mm."""
    size, (rows, cols) = coat.height_mm, coat.shape
    heading, spacing = rng.uniform(0.0, 2.0 * np.pi), size * rng.uniform(0.25, 0.5)
    wander = _slow(coat, rng.uniform(1.0, 1.6) * size, rng)
    meet = _coarse(coat, rng.uniform(1.0, 1.6) * size, rng)
    x = np.arange(cols, dtype=np.float32) * np.float32(np.cos(heading) * coat.pitch_mm / spacing)
    y = np.arange(rows, dtype=np.float32) * np.float32(np.sin(heading) * coat.pitch_mm / spacing)
    front = x + y[:, None] + np.float32(1.1) * wander
    lap = np.sqrt(1.0 - (front - np.floor(front)) ** 2) - np.float32(np.pi / 4)
    onset = 1.9 - 2.0 * amount
    cold = ramp(np.float32(0.3) * mould.ragged - mould.warmth, onset, onset + 1.2)
    near = ramp(-mould.warmth, onset - 0.9, onset)
    # distance from the line where the two fronts are level, in widths of the crack
    slope = np.hypot(*np.gradient(meet)) * meet.shape[0] / (rows * coat.pitch_mm)
    away = _fine((meet / (slope + 0.1 / size) / (0.025 * size)).astype(np.float32), coat.shape)
    lips = np.exp(-((away / 3.0) ** 2))
    crack = lips * lips * lips
    seam = np.float32(0.35) * lips - np.float32(1.35) * crack * crack * crack
    lapped = np.float32(0.035) * cold * lap + np.float32(0.05) * near * seam
    return np.asarray(np.float32(amount * size) * lapped, dtype=np.float32)


def _prints(mould: _Mould, amount: float) -> Field:
    """Prints of the grains: crests between bowls, deeper where it was hot; knobs for missing grains. Added, mm."""
    wet = np.clip(1.0 + np.float32(0.45) * mould.warmth, 0.25, 1.8)
    bowls = mould.around * (np.float32(0.4) + mould.rank)
    knobs = np.maximum(1.0 - mould.around, 0.0) * (mould.rank > 0.93)
    deep = np.float32(0.3 * mould.grain_mm * min(1.0, 1.6 * amount))
    return np.asarray(deep * wet * (bowls + 2.2 * knobs - np.float32(0.45)), dtype=np.float32)


def _veins(coat: Coat, amount: float, rng: np.random.Generator) -> Field:
    """Thin raised stumps of metal that ran into cracks of the mould, each crack with a branch. Height, mm."""
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


def _burnt(coat: Coat, z: Field, mould: _Mould, amount: float) -> tuple[Field, Field]:
    """Grains fused on, in the mark first. Whether each is held, 0 to 1; and columns of unlike height, mm."""
    recess = np.clip((coat.brim_mm - z) / np.float32(_MARK * coat.height_mm), 0.0, 1.0)
    hot = mould.warmth + np.float32(0.6) * mould.ragged + np.float32(0.8) * recess
    onset = 2.7 - 3.4 * amount
    cover = ramp(hot, onset - 0.5, onset + 1.5)
    held = np.clip((cover - mould.rank) / np.float32(0.15), 0.0, 1.0)
    thick = np.float32((0.015 + 0.075 * amount) * coat.height_mm)
    layers = thick * cover * (0.5 + np.float32(0.9) * mould.rank)
    dome = np.float32(0.4 * mould.grain_mm) * np.sqrt(np.maximum(1.0 - mould.around, 0.0))
    return held, held * (layers + dome)


def _sand(coat: Coat, z: Field, mould: _Mould, amount: float, rng: np.random.Generator) -> Field:
    """Loose sand in what is still hollow, laid on `z` in place. Thickness, mm."""
    patches = _slow(coat, 0.7 * coat.height_mm, rng)
    onset = 2.0 - 3.0 * amount
    gap = np.float32(coat.height_mm * _MARK * (0.6 - 0.5 * amount))
    sand = ramp(patches, onset, onset + 1.2) * np.maximum(coat.brim_mm - z - gap, 0.0)
    sand *= 1.0 - np.float32(0.25) * mould.around
    z += sand
    return np.asarray(sand, dtype=np.float32)


def _blown(
    coat: Coat, top: Field, sand: Field, amount: float, rng: np.random.Generator
) -> tuple[Field, Field]:
    """Gas: round holes in the metal, closed while there was sand, so none lies in them. New top, mm, and where."""
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
    """Middle (y, x) mm, radius mm, when it opens, its depth under the skin in radii: pinholes, blowholes."""
    size, room = coat.height_mm, np.array(coat.shape) * coat.pitch_mm
    part = coat.area_mm2 / size**2
    bubbles = []
    for _ in range(1 + int(rng.poisson(0.3 * part))):
        nest, order = rng.random(2) * room, rng.random()
        for _ in range(int(rng.poisson(14))):
            radius = max(0.05, min(1.0, size * 0.03 * float(np.exp(0.45 * rng.standard_normal()))))
            at = nest + 0.4 * size * rng.standard_normal(2)
            bubbles.append((at, radius, min(1.0, order + 0.3 * rng.random()), rng.uniform(-0.3, 0.5)))
    for _ in range(int(rng.poisson(0.25 * part))):
        at, radius = rng.random(2) * room, size * rng.uniform(0.08, 0.2)
        bubbles.append((at, radius, rng.random(), rng.uniform(-0.6, 0.2)))
    return bubbles


def _looked(
    coat: Coat, mould: _Mould, covers: tuple[np.float32, Field, Field, Field], rng: np.random.Generator
) -> Coat:
    """Dull grey skin, darker on crests and brighter where cold; glassy tan grains; black sand; bluish holes."""
    skin, held, there, hole = covers
    bare = (1.0 - held) * (1.0 - there)
    crests = bare * (np.float32(1.1) - np.float32(0.35) * mould.around) * (1.0 - np.float32(0.5) * hole)
    # loose sand is the same sand, blackened by coal
    grains = mould.tone * (1.0 - bare - np.float32(rng.uniform(0.35, 0.65)) * there)
    tint = rng.uniform(0.11, 0.22) * np.array([1.0, 0.97, 0.93]) * rng.uniform(0.95, 1.05, 3)
    albedo = [
        np.float32(metal) * crests + np.float32(sand) * grains
        for metal, sand in zip(tint, (0.19, 0.165, 0.135), strict=True)
    ]
    dull = np.float32(rng.uniform(0.5, 0.6)) + np.float32(0.08) * mould.warmth - np.float32(0.2) * hole
    return coat.shaded(
        np.maximum(np.maximum(held, there), np.maximum(hole, skin)),
        albedo=np.stack(albedo, axis=-1),
        roughness=dull + np.float32(0.3) * there,
        reflectance=np.float32(0.05) + np.float32(0.25) * bare,
    )
