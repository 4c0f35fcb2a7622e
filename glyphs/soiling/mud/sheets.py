"""Splashed and dried mud, as on vehicles and field machines.

    wet       ~~~~~~~~~~~~~~~~~~~~~~~~~   slurry levels over land and grooves,
             ____      ____      ____     thicker down the plate and at its front
                 \\____/    \\____/

    dry        ,_____,   ,_____,   o      every column shrinks alike, so a groove shows through as a dip;
              (_______) (____o__) (_)     plates between cracks curl up at their edges; sand o stays hard
             ____      ____      ____
                 \\__o_/    \\_o__/         rain washes the land first, the groove keeps its mud

The mechanisms are from the literature named here; numbers without a source are estimates:

- Slurry of yield stress 2 to 20 Pa stays on an upright plate 0.1 to 1 mm thick (tau / rho g); a draining film
  thickens as the square root of the distance down (H. Jeffreys, "The draining of a vertical plate", 1930). It dries to
  half to two thirds of its wet thickness, column by column.
- A drop dries with its edge pinned, and the flow to it builds a ring (R. Deegan et al., Nature 389, 1997).
- Below some tens of micrometres a film does not crack; above, cracks are 3 to 10 thicknesses apart, and a late crack
  meets an earlier one at a right angle (A. Groisman and E. Kaplan, Europhys. Lett. 25, 1994; T. Khatun et al., arXiv
  1412.2842; P. Nandakishore and L. Goehring, Soft Matter 12, 2016). Plates shrink some 5 to 10 % sideways, and curl
  because they dry from the top (R. Style et al., J. Geophys. Res. 116, 2011).
- Dried silt and clay carry 1 MPa (moist) to 20 MPa (bone dry) under a tip; quartz does not yield. The
  friction angle of soil on steel is 22 to 35 degrees. Dry soil reflects about 0.3 of the light, moist soil half of
  that.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from glyphs.soiling.coat import STEEL_HARDNESS_MPA, Coat
from glyphs.soiling.mud.cracks import nearest_crack
from glyphs.soiling.mud.grid import Grid, blur, thin_grid
from glyphs.soiling.strokes import drop
from glyphs.surface.noise import Field, ramp, share

SAND_MM = (0.05, 0.5)
HARDNESS_MPA = (1.0, 20.0)
CRACKING_MM = (0.015, 0.05)
"""Thickness at which a film begins to crack, and at which it cracks everywhere."""
_DRY_ALBEDO = np.array([0.40, 0.325, 0.235], dtype=np.float32)
_SAND_ALBEDO = np.array([0.52, 0.47, 0.38], dtype=np.float32)


class Batch(NamedTuple):
    """The mud of one part."""

    share: float  # of the usual amount
    moisture: float  # 0 bone dry to 1 moist
    solid: float  # dry over wet thickness
    flight_rad: float  # direction in which splashes flew
    rain: float  # share of the land's mud that it washed off


def mud(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Splash mud on a surface and let it run down, dry and crack."""
    batch = Batch(
        share=rng.uniform(0.7, 1.3),
        moisture=rng.beta(1.2, 2.5),
        solid=rng.uniform(0.55, 0.68),
        flight_rad=rng.uniform(0.0, 2.0 * np.pi),
        rain=rng.uniform(0.0, 0.8),
    )
    a = min(1.0, amount * batch.share) ** 1.5
    if a <= 0.0:
        return coat
    grid = thin_grid(coat)
    level = _wet_level(coat, grid)
    first = _dry_thickness(level, grid.whole(_sheet(grid, a, rng), coat.shape), batch.solid)
    splashed = _splashes(grid, a, batch, rng) + _sheet(grid, max(a - 0.3, 0.0) / 0.85, rng)
    thick = first + _dry_thickness(level - first, grid.whole(splashed, coat.shape), batch.solid)
    thick *= _rain_share(coat, grid, a, batch, rng)
    crust = _crust(coat, grid, thick)
    gap, lift = _cracks(coat, grid, crust, rng)
    thick *= _crumbs(coat, rng)
    thick += np.minimum(thick, crust) * (0.35 * lift * (1.0 - gap) - 0.85 * gap)
    return _finish(coat, thick, _sand(coat, thick, rng), gap, lift, batch)


def _wet_level(coat: Coat, grid: Grid) -> Field:
    level = blur(grid, np.maximum(coat.z_mm, coat.brim_mm), 0.14 * coat.height_mm)
    return np.asarray(level - coat.z_mm, dtype=np.float32)


def _crust(coat: Coat, grid: Grid, thick_mm: Field) -> Field:
    near = blur(grid, thick_mm, 0.07 * coat.height_mm)
    return np.asarray(np.minimum(near, 1.5 * thick_mm), dtype=np.float32)


