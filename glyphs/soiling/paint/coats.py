"""Paint: coats that level themselves, run downhill, dry, shrink and flake off.

    gravity -->                           chip   run, bead at its end   dry over-spray
              ____  wet, levelled ____    | |         ___                 . ..:.. .
      dry ___/    \\__          _______\\___| |________/   \\____________.:_::::::::_
      =====\\        \\________/  /==================\\______/=====================   steel
            \\_groove_: pool ___/     edge: thin      pool under a run

- A wet film levels by surface tension: a ripple of wave number k fades as exp(-t k^4 sigma h^3 / 3 eta), short ones
  first (S. E. Orchard, "On surface levelling in viscous liquids and gels", Appl. Sci. Res. A 11, 1963; simulated over
  real sheet by B. Figliuzzi et al., "Numerical simulation of thin paint film flow", J. Math. Industry 2:1, 2012).
  The film thins at edges and pools in grooves, and no paint is lost.
- Drying leaves the solids: 0.42 to 0.48 of the volume of an alkyd enamel, from 88 to 150 um wet to 38 to 63 um dry per
  coat (Rust-Oleum 412402, data sheet), more for chassis paint. The film over a groove sinks again, less with every
  coat.
- A film that is too thick sags: ridges and fingers about 14 h (rho g h^2 / sigma)^(-1/3) apart (H. E. Huppert, "Flow
  and instability of a viscous current down a slope", Nature 300, 1982): 8 to 17 mm here. Sag is tested with notches of
  50 to 1000 um (ASTM D4400). A run is a cap of contact angle 15 to 35 degrees (an estimate).
- Orange peel is waviness of 0.3 to 10 mm (bands Wb, Wc, Wd of BYK's wave-scan); over-spray is droplets of 20 to
  100 um that dried in flight and stick in lumps.
- Half of the parts have enamel, which is hard: the tip does not mark it. The others range from enamel to rubbery
  chassis paint, which yields a little (4 to 150 MPa, an estimate) and has more friction.

Thickness scales with the depth of the marks: large marks are cut into heavy parts, which get thick paint.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import blur, resize
from glyphs.soiling.paint.shapes import (
    TENSION_N_PER_M,
    Can,
    chip_off,
    coat_unevenness,
    orange_peel,
    over_spray,
    runs,
    thin_coat,
)
from glyphs.surface.noise import Field

_STARTS = (0.0, 0.24, 0.5)
"""Amount at which each coat begins; it is complete 0.5 later."""
WET_MM = (0.04, 0.5)
"""Thinnest and thickest wet coat that a brush or gun applies at once."""
_HIDING_MM = 0.012
"""Thickness of dry film that hides all but 1/e of the surface below."""
_ENAMEL_MPA, _RUBBER_MPA = 150.0, 4.0
_COLOURS = (
    (0.03, 0.03, 0.032),  # black
    (0.22, 0.23, 0.23),  # machine grey
    (0.60, 0.60, 0.57),  # white
    (0.04, 0.13, 0.07),  # green
    (0.03, 0.08, 0.25),  # blue
    (0.45, 0.27, 0.03),  # yellow
    (0.25, 0.07, 0.04),  # red oxide
)


def paint(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Paint a surface several times; see the module. `amount` sets the number of coats."""
    if amount <= 0.0:
        return coat
    much = min(1.0, amount * rng.triangular(0.5, 1.0, 1.5))
    can, thin = _draw_can(coat, rng), thin_coat(coat)
    top, dry = coat.z_mm, []
    for start in _STARTS:
        gain = float(np.clip((much - start) / 0.5, 0.0, 1.0))
        wet = np.float32(gain * can.wet_mm) * resize(coat_unevenness(thin, can, rng), coat.shape)
        film = level_film(top, wet, pitch_mm=coat.pitch_mm, seconds_per_pa_s=can.seconds_per_pa_s)
        dry.append(np.float32(can.solids) * film)
        top = top + dry[-1]
    first, second = dry[0], (dry[1] + dry[2]) * resize(orange_peel(thin, can, rng), coat.shape)
    caps = resize(runs(thin, can, (much - 0.1) / 0.8, rng), coat.shape)
    second += np.float32(can.solids) * _flow_runs(top, caps, can, coat)
    dusty = np.float32(min(1.0, 1.2 * much)) * resize(over_spray(thin, can, rng), coat.shape)
    second += dusty
    left_first, left_rest = chip_off(coat, much, rng)
    return _finish(coat, can, (first * left_first, second * left_rest), dusty, rng)


