"""The picture of a part that was read: its words stand within it, and panels fill it."""

from __future__ import annotations

import matplotlib as mpl
import pytest

from glyphs import stamp
from recognition import Reader

mpl.use("Agg")


@pytest.mark.parametrize(("text", "format"), [("7", "9"), ("KX407251", "AA999999")])
def test_words_are_not_cut_and_panels_fill_the_width(text: str, format: str) -> None:
    part = stamp(text, fonts="gothic", height_mm=4.0, seed=3)
    figure = (
        Reader(format=format, fonts=["gothic"], height_mm=4.0, experts=("network",))
        .read(part.height_map)
        .plot(title="part-000")
    )
    figure.draw_without_rendering()
    whole = figure.bbox
    for axes in figure.axes:
        for title in (axes.title, axes._left_title):
            words = title.get_window_extent()
            assert not title.get_text() or whole.x0 <= words.x0 <= words.x1 <= whole.x1, title.get_text()
    pictures = [axes.get_window_extent() for axes in figure.axes if axes.images]
    widest_row = max(
        sum(p.width for p in pictures if abs(p.y0 - row.y0) < 0.1 * row.height) for row in pictures
    )
    assert widest_row > 0.4 * whole.width
