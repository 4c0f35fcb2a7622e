"""A second generator of marks: it sketches lines of text on a plate, far more varied than stamped parts.

    text --outlines--> ink --profile of the tool--> marks --plate, dirt, wear--> surface

Sketches share no code with `glyphs.stamping` and are a hundred times as cheap; networks are trained on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.dots import dotted_font, middle_dots
from glyphs.fonts.glyph import Font
from glyphs.opencv import cv2
from glyphs.stamping.die import Box
from glyphs.surface.display import OneLine

Field = NDArray[np.float32]

ROWS_PER_HEIGHT = 56
"""Samples of a sketch per character height."""
ROWS = 128
"""Rows of a sketch: a line with 0.64 character heights of land above and below it."""
MARGIN = 0.8
"""Land before and after a line, character heights."""
_H = ROWS_PER_HEIGHT


@dataclass(frozen=True, eq=False, repr=False)
class Sketch(OneLine):
    """A sketched line."""

    text: str
    # (x0, y0, x1, y1) around the ink of each character, pixels; a space has its empty cell
    boxes: tuple[Box, ...]
    surface: Field  # (ROWS, columns) heights, character heights
    ink: Field  # (ROWS, columns) 0 on the land to 1 in the marks
    soil: Field  # (ROWS, columns) thickness of the dirt on it, character heights
    severity: float


def sketch(font: Font, text: str, rng: np.random.Generator, *, clean: bool = False) -> Sketch:
    """Sketch a line of text; `clean` leaves out dirt, wear and prints without relief. Raises FontError."""
    dotted = rng.random() < 0.1
    if dotted:
        font = dotted_font(font, text, rng=rng)
    mask, depth_of, boxes = _mask(text, font, rng)
    shape = mask.shape
    depth = float(np.exp(rng.uniform(np.log(0.02), np.log(0.13))))
    raised = rng.random() < 0.25
    marks = _profile(mask, rng, dotted=dotted) * depth_of
    ink = np.clip(marks * 1.5, 0.0, 1.0)
    flat = not clean and rng.random() < 0.08  # a laser mark or a print: almost no relief
    severity = 0.0 if clean or rng.random() < 0.2 else float(rng.uniform(0.1, 1.0))
    marks *= np.clip(1.0 - 0.7 * severity * np.maximum(rough_noise(shape, 1.2 * _H, rng), 0.0), 0.0, 1.0)
    surface = (marks if raised else -marks) * (0.05 if flat else 1.0) * depth
    if not raised and rng.random() < 0.5:  # burr that the tool raised beside the mark
        rim = blur(mask, 0.07 * _H) * (1.0 - mask) * blur(noise(shape, (_H, _H), rng), 2.0)
        surface += depth * float(rng.uniform(0.0, 0.5)) * rim
    surface += _plate(shape, depth, rng)
    soil = np.zeros(shape, dtype=np.float32)
    if severity:
        soil = _soil(shape, mask, depth, severity, rng)
        surface = surface + soil
    return Sketch(text, boxes, np.asarray(surface, dtype=np.float32), ink, soil, severity)


def noise(shape: tuple[int, int], cell: tuple[float, float], rng: np.random.Generator) -> Field:
    """Smooth noise with standard deviation 1, interpolated from a coarser grid."""
    small = [max(2, round(n / c)) for n, c in zip(shape, cell, strict=True)]
    field = rng.standard_normal(small).astype(np.float32)
    return np.asarray(cv2.resize(field, shape[::-1], interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def rough_noise(shape: tuple[int, int], coarsest: float, rng: np.random.Generator) -> Field:
    """Noise of standard deviation 1 in four octaves; the coarsest has cells of `coarsest` pixels."""
    fall = float(rng.uniform(0.35, 0.75))
    layers = [fall**k * noise(shape, (max(1.0, coarsest / 2**k),) * 2, rng) for k in range(4)]
    total = np.sum(layers, axis=0, dtype=np.float32)
    return np.asarray(total / (total.std() + 1e-6), dtype=np.float32)


def blur(field: Field, sigma: float) -> Field:
    """Blur by a Gaussian with a standard deviation in pixels; up to 0.2 the field is returned unchanged."""
    return np.asarray(cv2.GaussianBlur(field, (0, 0), sigma), dtype=np.float32) if sigma > 0.2 else field


def _mask(text: str, font: Font, rng: np.random.Generator) -> tuple[Field, Field, tuple[Box, ...]]:
    gap = float(rng.choice([0.0, rng.uniform(-0.03, 0.25)]))
    stretch = float(np.exp(rng.normal(0.0, 0.12)))
    slant = float(rng.normal(0.0, 0.08))
    loose = float(rng.choice([0.0, 0.03, 0.06]))
    glyphs = [font.glyph(char) for char in text]
    margin = MARGIN * _H
    starts = margin + np.cumsum([0.0, *((g.advance + gap) * stretch * _H for g in glyphs)])
    shape = (ROWS, int(starts[-1] - gap * stretch * _H + margin) // 4 * 4)
    mask, depth_of = np.zeros(shape, dtype=np.uint8), np.ones(shape, dtype=np.float32)
    foot = shape[0] / 2 + _H / 2
    stroke = float(rng.uniform(0.07, 0.2))
    boxes: list[Box] = []
    for glyph, start in zip(glyphs, starts[:-1], strict=True):
        turn = float(rng.normal(0.0, 0.7 * loose))
        size = _H * (1.0 + float(rng.normal(0.0, 0.4 * loose)))
        shift = rng.normal(0.0, loose * _H, 2) * (1.0, 0.7)
        middle = np.array([glyph.advance / 2, 0.5])
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

        def placed(points: NDArray[np.float64]) -> NDArray[np.int32]:
            turned_points = (points - middle) @ turned.T + middle  # noqa: B023
            x = start + (turned_points[:, 0] + slant * turned_points[:, 1]) * stretch * size + shift[0]  # noqa: B023
            y = foot - turned_points[:, 1] * size + shift[1]  # noqa: B023
            return np.asarray(np.round(16 * np.stack([x, y], axis=1)), dtype=np.int32)

        if glyph.contours:
            cv2.fillPoly(mask, [placed(c) for c in glyph.contours], 255, lineType=cv2.LINE_AA, shift=4)
        for line in glyph.strokes:
            wide = max(1, round((font.stroke_ratio if len(line) == 1 else stroke) * _H))
            outline = placed(line if len(line) > 1 else np.repeat(line, 2, axis=0))
            cv2.polylines(mask, [outline], False, 255, wide, cv2.LINE_AA, 4)
        cell = np.array([[start, foot - _H], [start + glyph.advance * stretch * _H, foot]])
        points = np.concatenate([placed(c) / 16 for c in glyph.contours + glyph.strokes] or [cell])
        (first, top), (last, bottom) = points.min(axis=0), points.max(axis=0)
        boxes.append((float(first), float(top), float(last), float(bottom)))
        relative_depth = np.clip(1.0 + 8 * loose * rng.normal(), 0.25, 1.5)
        depth_of[:, int(max(first - 4, 0)) : int(last + 4)] = relative_depth
    if rng.random() < 0.25:
        _add_clutter(mask, rng)
    return np.asarray(mask / 255.0, dtype=np.float32), blur(depth_of, 3.0), tuple(boxes)


def _add_clutter(mask: NDArray[np.uint8], rng: np.random.Generator) -> None:
    rows, columns = mask.shape
    for _ in range(int(rng.integers(1, 4))):
        near = rows / 2 + float(rng.choice([-1.0, 1.0])) * _H * float(rng.uniform(0.68, 1.1))
        tilt = float(rng.normal(0.0, 0.03)) * columns
        wide = max(1, round(float(rng.uniform(0.04, 0.3)) * _H))
        ends = sorted(int(v) for v in rng.integers(0, columns, 2))
        cv2.line(mask, (ends[0], int(near - tilt)), (ends[1], int(near + tilt)), 255, wide, cv2.LINE_AA)


def _profile(mask: Field, rng: np.random.Generator, *, dotted: bool) -> Field:
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
        edge = cv2.morphologyEx(ink, cv2.MORPH_GRADIENT, np.ones((line, line), np.uint8))
        ink = np.asarray(edge, dtype=np.uint8)
    inside = cv2.distanceTransform(ink, cv2.DIST_L2, 3)
    wall = float(rng.uniform(0.015, 0.09)) * _H
    shape = np.clip(inside / wall, 0.0, 1.0)
    if rng.random() < 0.3:
        shape = np.sqrt(shape)
    return blur(np.asarray(shape, dtype=np.float32), float(rng.uniform(0.4, 2.0)))


def _peen(ink: NDArray[np.uint8], rng: np.random.Generator) -> Field:
    pitch = float(rng.uniform(0.08, 0.16)) * _H
    field = np.zeros(ink.shape, dtype=np.float32)
    jitter = float(rng.uniform(0.0, 0.12)) * pitch
    for dot in middle_dots(ink, pitch):
        if rng.random() < 0.97:
            row, column = np.round(dot + rng.normal(0.0, jitter, 2)).astype(int)
            if 0 <= row < ink.shape[0] and 0 <= column < ink.shape[1]:
                field[row, column] = float(rng.uniform(0.7, 1.0))
    size = float(rng.uniform(0.3, 0.5)) * pitch
    return np.asarray(np.clip(blur(field, size) * (2 * np.pi * size**2) * 1.2, 0.0, 1.0), dtype=np.float32)


def _plate(shape: tuple[int, int], depth: float, rng: np.random.Generator) -> Field:
    rows, columns = shape
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32) / _H
    z = rng.normal(0, 0.006) * x + rng.normal(0, 0.006) * y + rng.normal(0, 0.001) * x * x
    z += depth * 0.5 * float(rng.uniform(0, 1)) ** 2 * noise(shape, (2.5 * _H, 2.5 * _H), rng)
    z += depth * 0.25 * float(rng.uniform(0, 1)) ** 3 * rough_noise(shape, float(rng.uniform(3.0, 14.0)), rng)
    if rng.random() < 0.5:
        along = (
            (1.0, float(rng.uniform(20, 200))) if rng.random() < 0.5 else (float(rng.uniform(20, 200)), 1.0)
        )
        lines = blur(noise(shape, along, rng), float(rng.uniform(0.5, 2.5)))
        z += depth * 0.35 * float(rng.uniform(0, 1)) ** 2 * lines
    scratches = np.zeros(shape, dtype=np.float32)
    for _ in range(int(rng.poisson(0.8))):
        ends = np.round(rng.uniform(-0.2, 1.2, (2, 2)) * (columns, rows)).astype(int).tolist()
        strength, wide = float(rng.uniform(0.2, 0.9)), int(rng.integers(1, 4))
        cv2.line(scratches, ends[0], ends[1], strength, wide, cv2.LINE_AA)
    return np.asarray(z - depth * blur(scratches, 0.7), dtype=np.float32)


def _soil(
    shape: tuple[int, int], mask: Field, depth: float, severity: float, rng: np.random.Generator
) -> Field:
    soil = np.zeros(shape, dtype=np.float32)
    if rng.random() < 0.75:
        full = np.clip(
            0.9 * severity + 0.5 * rough_noise(shape, float(rng.uniform(0.4, 2.0)) * _H, rng), 0.0, 1.1
        )
        soil += depth * full * blur(mask, 0.02 * _H) * float(rng.uniform(0.5, 1.0))
    if rng.random() < 0.85:
        size = float(np.exp(rng.uniform(np.log(0.15), np.log(1.5)))) * _H
        least = float(rng.uniform(0.2, 1.8)) * (1.3 - 0.6 * severity)
        lumps = np.maximum(rough_noise(shape, size, rng) - least, 0.0)
        soil += severity * float(np.exp(rng.uniform(np.log(0.01), np.log(0.09)))) * lumps
    if rng.random() < 0.4:
        crumbs = (rng.random(shape) < 0.002 * severity).astype(np.float32)
        size = float(rng.uniform(0.01, 0.05)) * _H
        soil += float(rng.uniform(0.01, 0.05)) * np.clip(blur(crumbs, size) * 9 * size**2, 0.0, 1.5)
    return soil
