"""What pixels say, summed over the ink of templates: maps of every prediction first, then stretches of them.

A template's ink predicts one of few levels at each pixel. So the ratio of each level is looked up once for every
pixel, and the sum over a template at neighbouring places is one over stretches of these maps::

    maps[k, level, r, c]        a pixel of ink that predicts `level` adds maps[k, level, r, c:c + places]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from recognition.correlation import add_stretches

FEW = 16
"""Places along, up to which their sums are kept as one block."""


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def ratio_maps(table, felt, n_levels, row, column, n_rows, n_cols):  # type: ignore[no-untyped-def]
    """(channels, levels, n_rows, n_cols) of the table from (row, column) of the image on; 0 beyond the image."""
    count, rows, cols = felt.shape
    out = np.zeros((count, n_levels, n_rows, n_cols), dtype=np.float32)
    low, high = max(0, -column), min(n_cols, cols - column)
    for k in range(count):
        for r in range(max(0, -row), min(n_rows, rows - row)):
            line = felt[k, row + r]
            for level in range(n_levels):
                filled, part = out[k, level, r], table[level:]
                for c in range(low, high):
                    filled[c] = part[line[column + c]]
    return out


@njit(cache=True, fastmath={"contract", "reassoc"})  # type: ignore[untyped-decorator,unused-ignore]
def _add_blocks(blocks, flat, at, n_ink, n_cols):  # type: ignore[no-untyped-def]
    """blocks[i, j] += sum over the ink of flat[at + i * n_cols + j]; of FEW columns, and four pixels at once."""
    for i in range(blocks.shape[0]):
        total, down = blocks[i], i * n_cols
        n = 0
        while n + 4 <= n_ink:
            p0, p1, p2, p3 = at[n] + down, at[n + 1] + down, at[n + 2] + down, at[n + 3] + down
            f0, f1, f2, f3 = (
                flat[p0 : p0 + FEW],
                flat[p1 : p1 + FEW],
                flat[p2 : p2 + FEW],
                flat[p3 : p3 + FEW],
            )
            for j in range(FEW):
                total[j] += (f0[j] + f1[j]) + (f2[j] + f3[j])
            n += 4
        while n < n_ink:
            p0 = at[n] + down
            f0 = flat[p0 : p0 + FEW]
            for j in range(FEW):
                total[j] += f0[j]
            n += 1


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def sum_ratios(maps, first_t, last_t, start, channel, row, column, level, down, right, out):  # type: ignore[no-untyped-def]
    """out[t, i, j] = sum over the ink n of t of maps[channel, level, row + down + i, column + right + j]."""
    _, n_levels, n_rows, n_cols = maps.shape
    flat = maps.ravel()
    most = 0
    for t in range(first_t, last_t):
        most = max(most, start[t + 1] - start[t])
    at, ones = np.empty(most, dtype=np.int64), np.ones(most, dtype=np.float32)
    block = np.empty((out.shape[1], FEW), dtype=np.float32)
    for t in range(first_t, last_t):
        n_ink = start[t + 1] - start[t]
        for i in range(n_ink):
            n = start[t] + i
            at[i] = ((channel[n] * n_levels + level[n]) * n_rows + row[n] + down) * n_cols + column[n] + right
        if out.shape[2] > FEW:
            for i in range(out.shape[1]):
                total = out[t - first_t, i]
                total[:] = np.float32(0.0)
                add_stretches(total, flat[i * n_cols :], at, ones, 0, n_ink)
            continue
        block[:] = np.float32(0.0)
        _add_blocks(block, flat, at, n_ink, n_cols)
        out[t - first_t] = block[:, : out.shape[2]]
