"""The plane of the land beside what lies on it, and look-ups beyond the rim of a map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.marks.depth import across, robust_plane

seeds = st.integers(0, 2**32 - 1)


def test_places_off_the_map_are_moved_onto_its_rim() -> None:
    depth = np.arange(20.0).reshape(4, 5)
    depth[1, 1] = np.nan
    points = np.array([(-3.0, 2.0), (9.0, 9.0), (0.5, 0.5)])
    below = across(depth, points, np.zeros((3, 2)), np.zeros(1), np.zeros(3))
    np.testing.assert_allclose(below, [[2.0, 19.0, np.nan]])


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_the_plane_is_that_of_the_land(seed: int) -> None:
    rng = np.random.default_rng(seed)
    row, col = rng.uniform(-30, 30, 200), rng.uniform(-30, 30, 200)
    level = 0.3 + 0.01 * row - 0.02 * col + rng.normal(0, 0.01, 200)
    level[:20] += 1.0
    # a tenth of the samples lies off by a hundred times the noise, and moves nothing
    np.testing.assert_allclose(robust_plane(level, row, col), (0.3, 0.01, -0.02), atol=0.005)


def test_land_in_a_line_has_the_least_slopes() -> None:
    col = np.linspace(-10, 10, 50)
    level = 0.1 * col + np.random.default_rng(1).normal(0, 0.001, 50)
    np.testing.assert_allclose(robust_plane(level, np.zeros(50), col), (0.0, 0.0, 0.1), atol=0.001)
    # along (2, 1) the least slopes that rise by 0.1 are 0.1 (2, 1) / 5
    np.testing.assert_allclose(robust_plane(level, 2.0 * col, col), (0.0, 0.04, 0.02), atol=0.001)


def test_an_even_land_is_its_level() -> None:
    assert robust_plane(np.full(40, 0.7), np.arange(40.0), np.zeros(40)) == pytest.approx((0.7, 0.0, 0.0))
