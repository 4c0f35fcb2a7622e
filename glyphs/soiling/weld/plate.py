"""A plate beside a weld, layer by layer::

    seam                                                                      far from it
     |     bead    splat       lifted plate     ground swathe          arc strike
     |     .--.   _.--._           _.'         (burr)  (burr)         rim       rim
     |____/    \\_/      \\___===__=='_==__     ^        ^     _______/\\_       _/\\____ land
     |  <----- falling density ------>   \\_/\\_/\\/\\_/\\__/\\_/         \\_____/
     |                                    ground mark: its floors stay, the land is lowered

The order is: temper colours and scale on the hot plate, drops that freeze on it, a grinder (which removes tops of
drops, scale and land, but no floor below the disc), drops of the next bead, and a slipping electrode. All of it is
metal or oxide and hard: nothing yields under a tip, and soft dirt below is burnt away.

Sources:
    - Drops: 0.1 to 3 mm, most of them small (log-normal, like drops of a bursting liquid: A. H. Lefebvre, Atomization
      and Sprays). Large drops arrive fast and spread, small drops freeze as beads at an arrested contact angle of 40 to
      90 degrees (S. Schiaffino, A. A. Sonin, Phys. Fluids 9, 1997; J. Chapuis et al., Exp. Therm. Fluid Sci. 48, 2013).
    - Scale: bluish-black FeO and Fe3O4, here 5 to 50 um (R. Y. Chen, W. Y. D. Yuen, Oxid. Met. 56, 2001), brittle:
      cracks across the strain, shorter ones between, plates that lift and spall (M. Schuetze, Protective Oxide
      Scales and Their Breakdown).
    - Grinding: discs of 115 and 125 mm; grains of 0.2 to 0.7 mm (FEPA P80 to P24) cut furrows of 5 to 80 um and pile
      up about a third of what they displace beside them (K.-H. Zum Gahr, Microstructure and Wear of Materials).
    - Arc strikes: a few mm wide, remelted, 350 HV in steel of 150 HV (learnweldingsymbols.com, What is arc strike);
      ISO 6520-1, imperfection 601.
    - Tint: straw 205, brown 260, purple 282, blue 310, grey above 371 degrees C (ASM Handbook 4D, Temper Colors).

Estimates without a source: the spread of drop sizes (0.55 in the logarithm), how many stick, the share of plates that
spall (0.3) or lift, crack spacing, the depth and rim of strikes, and how sizes scale with the characters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import axes_mm, slow_noise
from glyphs.soiling.weld.grid import cells
from glyphs.soiling.weld.grinder import crown, grind
from glyphs.soiling.weld.molten import Seam, add_arc_strikes, add_spatter, draw_seam
from glyphs.surface.noise import Field, ramp

SCALE_MM = (0.005, 0.05)
"""Thickness of scale before it lifts."""
_TINT_C = (20.0, 176.0, 205.0, 260.0, 282.0, 310.0, 337.0, 371.0, 500.0)
_TINT = (
    *((1.0, 1.0, 1.0), (1.05, 1.0, 0.88), (1.3, 1.02, 0.45), (1.0, 0.56, 0.26), (0.68, 0.34, 0.6)),
    *((0.22, 0.36, 0.95), (0.5, 0.7, 1.05), (0.5, 0.52, 0.56), (0.35, 0.35, 0.37)),
)


# a layer's red, green, blue, roughness, reflectance, friction and hardness, MPa
_Finish = tuple[float, float, float, float, float, float, float]
_SCALE: _Finish = (0.075, 0.08, 0.095, 0.42, 0.16, 0.4, 5000.0)
_MOLTEN: _Finish = (0.11, 0.115, 0.13, 0.30, 0.32, 0.3, 3500.0)
_GROUND: _Finish = (0.36, 0.355, 0.34, 0.24, 0.6, 0.25, 2500.0)


def weld(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Soil a plate by welding beside it (a `SoilModel`)."""
    if amount <= 0.0:
        return coat
    parts = np.clip(amount * rng.uniform(0.5, 1.5, 5), 0.0, 1.0)
    tint, scale, spatter, disc, arc = (float(part) for part in parts)
    streams = rng.spawn(6)
    seam = draw_seam(coat, rng)
    z, scaled = _add_scale(coat, scale, streams[1])
    z, first = add_spatter(coat, z, seam, spatter, 0.4, streams[2])
    high = z
    z, bright = grind(coat, z, crown(coat), disc, streams[3])
    cut = high - np.minimum(z, high)
    z, second = add_spatter(coat, z, seam, spatter, 0.4, streams[4])
    z, remelted = add_arc_strikes(coat, z, arc, streams[5])
    burnt = (1 - scaled) * (1 - first) * (1 - second) * (1 - remelted)
    coat = replace(coat, z_mm=z, soft_mm=burnt * np.maximum(coat.soft_mm - cut, 0))
    layers = ((scaled, _SCALE), (first, _MOLTEN), (bright, _GROUND), (np.maximum(second, remelted), _MOLTEN))
    return _finish(_add_tint(coat, seam, tint, streams[0]), layers)


