"""Lines and arcs through middles of characters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.see.curves import arc_through, straight_through

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
    assert curve is not None
    np.testing.assert_allclose(np.linalg.norm(curve - (1.0, 2.0), axis=1), radius, rtol=1e-9)
    # from left to right, beyond the points by what was asked for along the arc
    assert np.all(np.diff(curve[:, 0]) > 0.0) or radius < 10.0
    ends = [np.arctan2(x - 1.0, side * (y - 2.0)) for x, y in curve[[0, -1]]]
    assert ends == pytest.approx([t[0] - BEFORE / radius, t[-1] + AFTER / radius])
    # the other way round it is read the other way round
    back = arc_through(points[::-1], height=2.0, before=AFTER, after=BEFORE)
    assert back is not None
    np.testing.assert_allclose(back[::-1], curve, atol=1e-9)


def test_what_hardly_bends_is_no_arc() -> None:
    t = np.linspace(-0.05, 0.05, 9)
    slight = 100.0 * np.stack([np.sin(t), 1.0 - np.cos(t)], axis=1)  # sags by 0.125
    assert arc_through(slight, height=5.0, before=0.0, after=0.0) is None
    assert arc_through(slight, height=1.0, before=0.0, after=0.0) is not None
    # three points lie on a circle whatever they are
    assert arc_through(slight[::4], height=1.0, before=0.0, after=0.0) is None
