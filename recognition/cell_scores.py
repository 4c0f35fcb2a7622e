"""Correlations of all templates with one cell, over small shifts, turns and leans, from lists of ink.

The cell is cut out with room for the shifts, and its rows written out once for every column of the window, so that
one pixel of ink meets all its shifts in one stretch of memory::

    stack[c, k, r, j] = cut[k, r, c + j]        a pixel of ink at (k, r, c) meets stack[c, k, r:r + rows, :]

The shifts along are made up to a stretch that processors load at once.

A template's mean over the window, and its norm about it, come from sums by column that its lists keep.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recognition.correlation import LEAST_INK, add_stretches

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


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _cut(layers, row, column, rows, cols):  # type: ignore[no-untyped-def]
    """(channels, rows, cols) of the image from (row, column) on; land, which is zero, beyond it."""
    count, n_rows, n_cols = layers.shape
    out = np.zeros((count, rows, cols), dtype=np.float32)
    low, high = max(0, -column), min(cols, n_cols - column)
    if low < high:
        for k in range(count):
            for r in range(max(0, -row), min(rows, n_rows - row)):
                out[k, r, low:high] = layers[k, row + r, column + low : column + high]
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _stacked(cut, along, stretch):  # type: ignore[no-untyped-def]
    """(columns, channels, rows, stretch) of the cell: shifts along, and nought to the end of the stretch."""
    count, rows, cols = cut.shape
    out = np.zeros((cols - along + 1, count, rows, stretch), dtype=np.float32)
    for c in range(out.shape[0]):
        for k in range(count):
            for r in range(rows):
                filled, seen = out[c, k, r], cut[k, r, c : c + along]
                for j in range(along):
                    filled[j] = seen[j]
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _window_sums(cut, tall, wide, stretch):  # type: ignore[no-untyped-def]
    """(channels, shifts) sum of each window, and (shifts,) root of the sum of squares about the channels' means."""
    count, rows, cols = cut.shape
    down, along = rows - tall + 1, cols - wide + 1
    total, square = np.zeros((count, down * stretch)), np.zeros(down * stretch)
    s1, s2 = np.empty(cols), np.empty(cols)
    for k in range(count):
        s1[:], s2[:] = 0.0, 0.0
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
                t1, t2 = s1[: wide - 1].sum(), s2[: wide - 1].sum()
                for j in range(along):
                    t1 += s1[j + wide - 1]
                    t2 += s2[j + wide - 1]
                    total[k, i * stretch + j] = t1
                    square[i * stretch + j] += t2 - t1 * t1 / (wide * tall)
                    t1 -= s1[j]
                    t2 -= s2[j]
    return total, np.sqrt(np.maximum(square, 1e-12))


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _places(ink, first, last, left, stack, at):  # type: ignore[no-untyped-def]
    """Where in the stack the shifts of each pixel of ink begin."""
    _, count, rows, stretch = stack.shape
    for n in range(first, last):
        at[n - first] = (((ink.column[n] + left) * count + ink.channel[n]) * rows + ink.row[n]) * stretch


