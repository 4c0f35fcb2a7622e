"""Blows, which move metal but remove none: peened edges, dimples of shot, knocks. For the sizes see `rubbing`."""

from __future__ import annotations

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import blur, resize
from glyphs.soiling.wear.bench import Bench, patches, rise
from glyphs.surface.noise import Field

MOST_HITS = 1.4
"""Area of the most dents over the part's area; they then cover 1 - exp(-1.4), three quarters of the part."""


def peen(bench: Bench, z: Field, amount: float, *, rng: np.random.Generator) -> tuple[Field, Field]:
    """Close grooves from their edges and dimple the surface; return the surface and where it was hit (0 to 1)."""
    from glyphs.opencv import cv2

    coat, deep, size = bench.coat, bench.deep_mm, bench.coat.height_mm
    hit = 0.45 + 0.75 * patches(coat, 1.5 * size, rng)
    edge = (z < bench.level_mm - np.float32(0.15 * deep)).astype(np.uint8)
    away = cv2.distanceTransform(edge, cv2.DIST_L2, cv2.DIST_MASK_5) * np.float32(coat.pitch_mm)
    reach = np.maximum(np.float32(0.2 * size * amount) * hit, 1e-6)
    lip = bench.level_mm - np.float32(deep) * (0.12 + 0.88 * np.square(np.minimum(away / reach, 1.0)))
    gain = np.where((edge > 0) & (away < reach), np.maximum(lip - z, 0.0), 0.0).astype(np.float32)
    z = _draw_metal_from(z, gain, 0.35 * size / coat.pitch_mm)
    dents = dimples(coat, amount, rng) * (np.float32(1.0) - np.float32(0.6) * bench.low(z))
    blown = blur(dents, 0.06 * size / coat.pitch_mm, mirror=True)
    return z - dents + blown, rise(dents, 0.004 * size)


