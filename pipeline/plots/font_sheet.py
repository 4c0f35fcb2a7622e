"""A specimen sheet: every letter of a font as ink."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, signed_distance
from glyphs.fonts.outlines import SERIAL_CHARACTERS
from glyphs.stamping.die import die_glyph
from glyphs.stamping.faces import Die, default_die
from pipeline.plots.pictures import styled


@styled
def sheet_figure(fonts: Sequence[Font], *, height_mm: float = 5.0) -> Figure:
    """Draw the sheet.

    Args:
        fonts: at least one.
        height_mm: character height, which sets the width of strokes.

    Raises:
        ValueError: no font given.
    """
    if not fonts:
        raise ValueError("a specimen sheet needs at least one font")
    figure = Figure(figsize=(11.0, 1.8 * len(fonts)), dpi=100)
    for font, axes in zip(fonts, figure.subplots(len(fonts), 1, squeeze=False).flat, strict=True):
        die = default_die(height_mm, font=font)
        axes.contourf(*_ink(font, die, height_mm), levels=[-1e3, 0.0], colors=["black"])
        axes.set_title(f"{font.name}  ({font.source})")
        axes.set_aspect("equal", anchor="W")
        axes.set_axis_off()
    return figure


def _ink(
    font: Font, die: Die, height_mm: float, *, step: float = 0.02
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
    """x, y and signed distance of A-Z and 0-9 in two lines, a sample every `step`; all in cap heights."""
    shapes = [
        [die_glyph(font.glyphs[c], die, height_mm=height_mm) for c in line if c in font.glyphs]
        for line in (SERIAL_CHARACTERS[:26], SERIAL_CHARACTERS[26:] + "-./")
    ]
    x = np.arange(0.0, max(sum(s.advance for s in row) for row in shapes) + 0.2, step)
    y = np.arange(-0.35, 2.95, step)
    distance = np.full((y.size, x.size), 9.0, dtype=np.float32)
    for row, base in zip(shapes, (1.7, 0.0), strict=True):
        origin = 0.1
        rows = np.flatnonzero((y > base - 0.5) & (y < base + 1.5))
        for shape in row:
            here = np.flatnonzero((x > origin - 0.3) & (x < origin + shape.advance + 0.3))
            at = (x[None, here] - origin, y[rows, None] - base)
            window = np.ix_(rows, here)
            found = signed_distance(shape, *at, stroke=die.stroke_mm / height_mm)
            distance[window] = np.minimum(distance[window], found)
            origin += shape.advance
    return x, y, distance
