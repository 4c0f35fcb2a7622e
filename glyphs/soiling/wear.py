"""Wear and damage of the metal itself: nothing is laid on, all of it stays as hard as the part.

    new   __  land   _rim     rubbed  . tool level, lowered    peened          rim of a dimple
            \\       /         ___/\\_____/\\_v___  scores          ___ lip          _/\\_    _
             \\_____/           \\_____/    shallower, round        ''-.____.-''\\__/    \\__/  mouth narrower

- *Rubbing* (abrasion, a file, a belt). Archard (1953): metal goes as pressure times path, so a stiff tool lowers the
  highest first and nothing that it does not reach: the surface becomes the lower of itself and the tool's level. It
  comes down unevenly, as hands do. The tool's level carries scores, which are straight or slightly bowed, in one
  direction or crossing, with ridges beside them: ductile metal is partly cut out of a score, partly ploughed aside
  (Zum Gahr, Microstructure and Wear of Materials, 1987).
- *Polishing*, three-body wear by loose grains: convex edges go, hollows stay; a soft tool rounds and leaves few scores.
- *Peening*, by shot or a hammer: metal flows from the land over the groove, the mouth closes, the land sinks by as
  much. Dents are caps of a sphere, at random: coverage 1 - exp(-k) with k their area over the part's (Kirk, "Dent
  Formation and Coverage", The Shot Peener 34/4, 2020; "Morphology of Shot Peening Indentations", ibid. 17/2, 2003). The
  metal of a dent rises around it.
- *Knocks*: dents and gouges from corners of other parts, with lopsided pile-up.

Sizes: belts of grit P36 to P80 leave Ra 2 to 6 um (belt makers' charts), 10 to 40 um from crest to trough; teeth of
coarse files lie about 1 mm apart, and a grain or tooth that sticks out scores 0.02 to 0.2 mm deep. Blasting dents 0.1
to 0.6 mm wide, ball peens 1 to 3 mm; a dent's depth is taken as 6 to 16 % of its width. Serials are made unreadable by
grinding, filing, peening and punching (Iowa DCI laboratory, "Serial number restoration"), mostly to just about their
depth (Treptow, "Handbook of Methods for the Restoration of Obliterated Serial Numbers", NASA CR-135322, 1978): so
what is taken off is measured in depths of the mark, and tools grow with the characters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field, ramp, share, smooth_noise

_FRESH_ALBEDO = (0.27, 0.268, 0.262)
_FRESH_REFLECTANCE = 0.62
_DENT_ASPECT = 0.16
"""Depth of a shot's dent over its width, at most."""
_MOST_HITS = 1.4
"""Area of all dents over the part's at most: they cover 1 - exp(-1.4), three quarters of it."""


@dataclass(frozen=True)
class _Life:
    """What happened to one part, before how much: 0 to 1 each, the leading one 1.

    Attributes:
        rubbed: by file, belt or sliding; every worn part is, at least a little.
        peened: by shot or hammer; knocks close edges too.
        knocked: by other parts.
        soft: of the rubbing tool: 0 a file, 1 a buff or loose grains.
        crossed: how far rubbing directions differ: 0 one belt, 1 a hand with emery.
    """

    rubbed: float
    peened: float
    knocked: float
    soft: float
    crossed: float

    @staticmethod
    def drawn(rng: np.random.Generator) -> _Life:
        """One part's: mostly one kind, with some of the others."""
        rubbed, peened, knocked = kinds = rng.gamma((1.0, 0.6, 0.5))
        most = max(float(kinds.max()), 1e-6)
        return _Life(
            float(0.4 + 0.6 * rubbed / most),
            float(max(peened, 0.6 * knocked) / most),
            float(knocked / most),
            float(rng.beta(0.7, 1.2)),
            float(rng.beta(0.5, 1.0)),
        )


@dataclass(frozen=True, eq=False)
class _Bench:
    """A surface under the tools.

    Attributes:
        coat: as it came.
        level_mm: (rows, cols) where a stiff tool that spans the strokes lies on the surface.
        deep_mm: how deep the marks lie below it (raised ones: how high they stand).
    """

    coat: Coat
    level_mm: Field
    deep_mm: float

    def low(self, z_mm: Field) -> Field:
        """0 on what a tool touches, 1 in the hollows."""
        return _rise(self.level_mm - z_mm - np.float32(0.25 * self.deep_mm), 0.5 * self.deep_mm)


