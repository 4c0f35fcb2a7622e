"""The exemplars of a learned font: a row a character, those set aside in red."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from pipeline.reading.enrolment import SetAside, exemplar_places

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from glyphs.fonts.glyph import Font
    from glyphs.stamping.database import Exemplar

_USED, _ASIDE, _SHAPE = "0.6", "#c62828", "#1b4e91"


def exemplars_figure(
    font: Font, exemplars: Sequence[Exemplar], set_aside: Collection[SetAside], *, most_columns: int = 12
) -> Figure:
    """Draw the shape of each character and the exemplars behind it.

    Args:
        font: the learned font.
        exemplars: those of the font that have a relief, in order of enrolment.
        set_aside: those of them that are not used; they are drawn first.
        most_columns: exemplars of a character that are drawn.
    """
    rows: dict[str, list[tuple[Exemplar, SetAside]]] = {}
    for one, place in zip(exemplars, exemplar_places(exemplars), strict=True):
        rows.setdefault(one.char, []).append((one, SetAside(one.char, one.part, place)))
    for row in rows.values():
        row.sort(key=lambda pair: pair[1] not in set_aside)
    columns = 1 + min(most_columns, max(map(len, rows.values())))
    figure = Figure(figsize=(0.9 * columns + 0.6, 1.05 * len(rows) + 0.6), dpi=100, layout="constrained")
    title = f"{font.name}: shape (blue), exemplars used (grey), set aside (red)"
    figure.suptitle(title, fontsize=9, x=0.01, ha="left")
    axes = figure.subplots(len(rows), columns, squeeze=False)
    for ax in axes.flat:
        ax.set_axis_off()
    for line, (char, row) in zip(axes, sorted(rows.items()), strict=True):
        glyph = font.glyphs.get(char)
        if glyph is not None and glyph.relief is not None:
            _draw(line[0], glyph.relief, char, _SHAPE)
        for ax, (one, key) in zip(line[1:], row, strict=False):
            assert one.relief is not None
            _draw(ax, one.relief, f"{one.part}: {key.place}", _ASIDE if key in set_aside else _USED)
    return figure


def _draw(ax: Axes, relief: NDArray[np.float32], title: str, colour: str) -> None:
    deepest = -float(np.nanmin(relief, initial=-1e-3))
    ax.imshow(relief, cmap="gray", vmin=-deepest, vmax=0.25 * deepest, interpolation="nearest")
    ax.set_axis_on()
    ax.set_xticks([])
    ax.set_yticks([])
    ax.set_title(title, fontsize=6, color=colour if colour == _ASIDE else "black")
    for side in ax.spines.values():
        side.set_color(colour)
        side.set_linewidth(2.0)
