"""The exemplars of a learned font: a row a character, those set aside in red."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from pipeline.plots.pictures import styled

if TYPE_CHECKING:
    from glyphs.fonts.glyph import Font
    from pipeline.formats.glyph_database import Exemplar

_USED, _ASIDE, _SHAPE = "0.6", "#c62828", "#1b4e91"


@styled
def exemplars_figure(
    font: Font, exemplars: Sequence[Exemplar], set_aside: Collection[Exemplar], *, most_columns: int = 12
) -> Figure:
    """Draw the shape of each character and the exemplars behind it.

    Args:
        font: the learned font.
        exemplars: those of the font that have a relief, in order of enrolment.
        set_aside: those of them that are not used; they are drawn first.
        most_columns: exemplars of a character that are drawn.
    """
    rows: dict[str, list[Exemplar]] = {}
    for one in exemplars:
        rows.setdefault(one.char, []).append(one)
    aside = {(one.evidence, one.place) for one in set_aside}
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
        row.sort(key=lambda one: (one.evidence, one.place) not in aside)
        for axes, one in zip(islice(line, 1, None), row, strict=False):
            colour = _ASIDE if (one.evidence, one.place) in aside else _USED
            shown.append((axes, one.relief, f"{one.part}: {one.place}", colour))
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
