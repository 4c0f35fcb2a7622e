"""Sketches of marks as parts for any soil."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glyphs.fonts.outlines import load_font
from glyphs.fonts.serials import random_text
from glyphs.part import Part
from glyphs.sketch import ROWS_PER_HEIGHT, sketch
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap

_LAND = 0.5
"""Land added above and below a sketch to be read as a whole part, character heights."""


def sketch_part(
    format: str, *, font: str | Path, height_mm: float, soiling: Soiling, seed: Sequence[int]
) -> Part:
    """Sketch a serial as a part; dirt and photograph are those of stamped parts.

    Args:
        format: of the serial, which is drawn.
        font: built-in name or font file.
        height_mm: character height.
        soiling: dirt on the part.
        seed: the same seed gives the same part.

    Raises:
        FontError: no such font, or a character that it lacks.
        FormatError: a format that no serial can obey.
    """
    key = tuple(int(number) for number in seed)
    rng = np.random.default_rng(key)
    letters, text = load_font(font), random_text(format, rng=rng)
    made = sketch(letters, text, rng, clean=True)
    land, mm = round(_LAND * ROWS_PER_HEIGHT), height_mm / ROWS_PER_HEIGHT
    surface = np.pad(made.surface, ((land, land), (0, 0)), mode="edge") * np.float32(height_mm)
    boxes = tuple((x0 * mm, (y0 + land) * mm, x1 * mm, (y1 + land) * mm) for x0, y0, x1, y1 in made.boxes)
    stamped = StampedPart(HeightMap(surface, mm), text, height_mm, boxes, letters.name)
    return Part(stamped, soiling, key)
