"""Wear and damage of the metal itself: no material is added, and the worn surface is as hard as the part.

    new   __  land   _rim     rubbed  . tool level, lowered    peened          rim of a dimple
            \\       /         ___/\\_____/\\_v___  scores          ___ lip          _/\\_    _
             \\_____/           \\_____/    shallower, round        ''-.____.-''\\__/    \\__/  mouth narrower

- *Rubbing* (abrasion, a file, a belt). Archard (1953): the metal removed is proportional to pressure times path. A
  stiff tool therefore lowers the highest places first and leaves those that it does not reach: the surface becomes
  the lower of itself and the tool's level. The tool comes down unevenly, as it is led by hand. The tool's level
  carries scores, which are straight or slightly bowed, in one direction or crossing, with ridges beside them: ductile
  metal is partly cut out of a score, partly ploughed aside (Zum Gahr, Microstructure and Wear of Materials, 1987).
- *Polishing*, three-body wear by loose grains: convex edges wear, hollows stay; a soft tool rounds and leaves few
  scores.
- *Peening*, by shot or a hammer: metal flows from the land over the groove, the mouth closes, and the land sinks by as
  much. Dents are spherical caps at random places: coverage 1 - exp(-k), with k their area over the part's (Kirk, "Dent
  Formation and Coverage", The Shot Peener 34/4, 2020; "Morphology of Shot Peening Indentations", ibid. 17/2, 2003). The
  metal of a dent rises around it.
- *Knocks*: dents and gouges from corners of other parts, with asymmetric pile-up.

Sizes: belts of grit P36 to P80 leave Ra 2 to 6 um (belt makers' charts), 10 to 40 um from crest to trough; teeth of
coarse files lie about 1 mm apart, and a grain or tooth that sticks out scores 0.02 to 0.2 mm deep. Blasting dents 0.1
to 0.6 mm wide, ball peens 1 to 3 mm; a dent's depth is taken as 6 to 16 % of its width. Serials are made unreadable by
grinding, filing, peening and punching (Iowa DCI laboratory, "Serial number restoration"), mostly down to about their
depth (Treptow, "Handbook of Methods for the Restoration of Obliterated Serial Numbers", NASA CR-135322, 1978): so
the metal removed is measured in depths of the mark, and tools scale with the characters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import blur
from glyphs.soiling.wear.bench import Bench, on_bench, patches, rise
from glyphs.soiling.wear.blows import knock, peen
from glyphs.surface.noise import Field

_FRESH_ALBEDO = (0.27, 0.268, 0.262)
_FRESH_REFLECTANCE = 0.62


@dataclass(frozen=True)
class _Life:
    """Shares of the kinds of wear on one part, independent of the amount: 0 to 1, about 1 for the leading kind."""

    rubbed: float
    peened: float
    knocked: float
    soft: float  # softness of the rubbing tool: 0 a file, 1 a buff or loose grains
    crossed: float  # spread of the rubbing directions: 0 one belt, 1 a hand with emery

    @staticmethod
    def draw(rng: np.random.Generator) -> _Life:
        rub, peen, knock = kinds = rng.gamma((1.0, 0.6, 0.5))
        most = max(float(kinds.max()), 1e-6)
        return _Life(
            float(0.4 + 0.6 * rub / most),
            float(max(peen, 0.6 * knock) / most),
            float(knock / most),
            float(rng.beta(0.7, 1.2)),
            float(rng.beta(0.5, 1.0)),
        )


def wear(coat: Coat, amount: float, *, rng: np.random.Generator) -> Coat:
    """Wear a part: `amount` 0 leaves it unchanged, 1 removes most of its marks. Parts have 0.5 to 1.5 times the amount
    (those below 1 catch up towards amount 1), and one kind leads."""
    factor = float(rng.uniform(0.5, 1.5))
    amount = min(1.0, amount * (factor + max(1.0 - factor, 0.0) * amount**2))
    if amount <= 0.0:
        return coat
    life, bench = _Life.draw(rng), on_bench(coat)
    knocks, peens, rubs = rng.spawn(3)
    z, bruised = knock(bench, coat.z_mm, amount * life.knocked, rng=knocks)
    z, dimpled = peen(bench, z, amount * life.peened, rng=peens)
    z, bared = _rub(bench, z, amount * life.rubbed, life, rng=rubs)
    worn = replace(
        coat,
        z_mm=z,
        soft_mm=np.maximum(coat.soft_mm - np.abs(z - coat.z_mm), np.float32(0.0)),
        friction=coat.friction
        + bared * (np.float32(0.14 + 0.1 * (1.0 - life.soft)) - coat.friction)
        + np.float32(0.03) * dimpled,
    )
    # metal that was hit is bright and matt; metal that was rubbed last is bright, and glossier after a softer tool
    matt = np.float32(0.46) + bared * np.float32(-0.12 - 0.18 * life.soft)
    return worn.shaded(
        np.maximum(np.maximum(bruised, dimpled), bared),
        albedo=_FRESH_ALBEDO,
        roughness=matt,
        reflectance=_FRESH_REFLECTANCE,
    )


def _rub(
    bench: Bench, z: Field, amount: float, life: _Life, *, rng: np.random.Generator
) -> tuple[Field, Field]:
    coat, deep = bench.coat, bench.deep_mm
    uneven = patches(coat, 2.0 * coat.height_mm, rng)
    scores = _scores(coat, life.crossed, rng)
    height = np.maximum(z - bench.level_mm, 0.0)
    peak = float(np.percentile(height[::3, ::3], 99.5))
    # the tool starts on the highest peak and comes down; a soft one follows into the hollows' mouths
    down = np.float32(amount) * (peak + deep * (0.72 + 0.45 * uneven))
    rough = np.float32(amount * (1.0 - 0.8 * life.soft) * deep)
    tool = bench.level_mm + np.float32(peak) - down - rough * scores
    give = np.float32(amount * deep * (0.02 + 0.25 * life.soft))
    cut = _smooth_min(z, tool, give)
    # loose grains wear edges: metal above its surroundings is removed, metal below stays
    width = 0.035 * coat.height_mm / coat.pitch_mm * (0.5 + life.soft)
    cut = cut - np.float32(amount * (0.4 + 0.6 * life.soft)) * np.maximum(cut - blur(cut, width), 0.0)
    return cut, rise(z - cut, 0.12 * deep)


def _smooth_min(a: Field, b: Field, width: np.float32) -> Field:
    near = np.maximum(width - np.abs(a - b), 0.0)
    return np.asarray(np.minimum(a, b) - near * near / (4.0 * np.maximum(width, 1e-9)), dtype=np.float32)


def _scores(coat: Coat, crossed: float, rng: np.random.Generator) -> Field:
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
    lines, stations = int(2.0 * half_mm / fine_mm) + 1, 32
    count = max(8, int(2.0 * half_mm / (0.08 * size_mm)))
    line = rng.uniform(0, lines, count)
    width = np.maximum(0.02 * size_mm * rng.lognormal(0.0, 0.5, count) / fine_mm, 1.0)
    deep = np.minimum(0.16 * rng.lognormal(0.0, 0.6, count), 0.7)
    ridge = rng.uniform(0.1, 0.5, (count, 2))
    start, length = rng.uniform(-0.3, 0.8, count), rng.uniform(0.2, 1.2, count)
    s = np.linspace(0.0, 1.0, stations)
    # a grain digs in, holds and comes out
    runs = np.clip(8.0 * np.minimum(s - start[:, None], start[:, None] + length[:, None] - s), 0.0, 1.0)
    table = np.repeat(np.float32(0.035) * rng.standard_normal((lines, 1), dtype=np.float32), stations, axis=1)
    for i in range(count):
        low, high = max(0, int(line[i] - 2.2 * width[i])), min(lines, int(line[i] + 2.2 * width[i]) + 2)
        t = (np.arange(low, high) - line[i]) / width[i]
        beside = np.where(t < 0.0, ridge[i, 0], ridge[i, 1])
        profile = np.maximum(1.0 - np.abs(t), 0.0) - beside * np.maximum(
            1.0 - 2.0 * np.abs(np.abs(t) - 1.4), 0.0
        )
        table[low:high] += deep[i] * profile[:, None] * runs[i]
    return table