def _draw_metal_from(z: Field, gain: Field, width: float) -> Field:
    rows, cols = z.shape
    step = max(1, int(width / 5.0))

    def thin(values: Field) -> Field:
        return resize(values, (-(-rows // step), -(-cols // step)), how="area")

    def smooth(values: Field) -> Field:
        return blur(values, width / step, mirror=True)

    stands = thin(z + gain)
    # computed on the coarse grid, so that the edge of the land and its lip sink together
    proud = np.maximum(stands - smooth(stands), 0.0)
    least = np.float32(0.02 * float(proud.max()) + 1e-9)
    sunk = np.asarray(proud * smooth(thin(gain)) / np.maximum(smooth(proud), least), dtype=np.float32)
    return z + gain - resize(sunk, z.shape)


def dimples(coat: Coat, amount: float, rng: np.random.Generator, *, aspect: float = 0.16) -> Field:
    """Depth of the dents of shot, mm: spherical caps at random places, `aspect` deep for their width."""
    rows, cols = coat.shape
    typical = rng.uniform(0.05, 0.14) * coat.height_mm / coat.pitch_mm
    count = int(MOST_HITS * rows * cols / (0.25 * np.pi * typical**2))
    half = np.maximum(0.5 * typical * rng.lognormal(-0.04, 0.28, count), 0.8)
    place = np.rint(rng.random((count, 2)) * (rows - 1, cols - 1)).astype(np.intp)
    grown = np.clip((amount - rng.uniform(0.0, 0.9, count)) / 0.1, 0.0, 1.0)
    tops = (grown * rng.uniform(0.4, 1.0, count) * aspect * 2.0 * half * coat.pitch_mm).astype(np.float32)
    reach = np.ceil(half).astype(np.intp)
    edge = int(reach.max())
    wide = cols + 2 * edge
    dents = np.zeros((rows + 2 * edge) * wide, dtype=np.float32)
    for r in np.unique(reach):
        these = (reach == r) & (grown > 0.0)
        v, u = (k.ravel() for k in np.mgrid[-r : r + 1, -r : r + 1])
        v, u = v[v * v + u * u <= r * r], u[v * v + u * u <= r * r]
        centre = (place[these, 0] + edge) * wide + place[these, 1] + edge
        steep = tops[these] / half[these].astype(np.float32) ** 2
        caps = tops[these, None] - steep[:, None] * (v * v + u * u).astype(np.float32)
        np.maximum.at(dents, (centre[:, None] + (v * wide + u)).ravel(), caps.ravel())
    return np.ascontiguousarray(dents.reshape(-1, wide)[edge : edge + rows, edge : edge + cols])


def knock(bench: Bench, z: Field, amount: float, *, rng: np.random.Generator) -> tuple[Field, Field]:
    """Dent and gouge the surface with corners of other parts; return it and where it was hit (0 to 1)."""
    coat, deep, size = bench.coat, bench.deep_mm, bench.coat.height_mm
    rows, cols = coat.shape
    count = max(5, int(4.0 * coat.area_mm2 / size**2))
    centre = rng.random((count, 2)) * (cols, rows)
    when, angle = rng.uniform(0.0, 0.85, count), rng.uniform(0.0, np.pi, count)
    wide = size * np.minimum(rng.lognormal(np.log(0.17), 0.45, count), 0.45)
    gouge = np.minimum(wide * rng.uniform(3.0, 7.0, count), 1.3 * size)
    long = np.where(rng.random(count) < 0.6, wide * rng.uniform(1.0, 2.5, count), gouge)
    depth, lean = deep * np.minimum(rng.lognormal(0.1, 0.5, count), 2.5), rng.uniform(-0.8, 0.8, count)
    pile = rng.uniform(0.15, 0.4, count)
    grown = np.clip((amount - when) / 0.15, 0.0, 1.0)
    # a corner bridges grooves, and the land between raised marks: it presses down only metal above its own surface
    ground = np.maximum(bench.level_mm, z)
    pressed, piled = np.zeros((2, rows, cols), dtype=np.float32)
    for i in np.flatnonzero(grown > 0.0):
        turn = np.array([[np.cos(angle[i]), np.sin(angle[i])], [-np.sin(angle[i]), np.cos(angle[i])]])
        turn *= 2.0 / np.array([[long[i]], [wide[i]]])
        half = 1.5 * np.abs(np.linalg.inv(turn)).max(axis=1) / coat.pitch_mm + 1.0
        (left, top), (right, foot) = (
            np.clip(centre[i] + k * half, 0, (cols, rows)).astype(int) for k in (-1, 1)
        )
        box = (slice(top, foot), slice(left, right))
        y, x = (
            ((k - centre[i, 1 - n]) * coat.pitch_mm).astype(np.float32) for n, k in enumerate(np.ogrid[box])
        )
        (px, py), (qx, qy) = turn.astype(np.float32)
        p = px * x + py * y
        # wider and deeper at one end
        fuller = np.clip(1.0 + np.float32(lean[i]) * p, 0.3, 1.8)
        q = (qx * x + qy * y) / fuller
        inside = 1.0 - np.sqrt(p * p + q * q)
        dent = np.float32(grown[i] * depth[i]) * fuller * np.maximum(inside, 0.0)
        bites = np.maximum(dent + z[box] - ground[box], 0.0).sum() / max(float(dent.sum()), 1e-9)
        rim = np.maximum(1.0 - np.abs(inside + 0.15) / 0.35, 0.0) * (1.0 + np.float32(lean[i]) * np.sign(q))
        np.maximum(pressed[box], dent, out=pressed[box])
        np.maximum(piled[box], np.float32(grown[i] * depth[i] * pile[i] * bites) * rim, out=piled[box])
    struck = np.where(pressed > 0.0, np.minimum(z, ground - pressed), z + piled).astype(np.float32)
    return struck, rise(z - struck, 0.15 * deep)