@njit(cache=True, fastmath={"contract"})  # type: ignore[untyped-decorator,unused-ignore]
def _upright(flat, at, value, gone, sums, root, norm, out):  # type: ignore[no-untyped-def]
    """Correlations of one template at every shift; `gone` are its channels' means."""
    out[:] = np.float32(0.0)
    add_stretches(out, flat, at, value, 0, value.size)
    for i in range(out.size):
        mean = 0.0
        for k in range(gone.size):
            mean += gone[k] * sums[k, i]
        out[i] = (out[i] - mean) / (norm * root[i])


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def straight_scores(layers, ink, first_t, last_t, cell):  # type: ignore[no-untyped-def]
    """Best correlation of each template, (T,), and the shift it has there; the cell's stack and its sums.

    A cell is its row and column, the rows it reaches up and down, the columns left and right, and the rows and
    columns by which it is shifted either way.
    """
    at_row, at_column, up, left, right, sv, su = cell
    tall, wide = 2 * up + 1, left + right + 1
    cut = _cut(layers, at_row - up - sv, at_column - left - su, tall + 2 * sv, wide + 2 * su)
    along, stretch = 2 * su + 1, -(-(2 * su + 1) // ALIGNED) * ALIGNED
    stack = _stacked(cut, along, stretch)
    sums, root = _window_sums(cut, tall, wide, stretch)
    flat = stack.ravel()
    count = stack.shape[1]
    middle = ink.start.shape[1] // 2 - 1
    low, high = middle - left, middle + right + 1
    n = tall * wide
    best, shift = np.empty(last_t - first_t), np.empty(last_t - first_t, dtype=np.int64)
    at = np.empty(ink.value.size, dtype=np.int64)
    table = np.empty(root.size, dtype=np.float32)
    gone = np.empty(count)
    for t in range(first_t, last_t):
        first, last = ink.start[t, low], ink.start[t, high]
        _places(ink, first, last, left, stack, at)
        norm = ink.square[t, high] - ink.square[t, low]
        for k in range(count):
            s = ink.total[t, high, k] - ink.total[t, low, k]
            gone[k] = s / n
            norm -= s * s / n
        norm = max(np.sqrt(max(norm, 0.0)), 1e-12)
        _upright(flat, at, ink.value[first:last], gone, sums, root, norm, table)
        i, most = 0, -np.inf
        for dv in range(2 * sv + 1):
            for du in range(along):
                if table[dv * stretch + du] > most:
                    i, most = dv * along + du, table[dv * stretch + du]
        best[t - first_t], shift[t - first_t] = most, i
    return best, shift, stack, sums, root


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _parts(ink, first, last, up, half_width, half_height, out):  # type: ignore[no-untyped-def]
    """The template and its two leaning parts, (3, ink)."""
    for n in range(first, last):
        u = min(max(ink.column[n] / half_width, -1.0), 1.0)
        v = min(max((ink.row[n] - up) / half_height, -1.0), 1.0)
        out[0, n - first] = ink.value[n]
        out[1, n - first] = ink.value[n] * np.float32(u)
        out[2, n - first] = ink.value[n] * np.float32(v)


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _gram(channel, parts, count, n):  # type: ignore[no-untyped-def]
    """(3, 3) products of the parts about their channels' means, and those means, (3, channels)."""
    sums, products = np.zeros((3, count)), np.zeros((3, 3))
    for i in range(channel.size):
        for p in range(3):
            a = np.float64(parts[p, i])
            sums[p, channel[i]] += a
            for q in range(p, 3):
                products[p, q] += a * np.float64(parts[q, i])
    for p in range(3):
        for q in range(p, 3):
            for k in range(count):
                products[p, q] -= sums[p, k] * sums[q, k] / n
            products[q, p] = products[p, q]
    return products, sums / n


@njit(cache=True, fastmath={"contract"})  # type: ignore[untyped-decorator,unused-ignore]
def tilted_score(stack, along, sums, root, ink, t, up, left, right, half_width, half_height, most_lean):  # type: ignore[no-untyped-def]
    """Best correlation of one template whose one side may be struck deeper than the other, and its shift.

    The parts are made orthogonal one after the other, in the numbers of their Gram matrix.
    """
    flat, count = stack.ravel(), stack.shape[1]
    middle = ink.start.shape[1] // 2 - 1
    first, last = ink.start[t, middle - left], ink.start[t, middle + right + 1]
    at = np.empty(last - first, dtype=np.int64)
    _places(ink, first, last, left, stack, at)
    parts = np.empty((3, last - first), dtype=np.float32)
    _parts(ink, first, last, up, half_width, half_height, parts)
    gram, mean = _gram(ink.channel[first:last], parts, count, (2 * up + 1) * (left + right + 1))
    size = max(np.sqrt(max(gram[0, 0], 0.0)), 1e-12)
    c10, c20 = gram[0, 1] / size, gram[0, 2] / size
    length1 = max(np.sqrt(max(gram[1, 1] - c10 * c10, 0.0)), 1e-12)
    c21 = (gram[1, 2] - c10 * c20) / length1
    length2 = max(np.sqrt(max(gram[2, 2] - c20 * c20 - c21 * c21, 0.0)), 1e-12)
    found = np.zeros((3, root.size), dtype=np.float32)
    for p in range(3):
        add_stretches(found[p], flat, at, parts[p], 0, at.size)
    best, shift, stretch = -2.0, 0, stack.shape[3]
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
            square = upright * upright
            for part, length in ((first_part, length1), (second_part, length2)):
                seen = abs(part) / root[i]
                taken = min(seen, most_lean * upright * length / size)
                square += taken * (2.0 * seen - taken)
            score = np.sqrt(min(square, 1.0))
        if score > best:
            best, shift = score, i // stretch * along + i % stretch
    return best, shift