def _finish(coat: Coat, layers: tuple[tuple[Field, _Finish], ...]) -> Coat:
    names = ("roughness", "reflectance", "friction", "hardness_mpa")
    planes = [*np.moveaxis(coat.albedo, -1, 0), *(getattr(coat, name) for name in names)]
    for k in range(len(planes)):
        for cover, finish in layers:
            planes[k] = planes[k] + cover * (np.float32(finish[k]) - planes[k])
    changes: dict[str, Field] = dict(zip(names, planes[3:], strict=True))
    return replace(coat, albedo=np.stack(planes[:3], axis=-1), **changes)  # type: ignore[arg-type]


def _add_tint(coat: Coat, seam: Seam, amount: float, rng: np.random.Generator) -> Coat:
    wave = 1.0 + 0.06 * slow_noise(coat, 1.5 * coat.height_mm, rng)
    x, y = (axis.astype(np.float64) for axis in axes_mm(coat))
    hot_c = (amount * rng.uniform(400.0, 600.0) * seam.nearness(x, y)).astype(np.float32) * wave + 20
    at_c = np.arange(0.0, 720.0, 2.0)
    factor = np.stack([np.interp(at_c, _TINT_C, [c[k] for c in _TINT]) for k in range(3)], axis=1)
    mirrored = 1 - 0.5 * ramp(at_c.astype(np.float32), 100.0, 300.0)
    index = np.clip(0.5 * hot_c, 0, len(at_c) - 1).astype(np.intp)
    return replace(
        coat,
        albedo=np.minimum(coat.albedo * factor.astype(np.float32)[index], 1.0),
        reflectance=coat.reflectance * mirrored[index],
    )


def _add_scale(coat: Coat, amount: float, rng: np.random.Generator) -> tuple[Field, Field]:
    size = np.sqrt(coat.height_mm / 5.0)
    thick_mm = float(np.clip(size * rng.uniform(0.012, 0.04), *SCALE_MM))
    spacing = max(rng.uniform(25.0, 45.0) * thick_mm, 6.0 * coat.pitch_mm)
    turn = rng.uniform(0.0, np.pi)
    c, s = np.float32(np.cos(turn)), np.float32(np.sin(turn))
    x, y = axes_mm(coat)
    u, v = (np.float32(0.6 * spacing) * slow_noise(coat, 2.5 * spacing, rng) for _ in range(2))
    u += y * c - x * s
    v += x * c + y * s
    row, across = cells(v, spacing, rng)
    shift = (spacing * rng.uniform(0, 9, int(row.max()) + 1)).astype(np.float32)
    col, along = cells(u + shift[row], 1.7 * spacing, rng)
    plate = row * (int(col.max()) + 1) + col
    # each plate has its own onset; three in ten spall at once, three in ten lift at one end
    onset, lost, end = rng.random((3, int(plate.max()) + 1), dtype=np.float32)
    grown = np.float32(amount) - (0.7 * onset + 2.0 * (lost < 0.3))[plate]
    grown += 0.1 * slow_noise(coat, 0.8 * coat.height_mm, rng) * np.float32(amount)
    gap = 0.6 * coat.pitch_mm / spacing
    edge = np.minimum(1.7 * (0.5 - np.abs(along - 0.5)), 0.5 - np.abs(across - 0.5))
    cover = ramp(grown, 0.0, 0.45) * ramp(edge, 0.3 * gap, 1.5 * gap)
    lift = (np.maximum(end - 0.7, 0.0) * np.float32(8.0 * thick_mm))[plate] * along * along
    return coat.z_mm + cover * (np.float32(thick_mm) + lift), cover
