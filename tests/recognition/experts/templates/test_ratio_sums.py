"""Sums of what pixels say against look-ups one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.experts.templates.ratio_sums import FEW, ratio_maps, sum_ratios

LEVELS = 5


def looked_up(table, felt, level, start, channel, row, column, rows, cols):
    """(T, rows, cols) one pixel of ink at a time; nothing beyond the image."""
    out = np.zeros((start.size - 1, rows.size, cols.size))
    for t in range(start.size - 1):
        for n in range(start[t], start[t + 1]):
            for i, r in enumerate(rows + row[n]):
                for j, c in enumerate(cols + column[n]):
                    if 0 <= r < felt.shape[1] and 0 <= c < felt.shape[2]:
                        out[t, i, j] += table[felt[channel[n], r, c] + level[n]]
    return out


@pytest.mark.parametrize("places", [1, 7, FEW, FEW + 1, 40])
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), down=st.integers(-4, 9), right=st.integers(-6, 30))
def test_sums_are_look_ups_one_by_one(seed: int, places: int, down: int, right: int) -> None:
    rng = np.random.default_rng(seed)
    table = rng.normal(size=60).astype(np.float32)
    felt = (rng.integers(0, 12, (2, 10, 30)) * LEVELS).astype(np.int32)
    n = 40
    start = np.array([0, 15, 15, n])
    channel, level = rng.integers(0, 2, n).astype(np.int32), rng.integers(0, LEVELS, n).astype(np.int32)
    row, column = (rng.integers(-3, 4, n).astype(np.int32) for _ in range(2))
    rows, cols = np.arange(down, down + 3), np.arange(right, right + places)
    maps = ratio_maps(table, felt, LEVELS, down - 3, right - 3, 3 + 6, places + 6 + FEW)
    expected = looked_up(table, felt, level, start, channel, row, column, rows, cols)
    out = np.empty(expected.shape, dtype=np.float32)
    sum_ratios(maps, 0, 3, start, channel, row, column, level, 3, 3, out)
    # some dozen terms of about 1 in single precision
    np.testing.assert_allclose(out, expected, atol=1e-4)
    alone = np.empty((1, *expected.shape[1:]), dtype=np.float32)
    sum_ratios(maps, 2, 3, start, channel, row, column, level, 3, 3, alone)
    np.testing.assert_array_equal(alone[0], out[2])
