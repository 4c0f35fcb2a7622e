"""Boxes of characters from the columns of a strip."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.see.places import boxes_of
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine

MIDDLE = 0.5 * (ROWS - 1)
"""The row in the middle of a strip."""
FIRST = MARGIN * HEIGHT_ROWS - 0.5
"""The column at which a line begins."""


def columns(*heights: float) -> np.ndarray:
    return FIRST + np.array(heights) * HEIGHT_ROWS


def test_boxes_reach_half_way_to_their_neighbours() -> None:
    line = TextLine.straight(2.0, 10.0, length_mm=20.0, height_mm=5.0)
    boxes = boxes_of(line, columns(0.5, 1.1, 3.0))
    # a line of 5 mm from 2 mm on: middles at 4.5, 7.5 and 17 mm; no box is wider than 0.42 heights to a side
    edges = [(b.x0_mm, b.x1_mm) for b in boxes]
    np.testing.assert_allclose(edges, [(2.4, 6.0), (6.0, 9.6), (14.9, 19.1)], atol=1e-6)
    for box in boxes:
        assert (box.y0_mm, box.y1_mm) == pytest.approx((7.5, 12.5))


@pytest.mark.parametrize("turned_deg", [90.0, 180.0, -90.0, 30.0])
def test_boxes_of_a_turned_line_hold_its_characters(turned_deg: float) -> None:
    line = TextLine.straight(50.0, 50.0, length_mm=20.0, height_mm=5.0, turned_deg=turned_deg)
    at = columns(0.5, 1.3, 2.1)
    for box, (x, y) in zip(boxes_of(line, at), line.places_mm(at, np.array(MIDDLE)), strict=True):
        assert box.x0_mm < x < box.x1_mm
        assert box.y0_mm < y < box.y1_mm
        assert (box.x0_mm + box.x1_mm) / 2 == pytest.approx(x, abs=0.3)


def test_one_character_and_none() -> None:
    line = TextLine.straight(0.0, 10.0, length_mm=5.0, height_mm=5.0)
    (box,) = boxes_of(line, columns(0.5))
    assert (box.x0_mm, box.x1_mm) == pytest.approx((2.5 - 2.1, 2.5 + 2.1))
    assert boxes_of(line, np.zeros(0)) == ()


def test_columns_that_run_back_make_no_box_that_does() -> None:
    line = TextLine.straight(0.0, 10.0, length_mm=20.0, height_mm=5.0)
    boxes = boxes_of(line, columns(0.5, 0.45, 1.3))
    assert all(b.x0_mm <= b.x1_mm for b in boxes)
