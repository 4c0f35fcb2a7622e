"""Caked grime, which collects in patches of the grooves and yields to a hard push."""

from __future__ import annotations

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.surface.noise import ramp, share

SOFTEST_MPA, HARDEST_MPA = 3.0, 30.0
_RAGGED = np.float32(0.35)
_COLOURS = (
    (0.022, 0.019, 0.016),  # carbon and oil
    (0.055, 0.040, 0.027),  # cutting sludge
    (0.110, 0.090, 0.070),  # road dirt
    (0.160, 0.110, 0.065),  # clay and rust
    (0.240, 0.230, 0.210),  # grinding dust
)


def add_grime(
    coat: Coat,
    amount: float,
    *,
    rng: np.random.Generator,
    most_caked: float = 0.44,
    most_stained: float = 0.97,
) -> Coat:
    """Cake grime into the hollows of some patches and smear it thinly over the land.

    ::

        land ____                ____   patches (rank above 1 - share) fill from their edge inwards:
                 \\  .::::::.    /        partly, then to the brim, and in the middle slightly above it
                  \\::::::::::__/   between patches a thin residue stays in grooves

    Patches are where correlated noise exceeds a threshold. More grime lowers it, so the same patches grow.
    `most_caked` and `most_stained` are the shares of the plate that are caked and stained at amount 1.
    """
    size = coat.height_mm
    wide = coat.noise(rng.uniform(0.45, 1.1) * size, rng)
    ragged = coat.noise(rng.uniform(0.10, 0.2) * size, rng)
    texture = coat.noise(rng.uniform(0.12, 0.35), rng)
    fine = rng.standard_normal(coat.shape, dtype=np.float32)
    smear = coat.noise(rng.uniform(0.25, 0.7) * size, rng)
    spatter = coat.noise(rng.uniform(0.05, 0.13) * size, rng)
    blotch = coat.noise(rng.uniform(0.06, 0.16) * size, rng)
    spattered = rng.uniform(0.3, 1.2)
    thin = coat.noise(rng.uniform(0.1, 0.4) * size, rng)
    uneven = rng.uniform(0.25, 0.6) * (0.85 + 0.5 * amount)
    crisp = rng.uniform(0.05, 0.4)
    firmness = coat.noise(size, rng)
    firm_mpa = np.exp(rng.uniform(np.log(6.0), np.log(28.0)))
    brimming = rng.uniform(0.8, 1.1)
    heap = rng.uniform(0.02, 0.08)
    colour = np.array(_COLOURS[rng.integers(len(_COLOURS))]) * rng.uniform(0.8, 1.2)
    gloss = rng.uniform(0.45, 0.9)

    rank = share((wide + _RAGGED * ragged) / np.hypot(np.float32(1.0), _RAGGED))
    edge = 1.0 - most_caked * amount
    inside = np.clip((rank - edge) / 0.10, 0.0, 1.0).astype(np.float32)
    full = np.minimum(inside * (0.45 + 0.75 * ramp(rank, edge, edge + 0.25)), 1.0) * np.float32(brimming)
    residue = 0.36 * amount * np.clip(0.6 + 0.5 * ragged, 0.0, 1.5)
    level = np.maximum(full, residue).astype(np.float32)
    hollow = coat.hollow_mm()
    over = np.float32(heap * amount) * ramp(rank, edge + 0.08, edge + 0.35)
    fill = np.minimum(level, 1.05) * hollow + over
    # texture of the grime: lumps where it is thick enough, never below the surface under it
    lumps = (0.013 * texture + 0.003 * fine) * ramp(fill, 0.01, 0.08)
    fill = np.maximum(fill + lumps, 0.0).astype(np.float32)

    caked = ramp(fill, 0.004, 0.03)
    # a film too thin to be felt, but visible: smears and spatter, denser near the patches
    film = share((smear + spattered * spatter) / np.hypot(np.float32(1.0), np.float32(spattered)))
    bare = 1.0 - most_stained * (1.0 - (1.0 - amount) ** 3)
    opaque = np.clip(0.55 + 0.5 * amount + 0.22 * thin, 0.2, 0.98)
    stained = opaque * ramp(film + 0.25 * (rank - 0.5), bare - 0.4 * crisp, bare + 0.6 * crisp)
    cover = np.maximum(0.97 * caked, stained).astype(np.float32)
    hardness = np.clip(firm_mpa * np.exp(0.45 * firmness), SOFTEST_MPA, HARDEST_MPA)
    coat = coat.under_film(fill, hardness, coat.friction + 0.08 * caked)
    mottle = (np.exp(uneven * blotch - 0.5 * uneven**2) * (1.0 + 0.15 * texture + 0.06 * fine))[..., None]
    skin = np.clip(np.asarray(colour, np.float32) * mottle, 0.005, 1.0)
    return coat.shaded(cover, albedo=skin, roughness=gloss, reflectance=0.045)
