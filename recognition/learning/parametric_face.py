"""Faces without end: skeletons of letters, drawn in a random style (slabs, slants, pens, stencils, fourteen segments).

skeleton --corners bent--> centre lines --pen--> ink --traced--> outlines

+----+     .--.      /--\\      a corner from square over a superellipse (3) and a circle (2) to a chamfer (1)
|    |    |    |    |    |
+----+     '--'      \\--/
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, FontError, Glyph, Points
from glyphs.opencv import cv2
from glyphs.ranges import NotNegative, Range, Share, Validated

_PIXELS = 240
"""Pixels per cap height of the ink that is traced: an outline is exact to a fifth of a per cent of the height."""
_EDGE = 90
"""Pixels of land around the ink that is traced."""
_LEAST_WIDTH = 3.0
"""Least width of the letter H in widths of its strokes: narrower letters enclose no area that can be felt."""
_SHIFT = 4
"""Bits of a fraction of a pixel in coordinates of OpenCV."""


@cache
def _skeletons() -> Mapping[str, Any]:
    drawn: Mapping[str, Any] = json.loads(Path(__file__).with_name("skeletons.json").read_text("utf-8"))
    return drawn


@dataclass(frozen=True)
class FaceStyle(Validated, error=FontError):
    """Style of a parametric face; lengths are in cap heights."""

    corner: Share = 0.8  # share of the half edge beside it that a bent corner takes
    # exponent of the superellipse of a corner: 1 is a chamfer, 2 a circle, above 3 nearly a right angle
    power: Annotated[float, Range(0.7, 12.0)] = 2.0
    width: Annotated[float, Range(0.2, 1.5)] = 0.6
    stroke: Annotated[float, Range(0.03, 0.35)] = 0.14
    level_stroke: Annotated[float, Range(0.3, 2.0)] = 1.0
    round_ends: bool = False
    slab: NotNegative = 0.0
    slant: Annotated[float, Range(-0.5, 0.5)] = 0.0
    stencil: NotNegative = 0.0
    segment_gap: Share | None = None
    forms: Mapping[str, int] = field(default_factory=dict)


def draw_style(rng: np.random.Generator) -> FaceStyle:
    """Draw a random style."""
    kind = rng.choice(
        ["square", "superellipse", "round", "octagon", "segments"], p=[0.2, 0.3, 0.2, 0.22, 0.08]
    )
    power = {"octagon": 1.0, "round": 2.0}.get(kind, float(np.exp(rng.uniform(np.log(2.2), np.log(6.0)))))
    corner = 0.0 if kind == "square" else float(rng.uniform(0.25, 1.0))
    width = float(np.exp(rng.uniform(np.log(0.36), np.log(0.95))))
    stroke = min(float(np.exp(rng.uniform(np.log(0.07), np.log(0.22)))), 0.98 * width / _LEAST_WIDTH)
    contrast = rng.random() < 0.4
    return FaceStyle(
        corner=corner,
        power=power,
        width=width,
        stroke=stroke,
        level_stroke=float(rng.uniform(0.5, 1.25)) if contrast else 1.0,
        round_ends=bool(rng.random() < 0.35),
        slab=float(rng.uniform(0.08, 0.16)) if rng.random() < 0.2 else 0.0,
        slant=float(rng.uniform(-0.05, 0.25)) if rng.random() < 0.25 else 0.0,
        stencil=float(rng.uniform(0.05, 0.12)) if rng.random() < 0.2 else 0.0,
        segment_gap=float(rng.uniform(0.01, 0.08)) if kind == "segments" else None,
        forms={char: int(rng.integers(12)) for char in _skeletons()["characters"]},
    )


def draw_face(style: FaceStyle, *, name: str = "parametric") -> Font:
    """Draw all characters of the skeletons in a style. Raises FontError for a letter too narrow for its strokes."""
    if style.width < _LEAST_WIDTH * style.stroke:
        raise FontError(f"letters {style.width:.2f} wide have no room for strokes of {style.stroke:.2f}")
    glyphs = {char: _glyph(char, style) for char in _skeletons()["characters"]}
    blank = Glyph(" ", advance=0.6 * style.width)
    return Font(name, {**glyphs, " ": blank}, 0.0, "drawn for training")


def _glyph(char: str, style: FaceStyle) -> Glyph:
    lines, wide = _centre_lines(char, style)
    ink = _ink(lines, wide, style)
    if style.stencil and style.segment_gap is None:
        _cut_bridges(ink, wide, style)
    contours = _trace(ink, style)
    left = min(float(contour[:, 0].min()) for contour in contours)
    right = max(float(contour[:, 0].max()) for contour in contours)
    bearing = 0.5 * max(0.12, style.stroke)
    return Glyph(
        char,
        contours=tuple(contour + np.array([bearing - left, 0.0]) for contour in contours),
        advance=right - left + 2 * bearing,
    )


def _centre_lines(char: str, style: FaceStyle) -> tuple[list[Points], float]:
    drawn = _skeletons()
    relative, *forms = drawn["characters"][char]
    wide = max(relative * style.width - style.stroke, 0.0)
    if relative == 0.0:  # a lone upright: its serifs reach beyond the box
        wide = 0.45 * style.width
    tall = 1.0 - style.level_stroke * style.stroke
    size, foot = np.array([wide, tall]), 0.5 * style.level_stroke * style.stroke
    if style.segment_gap is not None and char in drawn["segments"]["characters"]:
        wide = style.width - style.stroke
        lit = drawn["segments"]["characters"][char]
        ends = [np.array(drawn["segments"]["strokes"][name]) * (wide, tall) + (0.0, foot) for name in lit]
        return [_shorten(line, style.segment_gap + 0.5 * style.stroke) for line in ends], wide
    strokes = forms[style.forms.get(char, 0) % len(forms)]
    lines = [_bend(stroke, size, style) + np.array([0.0, foot]) for stroke in strokes]
    if style.slab:
        lines += _slabs(lines, style)
    return lines, wide


def _shorten(line: Points, by: float) -> Points:
    along = line[1] - line[0]
    share = min(by / float(np.hypot(*along)), 0.45)
    return np.stack([line[0] + share * along, line[1] - share * along])


def _bend(stroke: Sequence[Sequence[float]], size: NDArray[np.float64], style: FaceStyle) -> Points:
    points = np.array([point[:2] for point in stroke], dtype=np.float64) * size
    bent = [len(point) > 2 for point in stroke]
    angle = np.linspace(0.0, 0.5 * math.pi, 9)[:, None]
    towards_start, towards_end = np.cos(angle) ** (2.0 / style.power), np.sin(angle) ** (2.0 / style.power)
    pieces = [points[:1]]
    for k in range(1, len(points) - 1):
        corner, arms = points[k], points[[k - 1, k + 1]] - points[k]
        lengths = np.maximum(np.hypot(*arms.T), 1e-9)
        # two bent corners share the edge between them, and a corner is about as wide as it is tall
        free = lengths * [0.5 if bent[k - 1] else 1.0, 0.5 if bent[k + 1] else 1.0]
        reach = style.corner * np.minimum(free, min(1.6 * free.min(), 0.4))
        if not bent[k] or reach.min() < 1e-3:
            pieces.append(points[k : k + 1])
            continue
        to_start, to_end = arms * (reach / lengths)[:, None]
        middle = corner + to_start + to_end
        pieces.append(middle - towards_start * to_end - towards_end * to_start)
    return np.concatenate([*pieces, points[-1:]])


def _slabs(lines: Sequence[Points], style: FaceStyle) -> list[Points]:
    half = 0.5 * style.level_stroke * style.stroke
    slabs = []
    for line in lines:
        for end, inner in ((line[0], line[1]), (line[-1], line[-2])):
            upright = abs(end[1] - inner[1]) > abs(end[0] - inner[0])
            at_edge = min(abs(end[1] - half), abs(end[1] - 1.0 + half)) < 1e-6
            if upright and at_edge:
                reach = np.array([style.slab, 0.0])
                slabs.append(np.array([end - reach, end + reach]))
    return slabs


def _pixels(points: Points) -> NDArray[np.int32]:
    placed = np.column_stack([points[:, 0] * _PIXELS + _EDGE, (1.0 - points[:, 1]) * _PIXELS + _EDGE])
    return np.asarray(np.round(placed * (1 << _SHIFT)), dtype=np.int32)


def _ink(lines: Sequence[Points], wide: float, style: FaceStyle) -> NDArray[np.uint8]:
    # ink is 255
    ink = np.zeros((_PIXELS + 2 * _EDGE, round(wide * _PIXELS) + 2 * _EDGE), dtype=np.uint8)
    for line in lines:
        closed = bool(np.allclose(line[0], line[-1]))
        along = np.diff(line, axis=0)
        lengths = np.hypot(*along.T)
        line, along = line[np.append(True, lengths > 1e-9)], along[lengths > 1e-9]
        along = along / np.hypot(*along.T)[:, None]
        half = 0.5 * style.stroke * np.hypot(along[:, 0] * style.level_stroke, along[:, 1])
        last = len(along) - 1
        for k, (direction, width) in enumerate(zip(along, half, strict=True)):
            start, end = line[k], line[k + 1]
            across = width * np.array([-direction[1], direction[0]])
            before = along[k - 1] if k or closed else None
            after = along[(k + 1) % len(along)] if k < last or closed else None
            start = start - width * direction * _is_square(before, direction, style)
            end = end + width * direction * _is_square(after, direction, style)
            quad = np.array([start + across, end + across, end - across, start - across])
            cv2.fillConvexPoly(ink, _pixels(quad), 255, cv2.LINE_AA, _SHIFT)
            for joint, other in ((line[k], before), (line[k + 1], after)):
                if style.round_ends or other is not None:
                    radius = round(width * _PIXELS * (1 << _SHIFT))
                    cv2.circle(ink, _pixels(joint[None])[0].tolist(), radius, 255, -1, cv2.LINE_AA, _SHIFT)
    lowest = min(float(line[:, 1].min()) for line in lines)
    ink[: _EDGE - 1] = 0  # letters are level at the top, and at the foot unless they have a tail
    if lowest > 0.0:
        ink[_EDGE + _PIXELS + 1 :] = 0
    return ink


def _is_square(other: Points | None, direction: Points, style: FaceStyle) -> bool:
    return not style.round_ends and (other is None or abs(float(other @ direction)) < 0.2)


def _cut_bridges(ink: NDArray[np.uint8], wide: float, style: FaceStyle) -> None:
    _, levels = cv2.findContours(ink, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if levels is not None and (levels[0, :, 3] >= 0).any():
        middle, half = _EDGE + 0.5 * wide * _PIXELS, 0.5 * style.stencil * _PIXELS
        ink[:, round(middle - half) : round(middle + half)] = 0


def _trace(ink: NDArray[np.uint8], style: FaceStyle) -> list[Points]:
    outlines, _ = cv2.findContours((ink > 127).view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    contours = []
    for outline in outlines:
        corners = cv2.approxPolyDP(outline, 0.7, True).reshape(-1, 2)
        if len(corners) >= 3:
            x, y = (corners[:, 0] - _EDGE) / _PIXELS, 1.0 - (corners[:, 1] - _EDGE) / _PIXELS
            contours.append(np.column_stack([x + (y - 0.5) * style.slant, y]))
    return contours
