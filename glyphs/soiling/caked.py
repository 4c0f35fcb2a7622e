"""Caked grime: dust bound by oil and grease that builds up for years on machinery that is never cleaned.

It grows layer by layer. Grooves fill first, up to the brim; then the cake covers marks and land alike::

                 young, dusty, soft        curled rim   flake lost
              ____/~~~~\\___   bridge         __     |     _____
      _______/    older     \\__.----.________/  \\____|____/     \\____   top
      ------.      /--------.  | void |  .----------------------------   brim: the land
             \\////oldest///   \\//////   /    wiped: land bare, groove packed flush
              \\__________/     \\______/

- *Layers* lie in patches of different outlines, the oldest at the bottom. They form terraces with a knobbly top.
- *Bridges*: dirt that grows from both rims of a narrow groove roofs it before the bottom is full. The more void under
  a roof, the more easily it yields to a tip.
- *Flakes*: the cake shrinks as its oil hardens; angular pieces come off the smooth land, and the rims around them curl.
  Dirt in a groove stays.
- *Wipes and fingers*: a rag removes dirt above the land, in streaks, and packs it into the grooves; a finger presses
  its ridges into the soft dirt. The last layer settles over both.

All of it yields under a tip; its hardness grows with age from 0.5 MPa (stiff grease full of dust) to 30 MPa (resin).
Oily grime slides (0.15), dry dust and crust drag (0.6).

Sources. Growth, layers, "moss-like" shapes, oil drawn up by capillary forces: J. Fitch, Dust cakes: what causes them
and why you should care, Machinery Lubrication, Jan-Feb 2021. Thickness: NFPA 96 calls a duct clean at 0.05 mm of
grease and due for cleaning at 2 mm by the depth comb; a cake here is up to about two mark depths thick. Binding that
hardens from the surface inwards, crust over a soft core: J.-Y. Delenne et al., From liquid to solid bonding in cohesive
granular media, 2010 (arXiv:1002.4964). Arches over a gap up to a span that the strength sets: D. M. Walker, Chem. Eng.
Sci. 21 (1966) 975. Fingers: D. Maltoni et al., Handbook of Fingerprint Recognition, ch. 3: ridges 0.1 to 0.3 mm wide,
0.5 mm apart. Darkening by oil: S. Twomey et al., Appl. Opt. 25 (1986) 431. The hardness by age and the
shares of wiping and flaking are estimates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import coarse_noise, stretch
from glyphs.surface.noise import Field, ramp, share

LEAST_MPA, YOUNG_MPA, OLD_MPA = 0.1, 0.5, 30.0
OILY_FRICTION, DRY_FRICTION = 0.15, 0.6
_GREASE, _DUST = (0.035, 0.028, 0.022), (0.180, 0.158, 0.128)
_ONSETS = (0.0, 0.05, 0.15, 0.30)
"""Amounts at which the layers begin; the last one settles after wiping."""


@dataclass(frozen=True, eq=False)
class _Site:
    room_mm: Field
    depth_mm: float
    support: Field


@dataclass(frozen=True, eq=False)
class _Cake:
    packed_mm: Field
    void_mm: Field
    built_mm: Field

    @property
    def solid_mm(self) -> Field:
        return np.asarray(self.packed_mm + self.built_mm)


def caked(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Cover a surface with caked grime; see `SoilModel`."""
    part = min(1.0, amount * float(rng.uniform(0.7, 1.3))) ** 1.15
    if part <= 0.0:
        return coat
    site = _site(coat)
    bare: Field = np.zeros(coat.shape, dtype=np.float32)
    cake, aged = _Cake(bare, bare, bare), bare
    for index, onset in enumerate(_ONSETS):
        if index == len(_ONSETS) - 1:
            cake = _bridge(coat, cake, site, part, rng=rng)
            cake = _flake(coat, cake, part, rng=rng)
            cake = _wipe_and_press(coat, cake, site, rng=rng)
        age = np.float32(1.0 - (index + rng.uniform(0.0, 1.0)) / len(_ONSETS))
        before = cake.solid_mm
        cake = _settle_layer(coat, cake, site, part, onset, rng=rng)
        aged = aged + age * (cake.solid_mm - before)
    # where flakes or a rag removed younger layers, the oldest are left
    old = np.minimum(aged / np.maximum(cake.solid_mm, np.float32(1e-6)), np.float32(1.0))
    dry = np.asarray(1.2 * _slow_noise(coat, 0.8 * coat.height_mm, rng) - 0.4 * old + 0.15, dtype=np.float32)
    np.clip(dry, 0.0, 1.0, out=dry)
    return _finish(coat, _roughen(coat, cake, site, dry, rng=rng), old, dry)