def _draw_can(coat: Coat, rng: np.random.Generator, *, wet_of_depth: float = 0.85) -> Can:
    low, high = np.percentile((coat.clean_mm - coat.brim_mm)[::3, ::3], [1.0, 99.0])
    u = rng.uniform(size=6).tolist()
    rubber = max(0.0, 2.0 * u[0] - 1.0)
    angle = 2.0 * np.pi * u[5]
    return Can(
        wet_mm=float(np.clip(wet_of_depth * (high - low) * (0.7 + 0.5 * u[1]), *WET_MM)),
        solids=0.42 + 0.10 * u[2] + 0.25 * rubber,
        rubber=rubber,
        brushed=float(np.clip(2.0 * u[3] - 0.5, 0.0, 1.0)),
        seconds_per_pa_s=float(np.exp(np.log(6.0) + u[4] * np.log(10.0)) * (1 - 0.7 * rubber)),
        downhill=(float(np.cos(angle)), float(np.sin(angle))),
    )


def level_film(
    top: Field, wet: Field, *, pitch_mm: float, seconds_per_pa_s: float, pinned: float = 0.3
) -> Field:
    """Level a wet film by Orchard's law to at least `pinned` times `wet`; no paint is lost."""
    from scipy import fft

    mean_mm = float(wet.mean())
    if mean_mm <= 0.0:
        return wet
    # sigma h^3 t / 3 eta in m^4, then in mm^4
    reach_mm4 = 1e12 * TENSION_N_PER_M * (1e-3 * mean_mm) ** 3 * seconds_per_pa_s / 3.0
    rows, cols = top.shape
    scale = np.pi * reach_mm4**0.25 / pitch_mm
    v, u = ((scale / n * np.arange(n, dtype=np.float32)) ** 2 for n in (rows, cols))
    fade = np.exp(-np.minimum((v[:, None] + u[None, :]) ** 2, np.float32(60.0)))
    film = fft.idctn(fft.dctn(top + wet) * fade) - top
    # where the film would be thinner than the pinned share, it keeps that share, taken from the rest of the film
    least = np.float32(pinned) * wet
    over = np.maximum(film - least, 0.0)
    spare = float(np.mean(wet - least, dtype=np.float64)) / max(float(np.mean(over, dtype=np.float64)), 1e-9)
    return np.asarray(least + np.float32(spare) * over, dtype=np.float32)


def _flow_runs(top: Field, caps: Field, can: Can, coat: Coat) -> Field:
    if not caps.any():
        return caps
    thin = thin_coat(replace(coat, z_mm=top))
    level = resize(blur(thin.z_mm, 0.09 * thin.height_mm / thin.pitch_mm, mirror=True), coat.shape)
    cover = caps / (caps + np.float32(0.4 * can.wet_mm))
    return np.asarray(caps + cover * np.maximum(level - top, 0.0), dtype=np.float32)


def _finish(coat: Coat, can: Can, dry: tuple[Field, Field], dusty: Field, rng: np.random.Generator) -> Coat:
    picks = rng.integers(len(_COLOURS), size=2)
    tints = (np.array(_COLOURS)[picks] * rng.uniform(0.75, 1.25, size=(2, 1))).astype(np.float32)
    gloss = float(rng.uniform(0.08, 0.22)) + 0.4 * can.rubber
    # visible share of the metal, and of the first coat under the others
    metal, under = (np.exp(film * np.float32(-1.0 / _HIDING_MM)) for film in dry)
    albedo = np.empty_like(coat.albedo)
    metal, under, over = metal * under, (1.0 - metal) * under, 1.0 - under
    for c in range(3):
        albedo[..., c] = coat.albedo[..., c] * metal + under * tints[0, c] + over * tints[1, c]
    dull = np.minimum(dusty * np.float32(50.0), np.float32(1.0))
    rough = coat.roughness * metal + 0.5 * under + (gloss + (0.75 - gloss) * dull) * over
    film = dry[0] + dry[1]
    there = film / (film + np.float32(0.02))
    mpa = _ENAMEL_MPA * (_RUBBER_MPA / _ENAMEL_MPA) ** can.rubber
    rub = 0.3 + 0.4 * can.rubber + 4.0 * np.minimum(dusty, 0.05)
    soft = coat.soft_mm * (1.0 - there) + np.float32(can.rubber) * film
    return replace(
        coat,
        z_mm=coat.z_mm + film,
        albedo=albedo,
        roughness=rough,
        reflectance=0.04 + (coat.reflectance - 0.04) * metal,
        soft_mm=soft,
        hardness_mpa=1.0 / ((1.0 - there) / coat.hardness_mpa + there / mpa),
        friction=np.asarray(coat.friction + there * (rub - coat.friction), dtype=np.float32),
    )
