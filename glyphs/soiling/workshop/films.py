"""Liquids that spread: paint that sets, oil that does not."""

from __future__ import annotations

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.surface.noise import ramp, share

PAINT_MPA = 150.0
OIL_MPA = 0.05
OIL_FRICTION = 0.08
_BEADS, _SPREAD = np.float32(0.45), np.float32(0.8)
_PAINTS = (
    (0.05, 0.22, 0.10),  # machine green
    (0.42, 0.42, 0.40),  # grey primer
    (0.55, 0.13, 0.04),  # red lead
    (0.05, 0.10, 0.28),  # blue
    (0.62, 0.60, 0.55),  # white
    (0.03, 0.03, 0.03),  # black
    (0.60, 0.42, 0.05),  # yellow
)


def add_paint(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Add a film of paint over large areas.

    It levels out, so it is thicker in grooves than on the land; it is chipped in places.

    ::

        ~~~~~~~\\            /~~~~~~   land: 20 to 80 um
        ________ \\~~~~~~~~/ ________   groove: the same plus a share of its depth
                \\__________/
    """
    from scipy.ndimage import gaussian_filter

    size = coat.height_mm
    wide = coat.noise(1.6 * size, rng)
    chips = coat.noise(rng.uniform(0.08, 0.2) * size, rng)
    peel = coat.noise(0.2, rng)
    where = coat.noise(0.8 * size, rng)
    film = rng.uniform(0.02, 0.08)
    levelling = rng.uniform(0.15, 0.5)
    colour = np.array(_PAINTS[rng.integers(len(_PAINTS))]) * rng.uniform(0.8, 1.1)
    gloss = rng.uniform(0.12, 0.5)
    rank = share(wide)
    edge = 1.0 - amount
    lost = share((chips + _SPREAD * where) / np.hypot(np.float32(1.0), _SPREAD))
    holds = ramp(rank, edge, edge + 0.02) * (1.0 - ramp(lost, 0.82, 0.84))
    smooth = gaussian_filter(coat.z_mm, 0.12 / coat.pitch_mm, mode="nearest")
    thick = film * (0.5 + 0.5 * amount) + levelling * amount * coat.hollow_mm() + 0.5 * (smooth - coat.z_mm)
    thick = np.maximum(thick + 0.002 * peel, 0.3 * film * amount) * holds
    thick = np.maximum(thick, 0.0).astype(np.float32)
    coat = coat.under_film(thick, PAINT_MPA, coat.friction + holds * (0.25 - coat.friction))
    skin = np.clip(np.asarray(colour, np.float32) * (1.0 + 0.05 * peel)[..., None], 0.005, 1.0)
    return coat.shaded(holds, albedo=skin, roughness=gloss, reflectance=0.045)


def add_oil(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Add patches of oil: slippery, darker and glossy; a little of it stands in the grooves."""
    size = coat.height_mm
    wide = coat.noise(rng.uniform(0.6, 1.6) * size, rng)
    beads = coat.noise(0.12 * size, rng)
    pool = rng.uniform(0.1, 0.3)
    tint = np.array([1.0, 0.92, 0.78]) ** rng.uniform(0.3, 1.2)
    rank = share((wide + _BEADS * beads) / np.hypot(np.float32(1.0), _BEADS))
    edge = 1.0 - 0.75 * amount
    wet = ramp(rank, edge, edge + 0.04)
    pooled = np.minimum(pool * coat.hollow_mm(), 0.05) * wet
    # oil soaks into grime, so there is no film on it
    pooled = np.where(coat.soft_mm > 0.0, 0.0, pooled).astype(np.float32)
    coat = coat.under_film(pooled, OIL_MPA, coat.friction + wet * (OIL_FRICTION - coat.friction))
    thick = 0.55 + 0.45 * ramp(rank, edge, edge + 0.3)
    return coat.shaded(
        (wet * thick).astype(np.float32),
        albedo=0.5 * coat.albedo * tint.astype(np.float32),
        roughness=np.minimum(coat.roughness, 0.13),
        reflectance=np.maximum(0.8 * coat.reflectance, 0.05),
    )