def _slow_noise(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    step = max(1, int(length_mm / (4.0 * coat.pitch_mm)))
    return stretch(share(coarse_noise(coat, length_mm, step, rng)), step, coat.shape)


def _site(coat: Coat) -> _Site:
    from scipy.ndimage import gaussian_filter, maximum_filter

    above = coat.clean_mm - coat.brim_mm
    low, high = (float(q) for q in np.quantile(above[::4, ::4], (0.005, 0.995)))
    depth = max(-low, 0.02 * coat.height_mm)
    ceiling = coat.brim_mm
    if high > -0.5 * low:
        step = max(1, int(0.04 * coat.height_mm / coat.pitch_mm))
        depth = max(high - low, depth)
        tops = maximum_filter(coat.clean_mm[::step, ::step], size=15, mode="nearest")
        tops = gaussian_filter(tops, 4.0, mode="nearest")
        ceiling = stretch(tops, step, coat.shape)
    room = np.maximum(ceiling - coat.z_mm, 0.0).astype(np.float32)
    rims = 1.0 - np.minimum(room / np.float32(0.6 * depth), 1.0)
    step = max(1, int(0.02 * coat.height_mm / coat.pitch_mm))
    near = gaussian_filter(
        rims[::step, ::step], 0.07 * coat.height_mm / (step * coat.pitch_mm), mode="nearest"
    )
    return _Site(room, depth, stretch(near, step, coat.shape))


def _settle_layer(
    coat: Coat, cake: _Cake, site: _Site, part: float, onset: float, *, rng: np.random.Generator
) -> _Cake:
    rank = _slow_noise(coat, coat.height_mm * float(rng.uniform(0.25, 0.9)), rng)
    packs, thick = rng.uniform(0.3, 0.65), site.depth_mm * rng.uniform(0.2, 0.55)
    grown = max(0.0, (part - onset) / (1.0 - onset))
    lodged = np.float32(1.0 - 1.14 * min(1.0, 1.2 * grown))
    fill = np.float32(packs * min(1.0, 1.5 * grown)) * ramp(rank, lodged, lodged + np.float32(0.14))
    free = np.maximum(site.room_mm - cake.packed_mm - cake.void_mm, 0.0)
    packed = np.minimum(free, fill * np.float32(1.1 * site.depth_mm))
    # a scarp at the outline, a heap behind it, and a film beyond
    spread = np.float32(1.0 - 0.72 * grown)
    heap = np.maximum(rank - spread, 0.0)
    heap += np.float32(0.5) * ramp(rank, spread, spread + np.float32(0.06))
    heap *= np.float32(thick * (0.3 + 0.7 * grown))
    built = heap + np.float32(0.01 * grown) * (rank + np.float32(0.2))
    return replace(cake, packed_mm=cake.packed_mm + packed, built_mm=cake.built_mm + built)


def _bridge(coat: Coat, cake: _Cake, site: _Site, part: float, *, rng: np.random.Generator) -> _Cake:
    rank = _slow_noise(coat, 0.35 * coat.height_mm, rng)
    least = np.float32(1.25 - part)
    closed = ramp(0.5 * rank + site.support, least, least + np.float32(0.15))
    span = closed * np.maximum(0.9 * site.room_mm - cake.packed_mm, 0.0)
    return replace(cake, packed_mm=cake.packed_mm + 0.35 * span, void_mm=0.65 * span)


def _flake(coat: Coat, cake: _Cake, part: float, *, rng: np.random.Generator) -> _Cake:
    size, pitch = coat.height_mm, np.float32(coat.pitch_mm)
    count = int(np.clip(coat.area_mm2 / size**2, 2, 300))
    centres = rng.uniform(0.0, 1.0, (count, 2)) * coat.shape
    radii = 0.13 * size * rng.lognormal(0.0, 0.5, (count, 1)) * rng.uniform(0.5, 1.5, (count, 7))
    turns = np.sort(rng.uniform(0.0, 2 * np.pi, (count, 7)), axis=1)
    rim, grown = np.float32(0.05 * size), float(ramp(np.asarray(part, np.float32), 0.15, 1.0))
    beside = np.full(coat.shape, rim)
    for (row, col), angles, sides in zip(
        centres.astype(int), turns, radii.astype(np.float32) * grown, strict=True
    ):
        n = int((1.3 * sides.max() + rim) / pitch) + 1
        top, left = max(0, row - n), max(0, col - n)
        here = beside[top : row + n + 1, left : col + n + 1]
        y = (np.arange(top, top + here.shape[0], dtype=np.float32) - row)[:, None] * pitch
        x = (np.arange(left, left + here.shape[1], dtype=np.float32) - col)[None, :] * pitch
        outside = np.hypot(x, y) - np.float32(1.2 * sides.max())
        for angle, side in zip(angles, sides, strict=True):
            np.maximum(outside, float(np.cos(angle)) * x + float(np.sin(angle)) * y - side, out=outside)
        np.minimum(here, outside, out=here)
    sharp = np.float32(max(0.015 * size, coat.pitch_mm))
    lost = np.float32(min(1.0, 2.0 * grown)) * (1.0 - ramp(beside, -sharp, np.float32(0.0)))
    curl = np.float32(0.5 * grown) * (1.0 - ramp(beside, np.float32(0.0), rim)) * (beside > 0.0)
    return replace(cake, built_mm=cake.built_mm * (1.0 - 0.95 * lost) * (1.0 + curl))


def _wipe_and_press(coat: Coat, cake: _Cake, site: _Site, *, rng: np.random.Generator) -> _Cake:
    built, packed = cake.built_mm, cake.packed_mm
    for _ in range(2):
        wiped = _stroke(coat, rng)
        ready = np.minimum(built / np.float32(0.3 * site.depth_mm), 1.0)
        free = np.maximum(site.room_mm - packed - cake.void_mm, 0.0)
        packed = packed + 0.8 * wiped * ready * free
        built = built * (1.0 - 0.92 * wiped)
    built = built - np.minimum(0.35 * built, np.float32(0.06)) * _finger(coat, rng)
    return replace(cake, packed_mm=packed, built_mm=built)


def _stroke(coat: Coat, rng: np.random.Generator) -> Field:
    along, across = _turned_axes(coat, rng)
    firm = np.clip(rng.uniform(-0.4, 1.2), 0.0, 0.95)
    wide, far = rng.uniform(6.0, 16.0), rng.uniform(8.0, 30.0)
    knots = np.linspace(-0.5 * wide, 0.5 * wide, int(wide / 0.35))
    folds = rng.beta(1.6, 0.6, knots.size) * np.sin(np.linspace(0.0, np.pi, knots.size)) ** 0.3
    if firm == 0.0:
        return np.zeros(coat.shape, dtype=np.float32)
    streaks = np.interp(across, knots, firm * folds, left=0.0, right=0.0).astype(np.float32)
    inside = 1.0 - ramp(np.abs(along), np.float32(0.35 * far), np.float32(0.5 * far))
    return np.asarray(streaks * inside)


def _finger(coat: Coat, rng: np.random.Generator, *, ridge_period_mm: float = 0.5) -> Field:
    u, v = _turned_axes(coat, rng)
    firm = np.float32(np.clip(rng.uniform(-0.3, 1.2), 0.0, 1.0))
    core_u, core_v, bend, phase = (float(x) for x in rng.uniform((-2, -2, 0, 0), (2, 2, 6.28, 6.28)))
    if firm == 0.0:
        return np.zeros(coat.shape, dtype=np.float32)
    around = np.hypot(u - core_u, 0.6 * (v - core_v)) + 0.35 * np.sin(0.8 * u + 0.5 * v + bend)
    ridges = 0.5 + 0.5 * np.cos(2 * float(np.pi) / ridge_period_mm * around + phase)
    carried = min(1.0, max(0.0, ridge_period_mm / coat.pitch_mm - 3.0))
    inside = 1.0 - ramp(np.hypot(u / 8.0, v / 6.0), np.float32(0.75), np.float32(1.0))
    return np.asarray(firm * inside * (0.3 + 0.7 * carried * ridges))


def _turned_axes(coat: Coat, rng: np.random.Generator) -> tuple[Field, Field]:
    (down, right), angle = rng.uniform(0.0, 1.0, 2), rng.uniform(0.0, np.pi)
    y = ((np.arange(coat.shape[0]) - down * coat.shape[0])[:, None] * coat.pitch_mm).astype(np.float32)
    x = ((np.arange(coat.shape[1]) - right * coat.shape[1])[None, :] * coat.pitch_mm).astype(np.float32)
    cos, sin = float(np.cos(angle)), float(np.sin(angle))
    return cos * x + sin * y, cos * y - sin * x


def _roughen(coat: Coat, cake: _Cake, site: _Site, dry: Field, *, rng: np.random.Generator) -> _Cake:
    # the mean of a rank's cube is a quarter
    crumbs = np.float32(2.6) * (
        _slow_noise(coat, coat.height_mm * float(rng.uniform(0.06, 0.12)), rng) ** 3 - np.float32(0.25)
    )
    # a grain is smaller than a sample
    grains = rng.standard_normal(coat.shape, dtype=np.float32)
    depth = np.float32(site.depth_mm)
    loose = np.minimum(cake.built_mm, depth) * (np.float32(0.2) + np.float32(0.7) * dry)
    rough = np.float32(0.03) * np.minimum(cake.solid_mm, depth) * (dry + np.float32(0.2))
    built = cake.built_mm + loose * crumbs + rough * grains
    return replace(cake, built_mm=np.maximum(built, 0.0))


def _finish(coat: Coat, cake: _Cake, old: Field, dry: Field, *, hiding_mm: float = 0.012) -> Coat:
    solid = cake.solid_mm
    thickness = solid + cake.void_mm
    cover = 1.0 - np.exp(solid / np.float32(-hiding_mm))
    # a roof over the full void of a bridge is an eighth as hard as solid cake
    part_void = cake.void_mm / np.maximum(thickness, np.float32(1e-6))
    yields = (
        np.float32(np.log(YOUNG_MPA))
        + np.float32(np.log(OLD_MPA / YOUNG_MPA)) * old
        - np.float32(3.2) * part_void
    )
    under = np.log(coat.hardness_mpa)
    hardness = np.exp(under + cover * (np.maximum(yields, np.float32(np.log(LEAST_MPA))) - under))
    friction = coat.friction + cover * (OILY_FRICTION + (DRY_FRICTION - OILY_FRICTION) * dry - coat.friction)
    grease, dust = (np.asarray(colour, dtype=np.float32) for colour in (_GREASE, _DUST))
    done = coat.shaded(
        cover,
        albedo=grease + dry[..., None] * (dust - grease),
        roughness=0.35 + 0.55 * dry,
        reflectance=0.04,
    )
    return replace(
        done,
        z_mm=coat.z_mm + thickness,
        soft_mm=coat.soft_mm + thickness,
        hardness_mpa=hardness.astype(np.float32),
        friction=friction.astype(np.float32),
    )
