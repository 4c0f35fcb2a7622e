"""Correlations of all templates with one cell, over small shifts, turns and leans, from lists of ink.

The cell is cut out with room for the shifts, and its rows written out once for every column of the window, so that
one pixel of ink meets all its shifts in one stretch of memory::

    stack[c, k, r, j] = cut[k, r, c + j]        a pixel of ink at (k, r, c) meets stack[c, k, r:r + rows, :]

The shifts along are made up to a stretch that processors load at once.

A template's mean over the window, and its norm about it, come from sums by column that its lists keep.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import CONTRACTED, kernel
from recognition.experts.templates.correlation import LEAST_INK, add_stretches

ALIGNED = 8
"""Floats that a stretch is a multiple of."""


class CellInk(NamedTuple):
    """Templates as lists of ink, column by column.

    Attributes:
        start: (T, cols + 1) where the ink of each column begins in the lists.
        channel, row, column: (N,) of each pixel; row from the top of the window, column from the reference point.
        value: (N,) float32.
        total: (T, cols + 1, channels) sum over all columns before.
        square: (T, cols + 1) sum of squares over all columns before.
    """

    start: NDArray[np.int64]
    channel: NDArray[np.int64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    value: NDArray[np.float32]
    total: NDArray[np.float64]
    square: NDArray[np.float64]


def cell_ink(patches: NDArray[np.float32], half_rows: int) -> CellInk:
    """Lists of (T, channels, rows, cols) templates, of the rows within half_rows of the middle."""
    count, _, rows, cols = patches.shape
    window = patches[:, :, rows // 2 - half_rows : rows // 2 + half_rows + 1]
    least = LEAST_INK * float(np.abs(window).max(initial=0.0))
    by_column = np.ascontiguousarray(window.transpose(0, 3, 1, 2))
    t, c, k, r = np.nonzero(np.abs(by_column) > least)
    value = by_column[t, c, k, r]
    sums = np.zeros((count, cols + 1, patches.shape[1]))
    squares = np.zeros((count, cols + 1))
    np.add.at(sums, (t, c + 1, k), value)
    np.add.at(squares, (t, c + 1), value.astype(np.float64) ** 2)
    before = np.searchsorted(t * cols + c, np.arange(count * cols + 1))
    start = before[np.arange(count)[:, None] * cols + np.arange(cols + 1)]
    return CellInk(
        start=start.astype(np.int64),
        channel=k.astype(np.int64),
        row=r.astype(np.int64),
        column=(c - cols // 2).astype(np.int64),
        value=value,
        total=sums.cumsum(axis=1),
        square=squares.cumsum(axis=1),
    )


@kernel()
def _prepare(cut, tall, wide, along, stack, total, square, room):  # type: ignore[no-untyped-def]
    """Fill the stack, the sum of each window by channel, and the sum of squares about the channels' means."""
    count, rows, cols = cut.shape
    stretch = stack.shape[3]
    for c in range(stack.shape[0]):
        for k in range(count):
            for r in range(rows):
                filled, line = stack[c, k, r], cut[k, r]
                for j in range(along):
                    filled[j] = line[c + j]
    s1, s2 = room[0], room[1]
    for k in range(count):
        for c in range(cols):
            s1[c] = s2[c] = 0.0
        for r in range(rows):
            for c in range(cols):
                v = np.float64(cut[k, r, c])
                s1[c] += v
                s2[c] += v * v
            if r >= tall:
                for c in range(cols):
                    v = np.float64(cut[k, r - tall, c])
                    s1[c] -= v
                    s2[c] -= v * v
            i = r - tall + 1
            if i >= 0:
                t1 = t2 = 0.0
                for c in range(wide - 1):
                    t1 += s1[c]
                    t2 += s2[c]
                for j in range(along):
                    t1 += s1[j + wide - 1]
                    t2 += s2[j + wide - 1]
                    total[k, i * stretch + j] = t1
                    square[i * stretch + j] += t2 - t1 * t1 / (wide * tall)
                    t1 -= s1[j]
                    t2 -= s2[j]


