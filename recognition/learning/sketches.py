r"""Strips without physics: marks, dirt and light sketched on one strip, far more varied than the simulated parts.

    text --outlines--> mask --profile of the tool--> heights --plate, dirt, wear--> surface --tip--> felt
                                                                                   \--light, lens--> photograph

A hundred times as cheap as a simulated scan. What is sketched here shares no code with the generator of parts, its
soils or its camera, so a network that learns from both does not learn the habits of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.opencv import cv2
from recognition.learning.dots import dotted_font, middle_dots
from recognition.learning.training_parts import draw_text
from recognition.learning.training_strips import TALL_ROWS, WIDE_MARGIN, Places, TrainingStrip
from recognition.views.text_line import HEIGHT_ROWS
from recognition.views.view import EDGES, GREY, HEIGHTS, KNOWN, LAYERS

Field = NDArray[np.float32]

_FINE = 2
"""Pixels of the sketch to one of the strip."""
_H = HEIGHT_ROWS * _FINE
"""Pixels to a character's height."""
_PRELOAD = 0.2
"""Preload of the default touch, character heights: lift by it doubles the moment."""


@dataclass(frozen=True, eq=False)
class _Sketch:
    """A surface in character heights, what it is made of, and what stands on it."""

    text: str
    places: Places
    surface: Field
    ink: Field
    soil: Field
    severity: float
    font: str


def sketch_strips(fonts: Sequence[Path], rng: np.random.Generator) -> list[TrainingStrip]:
    """A line as felt or measured, and as photographed under two lights.

    Args:
        fonts: files to choose from, beside the built-in ones.
        rng: the only source of randomness.

    Raises:
        MarksError: the font cannot draw what was drawn for it; draw again.
    """
    made = _sketch(fonts, rng)
    felt = rng.random() < 0.75
    layers = [("felt" if felt else "heights", _touch(made, rng) if felt else _measure(made))]
    layers += [("photo", _photograph(made, rng)) for _ in range(2)]
    return [
        TrainingStrip(
            layers=each.astype(np.float16),
            text=made.text,
            source=source,
            font=made.font,
            soils="sketched",
            severity=made.severity,
            directions=4 if source == "felt" else 0,
            places=made.places,
        )
        for source, each in layers
    ]


@dataclass(frozen=True, eq=False)
class SketchedPart:
    """A sketch to be read as a whole part.

    Attributes:
        text: what stands on it.
        surface: (rows, cols) heights, character heights.
        picture: (rows, cols) uint8, the same under a light.
        rows_per_height: rows to a character's height.
        severity: of the dirt, 0 to 1.
        font: its file's name.
    """

    text: str
    surface: Field
    picture: NDArray[np.uint8]
    rows_per_height: int
    severity: float
    font: str