def _sheet(grid: Grid, a: float, rng: np.random.Generator) -> Field:
    h = grid.height_mm
    rank = share(0.9 * grid.noise(1.1 * h, 2.2 * h, rng) + 0.3 * grid.noise(0.3 * h, 0.5 * h, rng))
    uneven = grid.noise(0.45 * h, 0.8 * h, rng)
    above_mm = rng.uniform(0.0, 3.0) * h
    way = np.sqrt(above_mm + grid.pitch_mm * np.arange(grid.shape[0], dtype=np.float32))[:, None]
    inside = rank - np.float32(1.0 - 1.15 * a)  # the front lies where it is 0
    bead = 1.0 + 0.5 * np.exp(-(((inside - 0.05) / 0.035) ** 2))
    film = ramp(inside, 0.0, 0.05) * bead * (way / way.mean()) * np.exp(0.35 * uneven)
    return np.asarray(1.9 * grid.depth_mm * a * film, dtype=np.float32)


def _splashes(grid: Grid, a: float, batch: Batch, rng: np.random.Generator) -> Field:
    h, pitch = grid.height_mm, grid.pitch_mm
    count = int(np.clip(4.5 * np.prod(grid.size_mm) / h**2, 4, 250))
    centre = rng.uniform(-0.03, 1.03, (count, 2)) * grid.size_mm
    radius = np.clip(0.09 * h * np.exp(0.65 * rng.standard_normal(count)), 0.03 * h, 0.5 * h)
    late, oblique, long, thick = rng.random((4, count))
    heading = batch.flight_rad + 0.35 * rng.standard_normal(count)
    grown = np.clip((a - 0.9 * late**2) / 0.25, 0.0, 1.0)
    r, oblong = radius * grown, 1.0 + 1.2 * oblique
    tail = r * (1.5 + 3.5 * long * oblique)
    mm = np.minimum(0.22 * radius, 2.2 * grid.depth_mm) * (0.6 + 0.8 * thick) * grown
    reach = np.maximum(1.25 * oblong * r, tail)[:, None]
    low = np.maximum(np.floor((centre - reach) / pitch).astype(int), 0)
    high = np.minimum(np.ceil((centre + reach) / pitch).astype(int) + 1, grid.shape[::-1])
    ragged = 0.09 * grid.noise(0.09 * h, 0.09 * h, rng)
    wet = np.zeros(grid.shape, dtype=np.float32)
    for k in np.flatnonzero((r > 0.4 * pitch) & (high > low).all(axis=1)):
        here = np.s_[low[k, 1] : high[k, 1], low[k, 0] : high[k, 0]]
        x = ((np.arange(low[k, 0], high[k, 0]) * pitch - centre[k, 0]) / r[k]).astype(np.float32)[None, :]
        y = ((np.arange(low[k, 1], high[k, 1]) * pitch - centre[k, 1]) / r[k]).astype(np.float32)[:, None]
        c, s = float(np.cos(heading[k])), float(np.sin(heading[k]))
        p, q = c * x + s * y, c * y - s * x
        edge = 1.0 - np.sqrt((p * float(1.0 / oblong[k])) ** 2 + q * q)
        if tail[k] > 1.2 * oblong[k] * r[k]:
            flying = np.float32(0.45) - p * float(0.45 * r[k] / tail[k]) - np.abs(q)
            edge = np.where(p > 0.0, np.maximum(edge, flying), edge)
        edge += ragged[here]
        ring = 1.0 / (1.0 + ((edge - 0.16) / 0.09) ** 2)
        np.maximum(wet[here], float(mm[k]) * np.clip(edge / 0.16, 0.0, 1.0) * (0.6 + ring), out=wet[here])
    return wet


def _dry_thickness(level_mm: Field, wet_mm: Field, solid: float) -> Field:
    hollow = np.maximum(level_mm, 0.0) + np.float32(1e-6)
    fills = 2.0 * wet_mm * hollow / np.sqrt(hollow**2 + 4.0 * wet_mm**2)
    thinner = np.minimum(np.maximum(-level_mm, 0.0), 0.6 * wet_mm)
    return np.asarray(np.float32(solid) * (wet_mm + fills - thinner), dtype=np.float32)


def _rain_share(coat: Coat, grid: Grid, a: float, batch: Batch, rng: np.random.Generator) -> Field:
    streak = ramp(grid.noise(0.25 * grid.height_mm, 1.5 * grid.height_mm, rng), -0.6, 1.0)
    takes = grid.whole(np.float32(batch.rain * (1.0 - 0.7 * a)) * streak, coat.shape)
    sheltered = np.clip((coat.brim_mm - coat.z_mm) / np.float32(grid.depth_mm), 0.0, 1.0)
    return np.asarray(1.0 - takes * (1.0 - 0.9 * sheltered), dtype=np.float32)


def _crumbs(coat: Coat, rng: np.random.Generator) -> Field:
    fine = Grid(1, coat.shape, coat.pitch_mm, coat.height_mm, 0.0)
    length = max(0.2, 1.2 * coat.pitch_mm)
    return np.asarray(np.clip(1.0 + 0.08 * fine.noise(length, length, rng), 0.6, 1.4), dtype=np.float32)