def wear(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Wear a part: `amount` 0 leaves it, 1 takes most of its marks.

    Parts differ: each has 0.5 to 1.5 of the amount, those with less catch up towards 1, and one kind of damage leads.
    """
    own = float(rng.uniform(0.5, 1.5))
    amount = min(1.0, amount * (own + max(1.0 - own, 0.0) * amount**2))
    if amount <= 0.0:
        return coat
    life, bench = _Life.drawn(rng), _bench(coat)
    knocks, peens, rubs = rng.spawn(3)
    z, bruised = _knocked(bench, coat.z_mm, amount * life.knocked, rng=knocks)
    z, dimpled = _peened(bench, z, amount * life.peened, rng=peens)
    z, bared = _rubbed(bench, z, amount * life.rubbed, life, rng=rubs)
    worn = replace(
        coat,
        z_mm=z,
        soft_mm=np.maximum(coat.soft_mm - np.abs(z - coat.z_mm), np.float32(0.0)),
        friction=coat.friction
        + bared * (np.float32(0.14 + 0.1 * (1.0 - life.soft)) - coat.friction)
        + np.float32(0.03) * dimpled,
    )
    # what was hit is bright and matt, what was rubbed last is bright and as glossy as the tool was soft
    matt = np.float32(0.46) + bared * np.float32(-0.12 - 0.18 * life.soft)
    return worn.shaded(
        np.maximum(np.maximum(bruised, dimpled), bared),
        albedo=_FRESH_ALBEDO,
        roughness=matt,
        reflectance=_FRESH_REFLECTANCE,
    )


def _bench(coat: Coat) -> _Bench:
    """Lay a stiff tool on the surface: on the land where the marks are sunk, on the marks where they are raised."""
    from glyphs.opencv import cv2

    rows, cols = coat.shape
    step = max(1, int(0.03 * coat.height_mm / coat.pitch_mm))
    cell = coat.height_mm / (coat.pitch_mm * step)
    thin = cv2.resize(coat.z_mm, (-(-cols // step), -(-rows // step)), interpolation=cv2.INTER_AREA)
    stroke, line, held = (np.ones((2 * round(r * cell) + 1,) * 2, dtype=np.uint8) for r in (0.25, 0.7, 1.0))
    # closing spans sunk strokes, opening then takes raised lines away; both leave tilt and bow of the plate alone
    top = cv2.morphologyEx(thin, cv2.MORPH_CLOSE, stroke)
    land = cv2.morphologyEx(top, cv2.MORPH_OPEN, line)
    stands = cv2.GaussianBlur(
        cv2.dilate(top - land, held), (0, 0), 0.2 * cell, borderType=cv2.BORDER_REPLICATE
    )
    smooth = cv2.GaussianBlur(land, (0, 0), 0.08 * cell, borderType=cv2.BORDER_REPLICATE) + stands
    level = cv2.resize(smooth, (cols, rows), interpolation=cv2.INTER_LINEAR)
    deep = float(np.percentile((level - coat.z_mm)[::3, ::3], 98.0))
    return _Bench(coat, np.asarray(level, dtype=np.float32), max(deep, 0.01 * coat.height_mm))


def _rubbed(
    bench: _Bench, z: Field, amount: float, life: _Life, *, rng: np.random.Generator
) -> tuple[Field, Field]:
    """Lower what the tool reaches, scored; the surface, and how far (0 to 1) its metal is fresh."""
    from glyphs.opencv import cv2

    coat, deep = bench.coat, bench.deep_mm
    uneven = _patches(coat, 2.0 * coat.height_mm, rng)
    scores = _scores(coat, life.crossed, rng)
    height = np.maximum(z - bench.level_mm, 0.0)
    peak = float(np.percentile(height[::3, ::3], 99.5))
    # the tool starts on the highest peak and comes down; a soft one follows into the hollows' mouths
    down = np.float32(amount) * (peak + deep * (0.72 + 0.45 * uneven))
    rough = np.float32(amount * (1.0 - 0.8 * life.soft) * deep)
    tool = bench.level_mm + np.float32(peak) - down - rough * scores
    give = np.float32(amount * deep * (0.02 + 0.25 * life.soft))
    cut = _smooth_min(z, tool, give)
    # loose grains turn against edges: what stands above its surroundings goes, what lies below stays
    width = 0.035 * coat.height_mm / coat.pitch_mm * (0.5 + life.soft)
    around = cv2.GaussianBlur(cut, (0, 0), width, borderType=cv2.BORDER_REPLICATE)
    cut = cut - np.float32(amount * (0.4 + 0.6 * life.soft)) * np.maximum(cut - around, 0.0)
    return cut, _rise(z - cut, 0.12 * deep)


def _smooth_min(a: Field, b: Field, width: np.float32) -> Field:
    """The lower of two surfaces, rounded where they cross within `width`."""
    near = np.maximum(width - np.abs(a - b), 0.0)
    return np.asarray(np.minimum(a, b) - near * near / (4.0 * np.maximum(width, 1e-9)), dtype=np.float32)


def _scores(coat: Coat, crossed: float, rng: np.random.Generator) -> Field:
    """Scores of two strokes of a tool, in depths of the mark; ridges are negative."""
    from glyphs.opencv import cv2

    rows, cols = coat.shape
    pitch, size = coat.pitch_mm, coat.height_mm
    y, x = (np.float32(pitch) * (k - 0.5 * k.size).astype(np.float32) for k in np.ogrid[:rows, :cols])
    half = 0.55 * pitch * float(np.hypot(rows, cols))
    lead = rng.uniform(0.0, np.pi)
    total = np.zeros(coat.shape, dtype=np.float32)
    for _ in range(2):
        angle = lead + (0.05 + 0.9 * crossed) * rng.standard_normal()
        bow = rng.normal(0.0, 0.004) / size
        fine = 0.5 * max(pitch, 0.006 * size)
        stroke = _stroke(half, fine, size, rng)
        cos, sin = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        along = cos * x + sin * y
        side = cos * y - sin * x + np.float32(bow) * along * along
        column = (along + np.float32(half)) * np.float32((stroke.shape[1] - 1) / (2.0 * half))
        line = (side + np.float32(half)) / np.float32(fine)
        laid = cv2.remap(stroke, column, line, cv2.INTER_LINEAR, borderValue=0.0)
        np.copyto(total, laid, where=np.abs(laid) > np.abs(total))
    return total


def _stroke(half_mm: float, fine_mm: float, size_mm: float, rng: np.random.Generator) -> Field:
    """(across, along) table of one stroke's scores, each V-shaped with ridges, from one place to another."""
    lines, stations = int(2.0 * half_mm / fine_mm) + 1, 32
    count = max(8, int(2.0 * half_mm / (0.08 * size_mm)))
    at = rng.uniform(0, lines, count)
    width = np.maximum(0.02 * size_mm * rng.lognormal(0.0, 0.5, count) / fine_mm, 1.0)
    deep = np.minimum(0.16 * rng.lognormal(0.0, 0.6, count), 0.7)
    ridge = rng.uniform(0.1, 0.5, (count, 2))
    start, length = rng.uniform(-0.3, 0.8, count), rng.uniform(0.2, 1.2, count)
    s = np.linspace(0.0, 1.0, stations)
    # a grain digs in, holds and comes out
    runs = np.clip(8.0 * np.minimum(s - start[:, None], start[:, None] + length[:, None] - s), 0.0, 1.0)
    table = np.repeat(np.float32(0.035) * rng.standard_normal((lines, 1), dtype=np.float32), stations, axis=1)
    for i in range(count):
        low, high = max(0, int(at[i] - 2.2 * width[i])), min(lines, int(at[i] + 2.2 * width[i]) + 2)
        t = (np.arange(low, high) - at[i]) / width[i]
        beside = np.where(t < 0.0, ridge[i, 0], ridge[i, 1])
        profile = np.maximum(1.0 - np.abs(t), 0.0) - beside * np.maximum(
            1.0 - 2.0 * np.abs(np.abs(t) - 1.4), 0.0
        )
        table[low:high] += deep[i] * profile[:, None] * runs[i]
    return table


def _peened(bench: _Bench, z: Field, amount: float, *, rng: np.random.Generator) -> tuple[Field, Field]:
    """Close grooves from their edges and dimple all; the surface, and where (0 to 1) it was hit."""
    from glyphs.opencv import cv2

    coat, deep, size = bench.coat, bench.deep_mm, bench.coat.height_mm
    hit = 0.45 + 0.75 * _patches(coat, 1.5 * size, rng)
    edge = (z < bench.level_mm - np.float32(0.15 * deep)).astype(np.uint8)
    away = cv2.distanceTransform(edge, cv2.DIST_L2, cv2.DIST_MASK_5) * np.float32(coat.pitch_mm)
    reach = np.maximum(np.float32(0.2 * size * amount) * hit, 1e-6)
    lip = bench.level_mm - np.float32(deep) * (0.12 + 0.88 * np.square(np.minimum(away / reach, 1.0)))
    gain = np.where((edge > 0) & (away < reach), np.maximum(lip - z, 0.0), 0.0).astype(np.float32)
    z = _drawn_from(z, gain, 0.35 * size / coat.pitch_mm)
    dents = _dimples(coat, amount, rng) * (np.float32(1.0) - np.float32(0.6) * bench.low(z))
    blown = cv2.GaussianBlur(dents, (0, 0), 0.06 * size / coat.pitch_mm, borderType=cv2.BORDER_REFLECT)
    return z - dents + blown, _rise(dents, 0.004 * size)


def _drawn_from(z: Field, gain: Field, width: float) -> Field:
    """The surface with `gain` on it, sunk by as much where it stands out from what lies within `width` samples."""
    from glyphs.opencv import cv2

    rows, cols = z.shape
    step = max(1, int(width / 5.0))

    def thinned(values: Field) -> Field:
        return np.asarray(
            cv2.resize(values, (-(-cols // step), -(-rows // step)), interpolation=cv2.INTER_AREA)
        )

    def blurred(values: Field) -> Field:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), width / step, borderType=cv2.BORDER_REFLECT))

    stands = thinned(z + gain)
    # on the thinned grid, so that the land's edge and the lip on it go down together
    proud = np.maximum(stands - blurred(stands), 0.0)
    least = np.float32(0.02 * float(proud.max()) + 1e-9)
    sunk = np.asarray(proud * blurred(thinned(gain)) / np.maximum(blurred(proud), least), dtype=np.float32)
    return np.asarray(z + gain - cv2.resize(sunk, (cols, rows), interpolation=cv2.INTER_LINEAR))


def _dimples(coat: Coat, amount: float, rng: np.random.Generator) -> Field:
    """Dents of shot so far, mm deep: caps at random, of all that hit one place the deepest."""
    rows, cols = coat.shape
    typical = rng.uniform(0.05, 0.14) * coat.height_mm / coat.pitch_mm
    count = int(_MOST_HITS * rows * cols / (0.25 * np.pi * typical**2))
    half = np.maximum(0.5 * typical * rng.lognormal(-0.04, 0.28, count), 0.8)
    at = np.rint(rng.random((count, 2)) * (rows - 1, cols - 1)).astype(np.intp)
    grown = np.clip((amount - rng.uniform(0.0, 0.9, count)) / 0.1, 0.0, 1.0)
    tops = (grown * rng.uniform(0.4, 1.0, count) * _DENT_ASPECT * 2.0 * half * coat.pitch_mm).astype(
        np.float32
    )
    reach = np.ceil(half).astype(np.intp)
    edge = int(reach.max())
    wide = cols + 2 * edge
    dents = np.zeros((rows + 2 * edge) * wide, dtype=np.float32)
    for r in np.unique(reach):
        these = (reach == r) & (grown > 0.0)
        v, u = (k.ravel() for k in np.mgrid[-r : r + 1, -r : r + 1])
        v, u = v[v * v + u * u <= r * r], u[v * v + u * u <= r * r]
        centre = (at[these, 0] + edge) * wide + at[these, 1] + edge
        steep = tops[these] / half[these].astype(np.float32) ** 2
        caps = tops[these, None] - steep[:, None] * (v * v + u * u).astype(np.float32)
        np.maximum.at(dents, (centre[:, None] + (v * wide + u)).ravel(), caps.ravel())
    return np.ascontiguousarray(dents.reshape(-1, wide)[edge : edge + rows, edge : edge + cols])


def _knocked(bench: _Bench, z: Field, amount: float, *, rng: np.random.Generator) -> tuple[Field, Field]:
    """Dents and gouges by other parts' corners; the surface, and where (0 to 1) it was hit.

    A corner spans the grooves and the land between raised marks: it presses what stands higher than it reaches.
    """
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
    return struck, _rise(z - struck, 0.15 * deep)


def _rise(values_mm: Field, full_mm: float) -> Field:
    """0 up to 0, 1 from `full_mm` on; the numbers stay single."""
    return ramp(values_mm, np.zeros((), np.float32), np.asarray(full_mm, np.float32))


def _patches(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Broad patches, 0 to 1 evenly, drawn on a thinned grid."""
    from glyphs.opencv import cv2

    rows, cols = coat.shape
    step = max(1, int(length_mm / (8.0 * coat.pitch_mm)))
    thin = share(
        smooth_noise(
            (-(-rows // step), -(-cols // step)), pitch_mm=step * coat.pitch_mm, length_mm=length_mm, rng=rng
        )
    )
    return np.asarray(cv2.resize(thin, (cols, rows), interpolation=cv2.INTER_LINEAR), dtype=np.float32)
