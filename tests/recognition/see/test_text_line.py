"""Where a line of text stands: straight, turned, bent, upside down."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine

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
