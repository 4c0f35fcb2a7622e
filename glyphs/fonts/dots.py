"""Dotted fonts, as dot-peen markers and dot-matrix dies write them.

#####        o o o o o
#            o                 a matrix of five by seven; a finer grid; or dots evenly spaced
####   -->   o o o o           along the middle of a font's strokes
    #                o
####         o o o o
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, Glyph, Points
from glyphs.fonts.outlines import SERIAL_CHARACTERS
from glyphs.opencv import cv2

_MATRIX: dict[str, str] = json.loads(Path(__file__).with_name("dot_matrix.json").read_text("utf-8"))[
    "columns"
]
_PIXELS = 80
"""Pixels per cap height of a glyph whose strokes are thinned."""


def dotted_font(font: Font, text: str, *, rng: np.random.Generator) -> Font:
    """Make a dotted font with capitals, digits and the characters of a text. Raises FontError."""
    kind, chars = rng.random(), sorted({*text, *SERIAL_CHARACTERS})
    if kind < 0.4 and all(char in _MATRIX or char == " " for char in text):
        across = float(rng.uniform(0.75, 1.15)) / 6
        dots = {
            char: _matrix_dots(char) * (across, 1 / 6) for char in chars if char in _MATRIX or char == " "
        }
    else:
        pitch = float(rng.uniform(0.07, 0.16))
        grid = 1.0 / int(rng.integers(6, 11)) if kind < 0.7 else 0.0
        dots = {char: _thinned_dots(font.glyph(char), grid or pitch, on_grid=grid > 0) for char in chars}
    dot = float(rng.uniform(0.07, 0.13))
    gap = float(rng.uniform(0.12, 0.35))
    glyphs = {char: _glyph(char, points, dot, gap) for char, points in dots.items()}
    return Font(
        f"{font.name}, dotted", glyphs, stroke_ratio=min(1.5 * dot, 0.19), source="drawn for training"
    )


def _matrix_dots(char: str) -> Points:
    columns = bytes.fromhex(_MATRIX.get(char, ""))
    return np.array(
        [(x, 6 - y) for x, column in enumerate(columns) for y in range(7) if column >> y & 1], dtype=float
    ).reshape(-1, 2)


def _thinned_dots(glyph: Glyph, pitch: float, *, on_grid: bool) -> Points:
    if not glyph.inked:
        return np.empty((0, 2))
    x0, y0, x1, y1 = glyph.ink_box
    size = (int((y1 - y0) * _PIXELS) + 9, int((x1 - x0) * _PIXELS) + 9)
    ink = np.zeros(size, dtype=np.uint8)

    def placed(points: Points) -> NDArray[np.int32]:
        return np.round(np.column_stack([points[:, 0] - x0, y1 - points[:, 1]]) * _PIXELS + 4).astype(
            np.int32
        )

    if glyph.contours:
        cv2.fillPoly(ink, [placed(c) for c in glyph.contours], 255)
    for line in glyph.strokes:
        cv2.polylines(ink, [placed(np.vstack([line, line[:1]]) if len(line) == 1 else line)], False, 255, 7)
    middle = middle_dots(ink, pitch * _PIXELS)
    centres = np.column_stack([middle[:, 1] - 4, 4 - middle[:, 0]]) / _PIXELS + (x0, y1)
    low, high = centres[:, 1].min(), centres[:, 1].max()
    if high - low > 0.3:  # stretch them to the height of the glyph
        centres[:, 1] = y0 + (centres[:, 1] - low) * (y1 - y0) / (high - low)
    return np.unique(np.round(centres / pitch), axis=0) * pitch if on_grid else centres


def middle_dots(ink: NDArray[np.uint8], pitch: float) -> NDArray[np.int64]:
    """Find dots along the middle of the ink, about `pitch` pixels apart: (n, 2) rows and columns."""
    inside = cv2.distanceTransform(ink, cv2.DIST_L2, 3)
    middle = (inside >= cv2.dilate(inside, np.ones((3, 3), np.uint8)) - 0.3) & (inside > 1.0)
    left = np.argwhere(middle)
    left = left[np.lexsort((left[:, 0], left[:, 1] // max(1.0, pitch)))]
    covered = np.zeros(ink.shape, dtype=bool)
    reach = max(1, round(0.8 * pitch))
    dots = []
    for row, column in left:
        if not covered[row, column]:
            dots.append((row, column))
            covered[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1] = True
    return np.array(dots, dtype=np.int64).reshape(-1, 2)


def _glyph(char: str, dots: Points, dot: float, gap: float) -> Glyph:
    if not len(dots):
        return Glyph(char, advance=0.5, stroke=dot)
    low, high = dots.min(axis=0), dots.max(axis=0)
    across = float(high[0] - low[0])
    up = dots[:, 1] * (1 - dot) / max(1.0, float(high[1])) + dot / 2  # the ink reaches from 0 to 1
    right = dots[:, 0] - low[0] + dot / 2 + gap / 2
    return Glyph(
        char, strokes=tuple(np.column_stack([right, up])[:, None]), advance=across + dot + gap, stroke=dot
    )