def _cracks(
    coat: Coat,
    grid: Grid,
    crust_mm: Field,
    rng: np.random.Generator,
    *,
    spacing: float = 7.0,
    shrinkage: float = 0.08,
    curled: float = 0.25,
) -> tuple[Field, Field]:
    """Cracks in plates wider than `spacing` thicknesses: how open a sample is, how far its edge curls up (0 to 1)."""
    h = grid.height_mm
    rows, cols = grid.shape
    # bent, so that cracks are not straight
    bent_x, bent_y = (0.06 * h * grid.noise(0.4 * h, 0.4 * h, rng) for _ in range(2))
    ragged = 0.012 * h * grid.noise(0.09 * h, 0.09 * h, rng)
    x = np.float32(grid.pitch_mm) * np.arange(cols, dtype=np.float32)[None, :] + bent_x + ragged
    y = np.float32(grid.pitch_mm) * np.arange(rows, dtype=np.float32)[:, None] + bent_y + ragged[::-1, ::-1]
    crust = np.ascontiguousarray(crust_mm[:: grid.step, :: grid.step])
    plate = np.float32(spacing) * np.maximum(crust, np.float32(CRACKING_MM[0]))
    off = nearest_crack(x, y, plate, size_mm=grid.size_mm, finest_mm=0.15 * h, rng=rng)
    # cracks finer than the grid are widened to it and made less deep
    half, least = np.float32(0.5 * shrinkage) * plate, np.float32(0.6 * grid.pitch_mm)
    inside = grid.whole(np.maximum(half, least) - off, coat.shape)
    deep = grid.whole(ramp(crust, *CRACKING_MM) * np.minimum(half / least, 1.0), coat.shape)
    gap = np.clip(inside * np.float32(1.0 / coat.pitch_mm) + 0.5, 0.0, 1.0) * deep
    lift = np.maximum(1.0 - off / (curled * plate), 0.0)
    return np.asarray(gap, dtype=np.float32), grid.whole(lift * lift, coat.shape)


def _sand(coat: Coat, thick_mm: Field, rng: np.random.Generator) -> Field:
    pitch = coat.pitch_mm
    count = int(np.clip(3.0 * coat.area_mm2, 30, 2500))
    low, high = SAND_MM
    d = low * (high / low) ** (rng.random(count) ** 1.8)
    centres = rng.random((count, 2)) * np.array(coat.shape)[::-1] * pitch
    lies = rng.random(count)
    i, j = (np.minimum((centres[:, k] / pitch).astype(int), coat.shape[1 - k] - 1) for k in (0, 1))
    mud_mm = thick_mm[j, i]
    stays = np.clip(3.0 * mud_mm / d - 1.0, 0.0, 1.0)
    top = stays * (d + lies * np.maximum(mud_mm - d, 0.0))
    grains = np.zeros(coat.shape, dtype=np.float32)
    reach = np.ceil(0.5 * d / pitch).astype(int)  # samples; most grains are small and need few
    for width in range(1, int(reach.max()) + 1):
        some = (reach == width) & (stays > 0.0)
        step = np.arange(-width, width + 1) * pitch
        around = np.stack(np.meshgrid(step, step), axis=-1).reshape(-1, 2)
        away = np.hypot(*around.T)[None, :] / (0.5 * d[some, None])
        below = 0.5 * (stays * d)[some, None] * (1.0 - np.sqrt(np.maximum(1.0 - away**2, 0.0)))
        height = np.where(away <= 1.0, np.maximum(top[some, None] - below, 0.0), 0.0)
        drop(grains, centres[some, None, :] + around[None], height, pitch_mm=pitch)
    return grains


def _finish(
    coat: Coat, thick: Field, sand: Field, gap: Field, lift: Field, batch: Batch, *, opaque_mm: float = 0.025
) -> Coat:
    top = np.maximum(thick, sand)
    soft = top - sand
    grains = np.nonzero(sand)
    stones = tuple(axis[soft[grains] <= 0.0] for axis in grains)
    soft_mpa, hard_mpa = HARDNESS_MPA
    mpa = np.float32(hard_mpa * (soft_mpa / hard_mpa) ** batch.moisture)
    # a film thinner than the dirt below is as hard as that dirt; over a grain only the mud on it yields
    hardness = np.where(
        soft > coat.soft_mm, np.maximum(mpa * (1.0 - 0.5 * lift), soft_mpa), coat.hardness_mpa
    )
    hardness[stones] = STEEL_HARDNESS_MPA
    yields = soft + coat.soft_mm
    yields[grains] = soft[grains]
    cover = np.asarray(1.0 - np.exp(top * np.float32(-1.0 / opaque_mm)), dtype=np.float32)
    mu = np.float32(np.tan(np.radians(25.0 + 8.0 * batch.moisture)))
    earth = _DRY_ALBEDO * np.float32(1.0 - 0.5 * batch.moisture)
    tone = 0.92 + 0.12 * lift - 0.45 * gap
    albedo = np.stack([tone * colour for colour in earth], axis=-1)
    albedo[stones] = _SAND_ALBEDO
    return replace(
        coat,
        z_mm=coat.z_mm + top,
        soft_mm=yields,
        hardness_mpa=hardness,
        friction=coat.friction + cover * (mu - coat.friction),
    ).shaded(cover, albedo=albedo, roughness=0.95 - 0.25 * batch.moisture, reflectance=0.04)
