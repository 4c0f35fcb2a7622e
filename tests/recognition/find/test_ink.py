"""A line laid on its ink, against where characters were stamped."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from glyphs.stamping.layouts import Layout
from glyphs.stamping.stamp import StampedPart, stamp_line
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.maps import HeightMap
from recognition.find.ink import on_ink
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import heights_view

HEIGHT_MM = 5.0


def stamped(radius_mm: float | None = None) -> StampedPart:
    font = load_font("gothic")
    return stamp_line(
        "KB407251",
        font,
        default_die(HEIGHT_MM, font=font),
        height_mm=HEIGHT_MM,
        pitch_mm=HEIGHT_MM / 30,
        layout=None if radius_mm is None else Layout(radius_mm=radius_mm),
        variation=StampingVariation.none(),
        rng=np.random.default_rng(0),
    )


def middles_of(part: StampedPart) -> NDArray[np.float64]:
    return np.array([((x0 + x1) / 2, (y0 + y1) / 2) for x0, y0, x1, y1 in part.boxes_mm])


def columns_of(line: TextLine, middles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of middles, on a level line's strip."""
    along = (middles[:, 0] - line.centre_mm[0, 0]) / line.height_mm
    return np.asarray((along + MARGIN) * HEIGHT_ROWS - 0.5)


def level_line(middles: NDArray[np.float64], y_mm: float, height_mm: float = HEIGHT_MM) -> TextLine:
    x0, x1 = middles[0, 0] - 0.4 * HEIGHT_MM, middles[-1, 0] + 0.4 * HEIGHT_MM
    return TextLine(np.array([(x0, y_mm), (x1, y_mm)]), height_mm)


def farthest_heights(line: TextLine, middles: NDArray[np.float64]) -> float:
    """From a line to the middles of characters, at most."""
    lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line.centre_mm, axis=0), axis=1))]
    at = np.linspace(0.0, lengths[-1], 400)
    curve = np.stack([np.interp(at, lengths, line.centre_mm[:, k]) for k in (0, 1)], axis=1)
    return float(np.linalg.norm(middles[:, None] - curve, axis=2).min(axis=1).max()) / HEIGHT_MM


@pytest.mark.parametrize("radius_mm", [30.0, -40.0])
def test_a_straight_line_across_an_arc_is_bent_onto_it(radius_mm: float) -> None:
    part = stamped(radius_mm)
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(middles[:, 1].mean()))
    assert farthest_heights(line, middles) > 0.3
    laid, *_ = on_ink(view, line, columns_of(line, middles))
    assert farthest_heights(laid, middles) < 0.2


def test_a_line_beside_its_characters_is_moved_onto_them_and_stays_straight() -> None:
    part = stamped()
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(np.median(middles[:, 1])) + 0.3 * HEIGHT_MM)
    laid, *_ = on_ink(view, line, columns_of(line, middles), height_known=True)
    assert len(laid.centre_mm) == 2
    assert farthest_heights(laid, middles) < 0.12


def test_a_line_that_was_found_too_high_is_offered_at_the_height_of_its_ink() -> None:
    part = stamped()
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(np.median(middles[:, 1])), 1.3 * HEIGHT_MM)
    as_high, lower = on_ink(view, line, columns_of(line, middles))
    assert as_high.height_mm == line.height_mm
    assert lower.height_mm == pytest.approx(HEIGHT_MM, rel=0.12)
    assert on_ink(view, line, columns_of(line, middles), height_known=True) == ()


def test_a_line_that_lies_on_its_ink_is_left_alone() -> None:
    part = stamped()
    view, middles = heights_view(part.height_map), middles_of(part)
    line = level_line(middles, float(np.median(middles[:, 1])))
    assert on_ink(view, line, columns_of(line, middles), height_known=True) == ()


def test_land_has_no_ink() -> None:
    bare = HeightMap(np.zeros((80, 400)), pitch_mm=0.1)
    line = TextLine(np.array([(2.0, 4.0), (38.0, 4.0)]), HEIGHT_MM)
    assert on_ink(heights_view(bare), line, np.array([30.0, 60.0, 90.0])) == ()