@kernel(allow=CONTRACTED)
def _straight(  # type: ignore[no-untyped-def]
    flat,
    shape,
    channel,
    row,
    column,
    value,
    span,
    left,
    along,
    gone,
    norm,
    sums,
    root,
    at,
    table,
    best,
    shift,
):
    """Of each template the best correlation and its shift; `gone` are its channels' means, `span` its ink."""
    count, rows, stretch = shape
    for t in range(best.size):
        first, last = span[t, 0], span[t, 1]
        for n in range(first, last):
            at[n] = (((column[n] + left) * count + channel[n]) * rows + row[n]) * stretch
        for i in range(table.size):
            table[i] = np.float32(0.0)
        add_stretches(table, np.int64(0), table.size, flat, at, value, first, last)
        for i in range(table.size):
            mean = 0.0
            for k in range(gone.shape[1]):
                mean += gone[t, k] * sums[k, i]
            table[i] = (table[i] - mean) / (norm[t] * root[i])
        found, most = 0, -np.inf
        for dv in range(table.size // stretch):
            for du in range(along):
                if table[dv * stretch + du] > most:
                    found, most = dv * along + du, table[dv * stretch + du]
        best[t], shift[t] = most, found


class Scored(NamedTuple):
    """Best correlation of each template with a cell, (T,), and the shift it has there; the cell's stack and sums.

    Attributes:
        sums: (channels, shifts) of each window.
        root: (shifts,) of the sum of squares about the channels' means.
    """

    best: NDArray[np.float64]
    shift: NDArray[np.int64]
    stack: NDArray[np.float32]
    sums: NDArray[np.float64]
    root: NDArray[np.float64]


def straight_scores(
    layers: NDArray[np.float32], ink: CellInk, first_t: int, last_t: int, cell: tuple[int, ...]
) -> Scored:
    """The templates from first_t to last_t, upright.

    A cell is its row and column, the rows it reaches up and down, the columns left and right, and the rows and
    columns by which it is shifted either way.
    """
    at_row, at_column, up, left, right, sv, su = cell
    tall, wide, along = 2 * up + 1, left + right + 1, 2 * su + 1
    stretch = -(-along // ALIGNED) * ALIGNED
    cut = _cut(layers, at_row - up - sv, at_column - left - su, tall + 2 * sv, wide + 2 * su)
    count, rows, cols = cut.shape
    shifts = (2 * sv + 1) * stretch
    stack = np.zeros((wide, count, rows, stretch), dtype=np.float32)
    sums, square = np.zeros((count, shifts)), np.zeros(shifts)
    _prepare(cut, tall, wide, along, stack, sums, square, np.empty((2, cols)))
    root = np.sqrt(np.maximum(square, 1e-12))
    middle = ink.start.shape[1] // 2 - 1
    low, high = middle - left, middle + right + 1
    which = slice(first_t, last_t)
    whole = ink.total[which, high] - ink.total[which, low]
    norm = ink.square[which, high] - ink.square[which, low]
    for k in range(count):
        norm -= whole[:, k] * whole[:, k] / (tall * wide)
    norm = np.maximum(np.sqrt(np.maximum(norm, 0.0)), 1e-12)
    best, shift = np.empty(last_t - first_t), np.empty(last_t - first_t, dtype=np.int64)
    at, table = np.empty(ink.value.size, dtype=np.int64), np.empty(shifts, dtype=np.float32)
    span = np.ascontiguousarray(ink.start[which, [low, high]])
    gone = whole / (tall * wide)
    _straight(
        stack.ravel(), stack.shape[1:], ink.channel, ink.row, ink.column, ink.value, span, left, along,
        gone, norm, sums, root, at, table, best, shift,
    )  # fmt: skip
    return Scored(best, shift, stack, sums, root)


def _cut(layers: NDArray[np.float32], row: int, column: int, rows: int, cols: int) -> NDArray[np.float32]:
    """(channels, rows, cols) of the image from (row, column) on; land, which is zero, beyond it."""
    count, n_rows, n_cols = layers.shape
    out = np.zeros((count, rows, cols), dtype=np.float32)
    top, bottom = max(0, -row), min(rows, n_rows - row)
    low, high = max(0, -column), min(cols, n_cols - column)
    if top < bottom and low < high:
        out[:, top:bottom, low:high] = layers[:, row + top : row + bottom, column + low : column + high]
    return out


@kernel(allow=CONTRACTED)
def _tilted(  # type: ignore[no-untyped-def]
    flat, shape, channel, row, column, value, up, left, along, n_window, half_width, half_height, most_lean,
    sums, root, at, parts, found, mean, gram, best,
):  # fmt: skip
    """As `tilted_score`, of the ink given, into `best`; `found`, `mean` and `gram` are zero."""
    count, rows, stretch = shape
    for n in range(at.size):
        k = channel[n]
        at[n] = (((column[n] + left) * count + k) * rows + row[n]) * stretch
        # the template and its two leaning parts
        parts[0, n] = value[n]
        parts[1, n] = value[n] * np.float32(min(max(column[n] / half_width, -1.0), 1.0))
        parts[2, n] = value[n] * np.float32(min(max((row[n] - up) / half_height, -1.0), 1.0))
        for p in range(3):
            a = np.float64(parts[p, n])
            mean[p, k] += a
            for q in range(p, 3):
                gram[p, q] += a * np.float64(parts[q, n])
    # products of the parts about their channels' means
    for p in range(3):
        for q in range(p, 3):
            for k in range(count):
                gram[p, q] -= mean[p, k] * mean[q, k] / n_window
    for p in range(3):
        for k in range(count):
            mean[p, k] /= n_window
    size = max(math.sqrt(max(gram[0, 0], 0.0)), 1e-12)
    c10, c20 = gram[0, 1] / size, gram[0, 2] / size
    length1 = max(math.sqrt(max(gram[1, 1] - c10 * c10, 0.0)), 1e-12)
    c21 = (gram[1, 2] - c10 * c20) / length1
    length2 = max(math.sqrt(max(gram[2, 2] - c20 * c20 - c21 * c21, 0.0)), 1e-12)
    for p in range(3):
        add_stretches(found[p], np.int64(0), root.size, flat, at, parts[p], np.int64(0), at.size)
    most, shift = -2.0, 0
    for i in range(root.size):
        if i % stretch >= along:
            continue
        s0, s1, s2 = np.float64(found[0, i]), np.float64(found[1, i]), np.float64(found[2, i])
        for k in range(count):
            s0 -= mean[0, k] * sums[k, i]
            s1 -= mean[1, k] * sums[k, i]
            s2 -= mean[2, k] * sums[k, i]
        upright = s0 / size
        first_part = (s1 - c10 * upright) / length1
        second_part = (s2 - c20 * upright - c21 * first_part) / length2
        upright /= root[i]
        score = upright
        if upright > 0.0:
            lean = most_lean * upright / size
            seen1, seen2 = abs(first_part) / root[i], abs(second_part) / root[i]
            taken1, taken2 = min(seen1, lean * length1), min(seen2, lean * length2)
            square = upright * upright + taken1 * (2.0 * seen1 - taken1) + taken2 * (2.0 * seen2 - taken2)
            score = math.sqrt(min(square, 1.0))
        if score > most:
            most, shift = score, i // stretch * along + i % stretch
    best[0], best[1] = most, shift


def tilted_score(
    cell: Scored,
    along: int,
    ink: CellInk,
    t: int,
    *,
    up: int,
    left: int,
    right: int,
    half_width: float,
    half_height: float,
    most_lean: float,
) -> tuple[float, int]:
    """Best correlation of one template whose one side may be struck deeper than the other, and its shift.

    The parts are made orthogonal one after the other, in the numbers of their Gram matrix.
    """
    stack = cell.stack
    middle = ink.start.shape[1] // 2 - 1
    of = slice(ink.start[t, middle - left], ink.start[t, middle + right + 1])
    channel, row, column, value = (values[of] for values in (ink.channel, ink.row, ink.column, ink.value))
    found, best = np.zeros((3, cell.root.size), dtype=np.float32), np.empty(2)
    _tilted(
        stack.ravel(), stack.shape[1:], channel, row, column, value, up, left, along,
        (2 * up + 1) * (left + right + 1), half_width, half_height, most_lean, cell.sums, cell.root,
        np.empty_like(channel), np.empty((3, value.size), dtype=np.float32), found,
        np.zeros((3, stack.shape[1])), np.zeros((3, 3)), best,
    )  # fmt: skip
    return float(best[0]), int(best[1])
