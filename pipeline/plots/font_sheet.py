"""A specimen sheet: every letter of a font as ink, and some of them as stamped relief."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, signed_distance
from glyphs.fonts.outlines import SERIAL_CHARACTERS
from glyphs.stamping.die import die_glyph, ideal_relief
from glyphs.stamping.faces import Die, Face, default_die
from pipeline.plots.pictures import styled


@styled
def sheet_figure(fonts: Sequence[Font], *, die_face: Face = Face.FLAT, height_mm: float = 5.0) -> Figure:
    """Draw the sheet.

    Args:
        fonts: at least one.
        die_face: face of the die that stamps the relief row (DOTTED falls back to FLAT for outlined fonts).
        height_mm: character height.

    Raises:
        ValueError: no font given.
    """
    if not fonts:
        raise ValueError("a specimen sheet needs at least one font")
    figure = Figure(figsize=(11.0, 2.9 * len(fonts)), dpi=100)
    grid = figure.subplots(2 * len(fonts), 1, height_ratios=[1.25, 1.0] * len(fonts))
    for font, ink, relief in zip(fonts, grid[::2], grid[1::2], strict=True):
        face = Face.FLAT if die_face is Face.DOTTED and font.stroke_ratio == 0.0 else die_face
        die = default_die(height_mm, font=font, face=face)
        ink.contourf(*_ink(font, die, height_mm), levels=[-1e3, 0.0], colors=["black"])
        ink.set_title(f"{font.name}  ({font.source})")
        ink.set_aspect("equal", anchor="W")
        ink.set_axis_off()
        picture, pitch_mm = _relief(font, die, height_mm), height_mm / 80
        extent = (0.0, picture.shape[1] * pitch_mm, 0.0, picture.shape[0] * pitch_mm)
        shown = relief.imshow(picture, cmap="viridis", extent=extent, interpolation="nearest")
        figure.colorbar(shown, ax=relief, fraction=0.02, pad=0.01, label=f"{face} mm")
        relief.set(xlabel="mm", anchor="W")  # the colour bar would move it
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


def _relief(font: Font, die: Die, height_mm: float, *, text: str = "AR38SQ5W") -> NDArray[np.float32]:
    """(rows, cols) a few characters stamped faultlessly, side by side, mm; 80 pixels a cap height."""
    stamp = partial(
        ideal_relief, die=die, height_mm=height_mm, pitch_mm=height_mm / 80, margin_mm=0.15 * height_mm
    )
    tiles = [stamp(font.glyphs[c]).height_map.z_mm for c in text if c in font.glyphs]
    rows = max(t.shape[0] for t in tiles)
    return np.hstack(
        [np.pad(t, (((rows - t.shape[0]) // 2, (rows - t.shape[0] + 1) // 2), (0, 0))) for t in tiles]
    )
