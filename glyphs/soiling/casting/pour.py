r"""Casting: the rough skin of a green-sand casting with raised or sunk marks.

One melt, hot in some places and cold in others, causes all defects. Cold metal bridges gaps and forms laps; hot metal
soaks into the sand::

       cold: skin bridges, laps            |  hot: soaks in, cracks and burns the sand
    ___      __/)__/)__/)__      __        |     n  vein    .oo.                          ____
       \____/   wrinkles   \_  _/  \_gas_/ | ^v^v|^v^v^v^v.o.oOo.. burnt on  ^v^v\:::::/v^
       bridged mark        cold shut  U    |  prints of grains                     loose sand in a groove

`metal` models defects of the metal and `sand` those of the sand, with their sources. This module combines them in the
order of a pouring. Shrinkage leaves shallow dishes where the metal froze last.

Large castings are poured in coarser sand and have thicker skins, so lengths scale with the height of the characters,
within the ranges named in those modules.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.soiling.casting.fields import slow_noise
from glyphs.soiling.casting.metal import blow_holes, laps, misrun, veins
from glyphs.soiling.casting.sand import SAND_HARDNESS_MPA, Mould, burn_on, draw_mould, loose_sand, prints
from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field

_SAND_FRICTION, _SKIN_FRICTION = np.float32(0.6), np.float32(0.35)


def casting(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Turn the surface into that of a sand casting; `amount` sets its roughness."""
    if amount <= 0.0:
        return coat
    poured = min(1.0, amount * rng.uniform(0.85, 1.3))
    # parts differ in their defects; misrun and burn-on can remove whole characters, so they start later
    slowness = rng.uniform([0.7, 0.7, 0.7, 1.0, 1.0], [1.6, 1.6, 1.6, 2.2, 2.2])
    gassy, cracked, dirty, cold, burnt = (poured**slowness).tolist()
    streams = rng.spawn(7)
    mould = draw_mould(coat, streams[0])
    z = misrun(coat, mould, cold) + laps(coat, mould, cold, streams[1])
    # shrinkage: dishes one or two characters wide where the metal froze last
    dishes = np.maximum(slow_noise(coat, 1.4 * coat.height_mm, streams[2]) - np.float32(0.6), 0.0)
    z -= np.float32(0.035 * poured * coat.height_mm) * dishes
    z += prints(mould, poured) + veins(coat, cracked, streams[3])
    held, crust = burn_on(coat, z, mould, burnt)
    z += crust
    sand = loose_sand(coat, z, mould, dirty, streams[4])
    z, hole = blow_holes(coat, z, sand, gassy, streams[5])
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
    return _apply_look(cast, mould, (skin, held, there, hole), streams[6])


def _apply_look(
    coat: Coat, mould: Mould, covers: tuple[np.float32, Field, Field, Field], rng: np.random.Generator
) -> Coat:
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
