"""Where a line of text stands: straight, bent, upside down, along middles of characters, and its boxes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from recognition.see.curves import arc_through, straight_through
from recognition.see.places import boxes_of
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine

# --------------------------------------------------------------------------------------------------------- text line

EXACT = 1e-9
MIDDLE = (ROWS - 1) / 2


def along(line: TextLine, columns: NDArray[np.float64], row: float = MIDDLE) -> NDArray[np.float64]:
    """(columns, 2) x, y of places of one row of its strip."""
    return line.places_mm(columns, np.full(columns.size, row))


def arc(radius_mm: float, *, upper: bool) -> TextLine:
    """Half a circle about (0, 0): over the top clockwise, or through the bottom against the clock."""
    t = np.linspace(np.pi, 0.0, 181)
    side = -1.0 if upper else 1.0  # y runs down
    return TextLine(radius_mm * np.stack([np.cos(t), side * np.sin(t)], axis=1), 2.0)


@pytest.mark.parametrize(
    ("points", "height_mm", "message"),
    [
        ([(0.0, 0.0)], 2.0, "two at least"),
        ([0.0, 1.0], 2.0, "two at least"),
        ([(0.0, 0.0, 0.0)] * 2, 2.0, "two at least"),
        ([(0.0, 0.0), (np.nan, 1.0)], 2.0, "finite"),
        ([(0.0, 0.0), (1.0, 0.0)], 0.0, "height_mm"),
        ([(0.0, 0.0), (1.0, 0.0)], np.inf, "height_mm"),
        ([(1.0, 1.0), (1.0, 1.0)], 2.0, "no length"),
    ],
)
def test_what_is_no_line_is_refused(points: list[object], height_mm: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TextLine(np.array(points), height_mm)


@given(
    st.floats(-50, 50),
    st.floats(-50, 50),
    st.floats(0.5, 40.0),
    st.floats(0.5, 10.0),
    st.floats(-179.0, 180.0),
)
def test_a_straight_line_is_what_was_asked_for(
    x: float, y: float, length: float, height: float, turned: float
) -> None:
    line = TextLine.straight(x, y, length_mm=length, height_mm=height, turned_deg=turned)
    assert line.length_mm == pytest.approx(length)
    assert line.turned_deg == pytest.approx(turned, abs=1e-6)
    assert (line.reversed.turned_deg - turned) % 360.0 == pytest.approx(180.0, abs=1e-6)
    np.testing.assert_array_equal(line.reversed.reversed.centre_mm, line.centre_mm)
    # its strip holds it and a margin on either side, to a column
    wide = line.columns() / HEIGHT_ROWS - 2 * MARGIN
    assert max(8, length / height * HEIGHT_ROWS) <= max(8, wide * HEIGHT_ROWS) + EXACT
    assert line.columns() <= max(8, (length / height + 2 * MARGIN) * HEIGHT_ROWS + 1)


@given(st.floats(-179.0, 180.0), st.floats(0.5, 10.0))
def test_down_is_clockwise_of_along(turned: float, height: float) -> None:
    line = TextLine.straight(3.0, 4.0, length_mm=7.0, height_mm=height, turned_deg=turned)
    first = along(line, np.array([MARGIN * HEIGHT_ROWS - 0.5]))
    np.testing.assert_allclose(first[0], (3.0, 4.0), atol=1e-9)
    right, down = (
        line.places_mm(np.array([column]), np.array([row]))[0]
        for column, row in (
            (MARGIN * HEIGHT_ROWS - 0.5 + HEIGHT_ROWS, MIDDLE),
            (first_column(), MIDDLE + HEIGHT_ROWS),
        )
    )
    cos, sin = np.cos(np.radians(turned)), np.sin(np.radians(turned))
    np.testing.assert_allclose(right - first[0], (height * cos, height * sin), atol=1e-8)
    np.testing.assert_allclose(down - first[0], (-height * sin, height * cos), atol=1e-8)


def first_column() -> float:
    return MARGIN * HEIGHT_ROWS - 0.5


@pytest.mark.parametrize("upper", [True, False])
@pytest.mark.parametrize("down_heights", [-0.5, 0.0, 0.5])
def test_rows_of_an_arc_are_arcs(upper: bool, down_heights: float) -> None:
    radius = 20.0
    line = arc(radius, upper=upper)
    assert line.length_mm == pytest.approx(np.pi * radius, rel=1e-4)
    columns = np.linspace(first_column(), line.columns() - 1 - first_column(), 90)
    places = along(line, columns, MIDDLE + down_heights * HEIGHT_ROWS)
    # over the top the feet of characters point to the middle, through the bottom away from it
    inward = 1.0 if upper else -1.0
    expected = radius - inward * down_heights * line.height_mm
    # polygon of a degree a piece: its middle lies 0.004 % of the radius inside, and directions turn along with it
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), expected, rtol=2e-4)
    if down_heights == 0.0:
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(places, axis=0), axis=1), line.length_mm / 89, rtol=0.02
        )


def test_a_curve_goes_on_straight_beyond_its_ends() -> None:
    line = arc(20.0, upper=True)
    before = along(line, first_column() - np.array([0.0, 10.0, 20.0]))
    # from its left end an arc over the top begins upwards
    np.testing.assert_allclose(np.diff(before, axis=0)[0], np.diff(before, axis=0)[1], atol=1e-9)
    assert np.diff(before[:, 1])[0] == pytest.approx(10.0 * line.height_mm / HEIGHT_ROWS, rel=1e-3)


def test_points_that_stand_twice_do_no_harm() -> None:
    plain = TextLine(np.array([(0.0, 0.0), (4.0, 0.0), (9.0, 0.0)]), 2.0)
    twice = TextLine(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (9.0, 0.0)]), 2.0)
    columns = np.arange(0.0, 100.0, 7.0)
    np.testing.assert_allclose(along(twice, columns), along(plain, columns), atol=EXACT)


def test_a_grid_is_its_places() -> None:
    line = arc(20.0, upper=False)
    columns, rows = np.arange(0.0, 90.0, 8.0), np.arange(-5.0, 50.0, 11.0)
    u, v = np.meshgrid(columns, rows)
    grid = line.places_mm(columns, rows[:, None])
    assert grid.shape == (rows.size, columns.size, 2)
    np.testing.assert_allclose(grid, line.places_mm(u.ravel(), v.ravel()).reshape(*u.shape, 2), atol=EXACT)


# ------------------------------------------------------------------------------------------------------------ curves

BEFORE, AFTER = 1.0, 2.0


@given(st.floats(-180.0, 180.0), st.integers(2, 12))
def test_points_in_a_row_give_the_line_through_them(turned: float, count: int) -> None:
    along = np.array([np.cos(np.radians(turned)), np.sin(np.radians(turned))])
    points = np.array([3.0, -2.0]) + np.arange(count)[:, None] * 1.5 * along
    curve = straight_through(points, before=BEFORE, after=AFTER)
    expected = [points[0] - BEFORE * along, points[-1] + AFTER * along]
    np.testing.assert_allclose(curve, expected, atol=1e-6)


def test_one_point_gives_a_level_line() -> None:
    curve = straight_through(np.array([(3.0, 4.0)]), before=BEFORE, after=AFTER)
    np.testing.assert_allclose(curve, [(2.0, 4.0), (5.0, 4.0)])


@pytest.mark.parametrize("upper", [True, False])
@pytest.mark.parametrize("radius", [6.0, 15.0])
def test_points_on_a_circle_give_an_arc_of_it(radius: float, upper: bool) -> None:
    t = np.radians(np.linspace(-50.0, 50.0, 9))
    side = -1.0 if upper else 1.0
    points = np.array([1.0, 2.0]) + radius * np.stack([np.sin(t), side * np.cos(t)], axis=1)
    curve = arc_through(points, height=2.0, before=BEFORE, after=AFTER)
    np.testing.assert_allclose(np.linalg.norm(curve - (1.0, 2.0), axis=1), radius, rtol=1e-9)
    # from left to right, beyond the points by what was asked for along the arc
    assert np.all(np.diff(curve[:, 0]) > 0.0) or radius < 10.0
    ends = [np.arctan2(x - 1.0, side * (y - 2.0)) for x, y in curve[[0, -1]]]
    assert ends == pytest.approx([t[0] - BEFORE / radius, t[-1] + AFTER / radius])
    # the other way round it is read the other way round
    back = arc_through(points[::-1], height=2.0, before=AFTER, after=BEFORE)
    np.testing.assert_allclose(back[::-1], curve, atol=1e-9)


def test_what_hardly_bends_is_no_arc() -> None:
    t = np.linspace(-0.05, 0.05, 9)
    slight = 100.0 * np.stack([np.sin(t), 1.0 - np.cos(t)], axis=1)  # sags by 0.125
    assert arc_through(slight, height=5.0, before=0.0, after=0.0) is None
    assert arc_through(slight, height=1.0, before=0.0, after=0.0) is not None
    # three points lie on a circle whatever they are
    assert arc_through(slight[::4], height=1.0, before=0.0, after=0.0) is None


# ------------------------------------------------------------------------------------------------------------ places

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
