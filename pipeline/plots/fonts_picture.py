"""Fonts as pictures: specimen sheets, and the exemplars of a learned font."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, signed_distance
from glyphs.fonts.outlines import SERIAL_CHARACTERS
from glyphs.stamping.die import die_glyph
from glyphs.stamping.faces import Die, default_die
from pipeline.plots.pictures import styled

if TYPE_CHECKING:
    from pipeline.formats.glyph_database import Exemplar

_USED, _ASIDE, _SHAPE = "0.6", "#c62828", "#1b4e91"


@styled
def sheet_figure(fonts: Sequence[Font], *, height_mm: float = 5.0) -> Figure:
    """Draw the sheet of at least one font; the character height sets the width of strokes."""
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
    """x, y and signed distance of A-Z and 0-9 in two lines, one sample per `step`; all in cap heights."""
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
            places = (x[None, here] - origin, y[rows, None] - base)
            window = np.ix_(rows, here)
            ink = signed_distance(shape, *places, stroke=die.stroke_mm / height_mm)
            distance[window] = np.minimum(distance[window], ink)
            origin += shape.advance
    return x, y, distance


@styled
def exemplars_figure(
    font: Font, exemplars: Sequence[Exemplar], set_aside: Collection[Exemplar], *, most_columns: int = 12
) -> Figure:
    """Draw each character of a learned font and the exemplars behind it, in order of enrolment, unused ones first."""
    rows: dict[str, list[Exemplar]] = {}
    for exemplar in exemplars:
        rows.setdefault(exemplar.char, []).append(exemplar)
    aside = {(exemplar.evidence, exemplar.place) for exemplar in set_aside}
    columns = 1 + min(most_columns, max(map(len, rows.values())))
    figure = Figure(figsize=(0.9 * columns + 0.6, 1.05 * len(rows) + 0.6), dpi=100)
    figure.suptitle(
        f"{font.name}: shape (blue), exemplars used (grey), set aside (red)", fontsize=9, x=0.01, ha="left"
    )
    grid = figure.subplots(len(rows), columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for line, (char, row) in zip(grid, sorted(rows.items()), strict=True):
        glyph = font.glyphs.get(char)
        shown = [(line[0], glyph.relief if glyph is not None else None, char, _SHAPE)]
        row.sort(key=lambda exemplar: (exemplar.evidence, exemplar.place) not in aside)
        for axes, exemplar in zip(islice(line, 1, None), row, strict=False):
            colour = _ASIDE if (exemplar.evidence, exemplar.place) in aside else _USED
            shown.append((axes, exemplar.relief, f"{exemplar.part}: {exemplar.place}", colour))
        for axes, relief, title, colour in shown:
            if relief is None:
                continue
            deepest = -float(np.nanmin(relief, initial=-1e-3))
            axes.imshow(relief, cmap="gray", vmin=-deepest, vmax=0.25 * deepest, interpolation="nearest")
            axes.set_axis_on()
            axes.set(xticks=[], yticks=[])
            axes.set_title(title, fontsize=6, loc="center", color=colour if colour == _ASIDE else "black")
            axes.spines[:].set(color=colour, linewidth=2.0)
    return figure
