"""What pixels say, summed over the ink of templates: maps of every prediction first, then stretches of them.

A template's ink predicts one of few levels at each pixel. So the ratio of each level is looked up once for every
pixel, and the sum over a template at neighbouring places is one over stretches of these maps::

    maps[k, level, r, c]        a pixel of ink that predicts `level` adds maps[k, level, r, c:c + places]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import ANY_ORDER, kernel
from recognition.experts.templates.correlation import Image, add_stretches

FEW = 16
"""Places along, up to which their sums are kept as one block."""


@kernel()
def _ratio_maps(table, felt, row, column, out):  # type: ignore[no-untyped-def]
    count, rows, cols = felt.shape
    _, n_levels, n_rows, n_cols = out.shape
    low, high = max(0, -column), min(n_cols, cols - column)
    for k in range(count):
        for r in range(max(0, -row), min(n_rows, rows - row)):
            line = felt[k, row + r]
            for level in range(n_levels):
                filled = out[k, level, r]
                for c in range(low, high):
                    filled[c] = table[level + line[column + c]]


def ratio_maps(
    table: Image, felt: NDArray[np.int32], n_levels: int, row: int, column: int, n_rows: int, n_cols: int
) -> Image:
    """(channels, levels, n_rows, n_cols) of the table from (row, column) of the image on; 0 beyond the image."""
    out = np.zeros((felt.shape[0], n_levels, n_rows, n_cols), dtype=np.float32)
    _ratio_maps(table, felt, row, column, out)
    return out


@kernel(allow=ANY_ORDER)
def _add_few(total, flat, at, down, n_ink):  # type: ignore[no-untyped-def]
    """total[j] = sum over the ink of flat[at + down + j]; of FEW columns, and four pixels at once."""
    for j in range(FEW):
        total[j] = np.float32(0.0)
    n = 0
    while n + 4 <= n_ink:
        p0, p1 = np.uint64(at[n] + down), np.uint64(at[n + 1] + down)
        p2, p3 = np.uint64(at[n + 2] + down), np.uint64(at[n + 3] + down)
        for k in range(FEW):
            i = np.uint64(k)
            total[i] += (flat[p0 + i] + flat[p1 + i]) + (flat[p2 + i] + flat[p3 + i])
        n += 4
    while n < n_ink:
        p0 = np.uint64(at[n] + down)
        for k in range(FEW):
            i = np.uint64(k)
            total[i] += flat[p0 + i]
        n += 1


@kernel()
def _sum_ratios(  # type: ignore[no-untyped-def]
    flat, shape, first_t, start, channel, row, column, level, down, right, at, ones, few, out
):
    """As `sum_ratios`; `at` and `few` are room."""
    n_levels, n_rows, n_cols = shape
    for t in range(out.shape[0]):
        first = start[first_t + t]
        n_ink = start[first_t + t + 1] - first
        for i in range(n_ink):
            n = first + i
            at[i] = ((channel[n] * n_levels + level[n]) * n_rows + row[n] + down) * n_cols + column[n] + right
        for i in range(out.shape[1]):
            total = out[t, i]
            if total.size <= FEW:
                _add_few(few, flat, at, i * n_cols, n_ink)
                for j in range(total.size):
                    total[j] = few[j]
                continue
            for j in range(total.size):
                total[j] = np.float32(0.0)
            add_stretches(total, np.int64(0), total.size, flat, at, ones, np.int64(0), n_ink)
            for k in range(n_ink):
                at[k] += n_cols


def sum_ratios(
    maps: Image,
    first_t: int,
    last_t: int,
    start: NDArray[np.int64],
    channel: NDArray[np.int32],
    row: NDArray[np.int32],
    column: NDArray[np.int32],
    level: NDArray[np.int32],
    down: int,
    right: int,
    out: Image,
) -> None:
    """out[t, i, j] = sum over the ink n of t of maps[channel, level, row + down + i, column + right + j]."""
    most = int(np.diff(start[first_t : last_t + 1]).max(initial=0))
    _sum_ratios(
        maps.ravel(), maps.shape[1:], first_t, start, channel, row, column, level, down, right,
        np.empty(most, dtype=np.int64), np.ones(most, dtype=np.float32), np.empty(FEW, dtype=np.float32), out,
    )  # fmt: skip
