"""Damage to the metal itself: burr, corrosion pits, scratches. All of it is as hard as the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.strokes import across, drop, spread
from glyphs.surface.noise import ramp, share

_RUST = (0.30, 0.13, 0.05)


def add_burr(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Raise a ragged rim along the edges of the marks, up to a third of their depth high.

    ::

          __/\\          /\\__   rim: highest at the edge, zero from 0.06 heights on
              \\________/
    """
    from scipy.ndimage import distance_transform_edt

    noise = coat.noise(0.12 * coat.height_mm, rng)
    relief = np.abs(coat.clean_mm - coat.brim_mm)
    depth = float(np.quantile(relief, 0.97))
    if depth <= 0.0:
        return coat
    away = distance_transform_edt(relief < 0.35 * depth) * coat.pitch_mm
    width = 0.06 * coat.height_mm
    shape = np.maximum(0.0, 1.0 - away / width) * (away > 0.0)
    ragged = np.clip(0.5 + 0.6 * noise, 0.0, 1.6)
    rise = (0.22 * amount * depth * ragged * shape).astype(np.float32)
    shiny = ramp(rise, 0.01, 0.04)
    return replace(coat, z_mm=coat.z_mm + rise).shaded(0.6 * shiny, roughness=0.2)


def add_pits(coat: Coat, amount: float, *, rng: np.random.Generator, most_pitted: float = 0.16) -> Coat:
    """Add clusters of pits, 20 to 120 um deep, with a rusty skin; `most_pitted` of the plate at amount 1."""
    cluster = coat.noise(0.9 * coat.height_mm, rng)
    blob = coat.noise(rng.uniform(0.05, 0.09) * coat.height_mm, rng)
    ragged = coat.noise(0.1, rng)
    grain = rng.standard_normal(coat.shape, dtype=np.float32)
    deepest = rng.uniform(0.07, 0.12)
    rank = share((0.6 * cluster + 0.8 * blob + 0.12 * ragged) / np.float32(np.hypot(1.0, 0.12)))
    edge = 1.0 - most_pitted * amount
    depth = deepest * np.sqrt(np.clip((rank - edge) / (most_pitted * amount + 0.02), 0.0, 1.0))
    depth = np.where(depth > 0.0, depth + 0.02, 0.0) * (1.0 + 0.1 * ragged)
    depth = np.clip(depth, 0.0, 0.12).astype(np.float32)
    rust = ramp(rank, edge - 0.18 * amount, edge + 0.02)
    skin = np.clip(np.array(_RUST, np.float32) * (1.0 + 0.25 * grain)[..., None], 0.01, 1.0)
    dark = np.clip(1.0 - 4.0 * depth, 0.4, 1.0)[..., None]
    coat = replace(
        coat,
        z_mm=coat.z_mm - depth,
        friction=(coat.friction + 0.1 * rust).astype(np.float32),
    )
    return coat.shaded(0.85 * rust, albedo=skin * dark, roughness=0.8, reflectance=0.06)


def add_scratches(coat: Coat, amount: float, *, rng: np.random.Generator, most_a_mm2: float = 0.35) -> Coat:
    """Add narrow grooves, 5 to 40 um deep, half of them in a common direction; `most_a_mm2` of them per mm2."""
    most = max(1, round(most_a_mm2 * coat.area_mm2))
    # draw all and use the first few, so that a larger amount adds scratches to the same ones
    common = rng.uniform(0.0, np.pi)
    heading = np.where(
        rng.uniform(size=most) < 0.5, common + 0.12 * rng.standard_normal(most), rng.uniform(0.0, np.pi, most)
    )
    start = rng.uniform(0.0, 1.0, (most, 2)) * coat.shape[::-1] * np.float64(coat.pitch_mm)
    length = coat.height_mm * np.clip(rng.lognormal(-0.3, 0.8, most), 0.15, 4.0)
    bend = 0.03 * rng.standard_normal(most) / coat.height_mm
    depth = np.clip(rng.lognormal(np.log(0.011), 0.6, most), 0.005, 0.04)
    wide = np.clip(rng.lognormal(np.log(0.06), 0.35, most), 0.04, 0.15)
    bright = rng.uniform(size=most) < 0.7
    count = round(most * amount)
    cut = np.zeros(coat.shape, dtype=np.float32)
    light = np.zeros(coat.shape, dtype=np.float32)
    for k in range(count):
        step = 0.5 * coat.pitch_mm
        s = np.arange(0.0, length[k], step) - 0.5 * length[k]
        ahead = np.array([np.cos(heading[k]), np.sin(heading[k])])
        side = np.array([-ahead[1], ahead[0]])
        line = start[k] + s[:, None] * ahead + (bend[k] * s**2)[:, None] * side
        taper = np.sqrt(np.clip(1.0 - (2.0 * s / length[k]) ** 2, 0.0, 1.0))
        offset, _ = across(wide[k], coat.pitch_mm)
        profile = np.maximum(0.0, 1.0 - (offset / (0.5 * wide[k] + 0.5 * coat.pitch_mm)) ** 2)
        points = spread(line, side, offset)
        values = depth[k] * taper[:, None] * profile[None, :]
        drop(cut, points, values, pitch_mm=coat.pitch_mm)
        if bright[k]:
            drop(light, points, (taper[:, None] * profile[None, :]) ** 0.5, pitch_mm=coat.pitch_mm)
    shine = ramp(cut, 0.003, 0.02) * np.where(light > 0.0, 1.0, 0.0).astype(np.float32)
    dull = ramp(cut, 0.003, 0.02) - shine
    coat = replace(coat, z_mm=coat.z_mm - cut)
    coat = coat.shaded(0.7 * shine, albedo=(0.33, 0.32, 0.31), roughness=0.25, reflectance=0.6)
    return coat.shaded(0.6 * dull, albedo=np.float64(0.45) * coat.albedo)