def sketch_part(fonts: Sequence[Path], rng: np.random.Generator, *, text: str) -> SketchedPart:
    """A line with some land about it, and its photograph.

    Args:
        fonts: files to choose from, beside the built-in ones.
        rng: the only source of randomness.
        text: what is to stand there.

    Raises:
        MarksError: the font cannot draw it.
    """
    made = _sketch(fonts, rng, text=text)
    grey = np.repeat(np.repeat(_photograph(made, rng)[GREY], _FINE, axis=0), _FINE, axis=1)
    return SketchedPart(
        text,
        np.pad(made.surface, ((_H // 2, _H // 2), (0, 0)), mode="edge"),
        np.asarray(np.clip(255.0 * grey, 0.0, 255.0), dtype=np.uint8),
        _H,
        made.severity,
        made.font,
    )


def _noise(shape: tuple[int, int], cell: tuple[float, float], rng: np.random.Generator) -> Field:
    """Smooth noise of spread 1, a value every so many rows and columns."""
    small = [max(2, round(n / c)) for n, c in zip(shape, cell, strict=True)]
    field = rng.standard_normal(small).astype(np.float32)
    return np.asarray(cv2.resize(field, shape[::-1], interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def _rough(shape: tuple[int, int], coarsest: float, rng: np.random.Generator, *, octaves: int = 4) -> Field:
    """Noise of several sizes, from so many pixels downwards."""
    fall = float(rng.uniform(0.35, 0.75))
    layers = [fall**k * _noise(shape, (max(1.0, coarsest / 2**k),) * 2, rng) for k in range(octaves)]
    total = np.sum(layers, axis=0, dtype=np.float32)
    return np.asarray(total / (total.std() + 1e-6), dtype=np.float32)


def _blur(field: Field, sigma: float) -> Field:
    return np.asarray(cv2.GaussianBlur(field, (0, 0), sigma), dtype=np.float32) if sigma > 0.2 else field


def _sketch(fonts: Sequence[Path], rng: np.random.Generator, *, text: str = "") -> _Sketch:
    name = str(rng.choice(BUILTIN_FONTS)) if rng.random() < 0.2 else str(fonts[int(rng.integers(len(fonts)))])
    font = load_font(name)
    if not text:
        text = "".join(map(str, rng.integers(0, 10, 6))) if rng.random() < 0.12 else draw_text(font, rng)
    matrix = rng.random() < 0.1
    if matrix:
        font = dotted_font(font, text, rng=rng)
    mask, depth_of, places = _mask(text, font, rng)
    shape = mask.shape
    depth = float(np.exp(rng.uniform(np.log(0.02), np.log(0.13))))
    raised = rng.random() < 0.25
    marks = _profile(mask, rng, dotted=matrix) * depth_of
    ink = np.clip(marks * 1.5, 0.0, 1.0)
    flat = rng.random() < 0.08  # a laser's or a printer's: no relief worth the name
    severity = 0.0 if rng.random() < 0.2 else float(rng.uniform(0.1, 1.0))
    marks *= np.clip(1.0 - 0.7 * severity * np.maximum(_rough(shape, 1.2 * _H, rng), 0.0), 0.0, 1.0)
    surface = (marks if raised else -marks) * (0.05 if flat else 1.0) * depth
    if not raised and rng.random() < 0.5:  # what the tool pushed up beside the mark
        rim = _blur(mask, 0.07 * _H) * (1.0 - mask) * _blur(_noise(shape, (_H, _H), rng), 2.0)
        surface += depth * float(rng.uniform(0.0, 0.5)) * rim
    surface += _plate(shape, depth, rng)
    soil = np.zeros(shape, dtype=np.float32)
    if severity:
        soil = _soil(shape, mask, depth, severity, rng)
        surface = surface + soil
    return _Sketch(text, places, np.asarray(surface, dtype=np.float32), ink, soil, severity, Path(name).name)


def _mask(text: str, font: Font, rng: np.random.Generator) -> tuple[Field, Field, Places]:
    """Draw a line: ink from 0 to 1, the depth of each character, and the columns where each begins and ends."""
    gap = float(rng.choice([0.0, rng.uniform(-0.03, 0.25)]))
    stretch = float(np.exp(rng.normal(0.0, 0.12)))
    slant = float(rng.normal(0.0, 0.08))
    loose = float(rng.choice([0.0, 0.03, 0.06]))
    glyphs = [font.glyph(char) for char in text]
    margin = WIDE_MARGIN * _H
    starts = margin + np.cumsum([0.0, *((g.advance + gap) * stretch * _H for g in glyphs)])
    shape = (TALL_ROWS * _FINE, int(starts[-1] - gap * stretch * _H + margin) // (2 * _FINE) * 2 * _FINE)
    mask, depth_of = np.zeros(shape, dtype=np.uint8), np.ones(shape, dtype=np.float32)
    foot = shape[0] / 2 + _H / 2
    stroke = float(rng.uniform(0.07, 0.2))
    places = []
    for glyph, start in zip(glyphs, starts[:-1], strict=True):
        turn = float(rng.normal(0.0, 0.7 * loose))
        size = _H * (1.0 + float(rng.normal(0.0, 0.4 * loose)))
        shift = rng.normal(0.0, loose * _H, 2) * (1.0, 0.7)
        middle = np.array([glyph.advance / 2, 0.5])
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

        def placed(points: NDArray[np.float64]) -> NDArray[np.int32]:
            at = (points - middle) @ turned.T + middle  # noqa: B023
            x = start + (at[:, 0] + slant * at[:, 1]) * stretch * size + shift[0]  # noqa: B023
            y = foot - at[:, 1] * size + shift[1]  # noqa: B023
            return np.asarray(np.round(16 * np.stack([x, y], axis=1)), dtype=np.int32)

        if glyph.contours:
            cv2.fillPoly(mask, [placed(c) for c in glyph.contours], 255, lineType=cv2.LINE_AA, shift=4)
        for line in glyph.strokes:
            wide = max(1, round((font.stroke_ratio if len(line) == 1 else stroke) * _H))
            at = placed(line if len(line) > 1 else np.repeat(line, 2, axis=0))
            cv2.polylines(mask, [at], False, 255, wide, cv2.LINE_AA, 4)
        points = [placed(c)[:, 0] / 16 for c in glyph.contours + glyph.strokes]
        first, last = (
            (min(p.min() for p in points), max(p.max() for p in points))
            if points
            else (start, start + glyph.advance * stretch * _H)
        )
        places.append((float(first) / _FINE, float(last) / _FINE))
        depth_of[:, int(max(first - 4, 0)) : int(last + 4)] = np.clip(
            1.0 + 8 * loose * rng.normal(), 0.25, 1.5
        )
    if rng.random() < 0.25:
        _add_clutter(mask, rng)
    return np.asarray(mask / 255.0, dtype=np.float32), _blur(depth_of, 3.0), tuple(places)


def _add_clutter(mask: NDArray[np.uint8], rng: np.random.Generator) -> None:
    """Edges, frames and other lines above and below the text."""
    rows, columns = mask.shape
    for _ in range(int(rng.integers(1, 4))):
        near = rows / 2 + float(rng.choice([-1.0, 1.0])) * _H * float(rng.uniform(0.68, 1.1))
        tilt = float(rng.normal(0.0, 0.03)) * columns
        wide = max(1, round(float(rng.uniform(0.04, 0.3)) * _H))
        ends = sorted(int(v) for v in rng.integers(0, columns, 2))
        cv2.line(mask, (ends[0], int(near - tilt)), (ends[1], int(near + tilt)), 255, wide, cv2.LINE_AA)


def _profile(mask: Field, rng: np.random.Generator, *, dotted: bool) -> Field:
    """The tool's section, 0 on the land to 1 at the floor of the mark."""
    kind = 0.0 if dotted else rng.random()
    ink = (mask > 0.5).astype(np.uint8)
    grown = round(float(rng.normal(0.0, 0.02)) * _H)
    if grown:
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * abs(grown) + 1,) * 2)
        changed = np.asarray(cv2.dilate(ink, kernel) if grown > 0 else cv2.erode(ink, kernel), dtype=np.uint8)
        ink = changed if changed.mean() > 0.4 * ink.mean() else ink
    if kind < 0.2:
        return _peen(ink, rng)
    if kind < 0.3:
        line = max(2, round(float(rng.uniform(0.04, 0.1)) * _H))
        ink = np.asarray(
            cv2.morphologyEx(ink, cv2.MORPH_GRADIENT, np.ones((line, line), np.uint8)), dtype=np.uint8
        )
    inside = cv2.distanceTransform(ink, cv2.DIST_L2, 3)
    wall = float(rng.uniform(0.015, 0.09)) * _H
    shape = np.clip(inside / wall, 0.0, 1.0)
    if rng.random() < 0.3:
        shape = np.sqrt(shape)
    return _blur(np.asarray(shape, dtype=np.float32), float(rng.uniform(0.4, 2.0)))


def _peen(ink: NDArray[np.uint8], rng: np.random.Generator) -> Field:
    """Peened: a dot every so far along the middle of the strokes."""
    pitch = float(rng.uniform(0.08, 0.16)) * _H
    field = np.zeros(ink.shape, dtype=np.float32)
    jitter = float(rng.uniform(0.0, 0.12)) * pitch
    for dot in middle_dots(ink, pitch):
        if rng.random() < 0.97:
            row, column = np.round(dot + rng.normal(0.0, jitter, 2)).astype(int)
            if 0 <= row < ink.shape[0] and 0 <= column < ink.shape[1]:
                field[row, column] = float(rng.uniform(0.7, 1.0))
    size = float(rng.uniform(0.3, 0.5)) * pitch
    return np.asarray(np.clip(_blur(field, size) * (2 * np.pi * size**2) * 1.2, 0.0, 1.0), dtype=np.float32)


def _plate(shape: tuple[int, int], depth: float, rng: np.random.Generator) -> Field:
    """Form, machining marks, grain and scratches of the land."""
    rows, columns = shape
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32) / _H
    z = rng.normal(0, 0.006) * x + rng.normal(0, 0.006) * y + rng.normal(0, 0.001) * x * x
    z += depth * 0.5 * float(rng.uniform(0, 1)) ** 2 * _noise(shape, (2.5 * _H, 2.5 * _H), rng)
    z += depth * 0.25 * float(rng.uniform(0, 1)) ** 3 * _rough(shape, float(rng.uniform(3.0, 14.0)), rng)
    if rng.random() < 0.5:
        along = (
            (1.0, float(rng.uniform(20, 200))) if rng.random() < 0.5 else (float(rng.uniform(20, 200)), 1.0)
        )
        lines = _blur(_noise(shape, along, rng), float(rng.uniform(0.5, 2.5)))
        z += depth * 0.35 * float(rng.uniform(0, 1)) ** 2 * lines
    scratches = np.zeros(shape, dtype=np.float32)
    for _ in range(int(rng.poisson(0.8))):
        ends = np.round(rng.uniform(-0.2, 1.2, (2, 2)) * (columns, rows)).astype(int).tolist()
        cv2.line(
            scratches, ends[0], ends[1], float(rng.uniform(0.2, 0.9)), int(rng.integers(1, 4)), cv2.LINE_AA
        )
    return np.asarray(z - depth * _blur(scratches, 0.7), dtype=np.float32)


def _soil(
    shape: tuple[int, int], mask: Field, depth: float, severity: float, rng: np.random.Generator
) -> Field:
    """Thickness of what lies on the part: what fills marks, lumps on the land, crumbs."""
    soil = np.zeros(shape, dtype=np.float32)
    if rng.random() < 0.75:
        full = np.clip(0.9 * severity + 0.5 * _rough(shape, float(rng.uniform(0.4, 2.0)) * _H, rng), 0.0, 1.1)
        soil += depth * full * _blur(mask, 0.02 * _H) * float(rng.uniform(0.5, 1.0))
    if rng.random() < 0.85:
        size = float(np.exp(rng.uniform(np.log(0.15), np.log(1.5)))) * _H
        least = float(rng.uniform(0.2, 1.8)) * (1.3 - 0.6 * severity)
        lumps = np.maximum(_rough(shape, size, rng) - least, 0.0)
        soil += severity * float(np.exp(rng.uniform(np.log(0.01), np.log(0.09)))) * lumps
    if rng.random() < 0.4:
        crumbs = (rng.random(shape) < 0.002 * severity).astype(np.float32)
        size = float(rng.uniform(0.01, 0.05)) * _H
        soil += float(rng.uniform(0.01, 0.05)) * np.clip(_blur(crumbs, size) * 9 * size**2, 0.0, 1.5)
    return soil


def _small(field: Field) -> Field:
    size = (field.shape[1] // _FINE, field.shape[0] // _FINE)
    return np.asarray(cv2.resize(field, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _measure(made: _Sketch) -> Field:
    layers = np.zeros((LAYERS, TALL_ROWS, made.surface.shape[1] // _FINE), dtype=np.float32)
    layers[HEIGHTS] = _small(made.surface)
    layers[HEIGHTS] -= np.median(layers[HEIGHTS])
    layers[KNOWN] = 1.0
    return layers


def _touch(made: _Sketch, rng: np.random.Generator) -> Field:
    """Return the path of a ball sliding over the surface, and its slopes along the passes."""
    layers = _measure(made)
    radius = float(rng.uniform(0.03, 0.16)) * _H
    ball = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (max(1, round(0.5 * radius)) * 2 + 1,) * 2)
    felt = _small(_blur(np.asarray(cv2.dilate(made.surface, ball), dtype=np.float32), 0.3 * radius))
    felt -= np.median(felt)
    rows, columns = felt.shape
    lines = float(rng.uniform(10.0, 40.0)) / HEIGHT_ROWS
    if lines < 1.0:
        coarse = cv2.resize(felt, (round(columns * lines), round(rows * lines)), interpolation=cv2.INTER_AREA)
        felt = np.asarray(
            cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_LINEAR), dtype=np.float32
        )
    layers[HEIGHTS] = felt
    dx, dy = (np.gradient(felt, axis=axis) * HEIGHT_ROWS for axis in (1, 0))
    lift, slope = felt / _PRELOAD, float(rng.uniform(0.4, 1.0))
    grit = float(rng.uniform(0.0, 0.03))
    for k, edge in enumerate((lift + slope * dx, lift + slope * dy, lift - slope * dx, lift - slope * dy)):
        noise = _blur(rng.standard_normal(felt.shape).astype(np.float32), 0.6)
        layers[EDGES + k] = np.clip(edge + grit * noise, -8.0, 8.0)
    return layers


def _photograph(made: _Sketch, rng: np.random.Generator) -> Field:
    """Under a lamp from one side: shading, gloss, grime in other colours, blur and noise."""
    shape = made.surface.shape
    z = made.surface + 0.004 * float(rng.uniform(0, 1)) * rng.standard_normal(shape).astype(np.float32)
    z = _blur(z, float(rng.uniform(0.5, 1.5)))
    gx, gy = (np.gradient(z, axis=axis) * _H for axis in (1, 0))
    norm = np.sqrt(1.0 + gx * gx + gy * gy)
    azimuth, high = float(rng.uniform(0, 2 * np.pi)), np.radians(float(rng.uniform(15.0, 75.0)))
    light = np.array([np.cos(azimuth) * np.cos(high), np.sin(azimuth) * np.cos(high), np.sin(high)])
    diffuse = np.maximum((-gx * light[0] - gy * light[1] + light[2]) / norm, 0.0)
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    gloss = np.maximum((-gx * half[0] - gy * half[1] + half[2]) / norm, 0.0) ** float(rng.uniform(5.0, 80.0))
    albedo = float(rng.uniform(0.3, 0.8)) * (
        1.0 + 0.25 * float(rng.uniform(0, 1)) ** 2 * _rough(shape, _H, rng)
    )
    if rng.random() < 0.45:  # what fills the marks, or prints them, is darker or lighter
        share = float(rng.uniform(0.2, 1.0)) * np.clip(made.ink, 0.0, 1.0)
        patchy = np.clip(0.8 + 0.5 * _rough(shape, 0.8 * _H, rng), 0.0, 1.0) if rng.random() < 0.5 else 1.0
        albedo = albedo * (1 - share * patchy) + share * patchy * float(rng.choice([0.05, 0.15, 0.9]))
    dirty = np.clip(made.soil / 0.012, 0.0, 1.0)
    grime = float(rng.uniform(0.05, 0.8)) * (1.0 + 0.35 * _rough(shape, 0.3 * _H, rng))
    albedo = albedo * (1 - dirty) + grime * dirty
    if made.severity and rng.random() < 0.5:  # stains that have no height
        stain = np.clip(_rough(shape, float(rng.uniform(0.3, 2.0)) * _H, rng) - 1.2 + made.severity, 0.0, 1.0)
        albedo = albedo * (1 - stain * float(rng.uniform(0.1, 0.8)))
    ambient = float(rng.uniform(0.1, 0.6))
    shine = float(rng.choice([0.0, rng.uniform(0.0, 1.2)])) * (1 - 0.8 * dirty)
    image = np.clip(albedo, 0.02, 1.0) * (ambient + (1 - ambient) * diffuse) + shine * gloss
    image *= np.exp(0.5 * float(rng.uniform(0, 1)) * _noise(shape, (3 * _H, 4 * _H), rng))
    if rng.random() < 0.15:  # a lamp's reflection
        image += 2.0 * np.maximum(_noise(shape, (1.5 * _H, 2 * _H), rng) - 1.2, 0.0)
    return _take_picture(np.asarray(image, dtype=np.float32), rng)


def _take_picture(image: Field, rng: np.random.Generator) -> Field:
    """Lens, sensor and file."""
    image = _blur(image, float(rng.uniform(0.0, 0.05)) * _H)
    pixels = float(np.exp(rng.uniform(np.log(14.0), np.log(56.0)))) / _H
    size = (round(image.shape[1] * pixels), round(image.shape[0] * pixels))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    low, high = np.percentile(small, [1.0, 99.0])
    target = np.sort(rng.uniform(0.02, 1.02, 2))
    small = (small - low) / max(float(high - low), 1e-3) * max(float(target[1] - target[0]), 0.12) + target[0]
    small += float(rng.uniform(0.0, 1.0)) ** 2 * 0.06 * rng.standard_normal(small.shape).astype(np.float32)
    eight = np.asarray(
        255.0 * np.clip(small, 0.0, 1.0) ** float(np.exp(rng.normal(0.0, 0.25))), dtype=np.uint8
    )
    if rng.random() < 0.4:
        _, file = cv2.imencode(".jpg", eight, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 95))])
        eight = np.asarray(cv2.imdecode(file, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)
    layers = np.zeros((LAYERS, TALL_ROWS, image.shape[1] // _FINE), dtype=np.float32)
    whole = cv2.resize(eight, (layers.shape[2], TALL_ROWS), interpolation=cv2.INTER_LINEAR)
    layers[GREY], layers[KNOWN] = whole.astype(np.float32) / 255.0, 1.0
    return layers


def sketch_many(fonts: Sequence[Path], count: int, rng: np.random.Generator) -> list[TrainingStrip]:
    """Strips of so many lines; what a font cannot draw is drawn again."""
    strips: list[TrainingStrip] = []
    while count:
        try:
            strips += sketch_strips(fonts, rng)
        except (MarksError, ValueError):
            continue
        count -= 1
    return strips
