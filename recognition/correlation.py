"""Correlation with lists of ink: the product of all windows with all templates, land left out.

Of a template's pixels three quarters predict nothing. Without them the product costs a third of what it costs a
general matrix product, and no window need be written out::

    product[t, r, c] = sum over the ink n of template t of value[n] * layers[channel[n], r + row[n], c + column[n]]

With the image's rows end to end this is, for each n, a stretch of pixels added to a stretch of sums. What the mean
of a window takes off it is known from sums over windows, which neighbouring places share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

LEAST_INK = 1e-4
"""Of the largest prediction: less is none."""
BLOCK = 2048
"""Sums kept at hand while a template's ink is gone through."""


@dataclass(frozen=True, eq=False)
class InkLists:
    """Where templates predict anything, and what.

    Attributes:
        start: (T + 1,) where each template's ink begins in the lists.
        channel, row, column: (N,) of each pixel; row and column from the reference point.
        value: (N,) float32.
        mean: (T, channels) float32, of each template's whole window.
    """

    start: NDArray[np.int64]
    channel: NDArray[np.int64]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    value: NDArray[np.float32]
    mean: NDArray[np.float32]


def ink_lists(windows: NDArray[np.float32], mean: NDArray[np.float32]) -> InkLists:
    """Lists of (T, channels, rows, cols) templates, zero outside their windows, whose means are (T, channels)."""
    least = LEAST_INK * float(np.abs(windows).max(initial=0.0))
    t, k, r, c = np.nonzero(np.abs(windows) > least)
    return InkLists(
        start=np.searchsorted(t, np.arange(windows.shape[0] + 1)).astype(np.int64),
        channel=k.astype(np.int64),
        row=(r - windows.shape[2] // 2).astype(np.int64),
        column=(c - windows.shape[3] // 2).astype(np.int64),
        value=windows[t, k, r, c].astype(np.float32),
        mean=np.ascontiguousarray(mean, dtype=np.float32),
    )


@njit(cache=True, fastmath={"contract", "reassoc"})  # type: ignore[untyped-decorator,unused-ignore]
def add_stretches(total, flat, at, value, first, last):  # type: ignore[no-untyped-def]
    """total[i] += sum of value[n] * flat[at[n] + i] over first <= n < last; eight at once, to save on stores."""
    size = total.size
    n = first
    while n + 8 <= last:
        v0, v1, v2, v3 = value[n], value[n + 1], value[n + 2], value[n + 3]
        v4, v5, v6, v7 = value[n + 4], value[n + 5], value[n + 6], value[n + 7]
        f0, f1 = flat[at[n] : at[n] + size], flat[at[n + 1] : at[n + 1] + size]
        f2, f3 = flat[at[n + 2] : at[n + 2] + size], flat[at[n + 3] : at[n + 3] + size]
        f4, f5 = flat[at[n + 4] : at[n + 4] + size], flat[at[n + 5] : at[n + 5] + size]
        f6, f7 = flat[at[n + 6] : at[n + 6] + size], flat[at[n + 7] : at[n + 7] + size]
        for i in range(size):
            some = v0 * f0[i] + v1 * f1[i] + v2 * f2[i] + v3 * f3[i]
            total[i] += some + (v4 * f4[i] + v5 * f5[i] + v6 * f6[i] + v7 * f7[i])
        n += 8
    while n < last:
        v0, f0 = value[n], flat[at[n] : at[n] + size]
        for i in range(size):
            total[i] += v0 * f0[i]
        n += 1


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def products(layers, start, channel, row, column, value, first_row, last_row, out):  # type: ignore[no-untyped-def]
    """out[t, r, c] += the product of the template with the window there, of rows first_row <= r < last_row.

    Rows must keep the templates' half height from the rim; what stands within their half width of a rim is void.
    """
    _, rows, cols = layers.shape
    rim = max(np.abs(column).max(), 1) if column.size else 1
    flat = np.zeros(layers.size + 2 * rim, dtype=np.float32)
    flat[rim : rim + layers.size] = layers.ravel()
    base = np.empty(channel.size, dtype=np.int64)
    for n in range(channel.size):
        base[n] = (channel[n] * rows + row[n]) * cols + column[n] + rim
    at = np.empty_like(base)
    for begin in range(first_row * cols, last_row * cols, BLOCK):
        stop = min(begin + BLOCK, last_row * cols)
        for n in range(base.size):
            at[n] = base[n] + begin
        for t in range(out.shape[0]):
            add_stretches(out[t].ravel()[begin:stop], flat, at, value, start[t], start[t + 1])


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def running_sums(layers, half_rows, rim):  # type: ignore[no-untyped-def]
    """(channels + 1, rows, rim + cols + 1 + rim) sums over rows within half_rows and all columns before.

    The last are of squares. In the rims stands what lies before and after all columns.
    """
    count, rows, cols = layers.shape
    out = np.zeros((count + 1, rows, cols + 1 + 2 * rim))
    column = np.zeros((count + 1, cols))
    for r in range(-half_rows, rows):
        for k in range(count):
            if r + half_rows < rows:
                for c in range(cols):
                    v = np.float64(layers[k, r + half_rows, c])
                    column[k, c] += v
                    column[count, c] += v * v
            if r - half_rows - 1 >= 0:
                for c in range(cols):
                    v = np.float64(layers[k, r - half_rows - 1, c])
                    column[k, c] -= v
                    column[count, c] -= v * v
        if r >= 0:
            for k in range(count + 1):
                total = 0.0
                for c in range(cols):
                    total += column[k, c]
                    out[k, r, rim + c + 1] = total
                out[k, r, rim + cols + 1 :] = total
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def window_sums(running, rim, half_rows, half_cols):  # type: ignore[no-untyped-def]
    """Sum over a window about every pixel, of each channel, and the sum of squares about the mean over channels."""
    count, rows, cols = running.shape[0] - 1, running.shape[1], running.shape[2] - 1 - 2 * rim
    share = 1.0 / ((2 * half_rows + 1) * (2 * half_cols + 1))
    total = np.empty((count, rows, cols), dtype=np.float32)
    spread = np.empty((rows, cols))
    for r in range(rows):
        line = spread[r]
        after, before = running[count, r, rim + half_cols + 1 :], running[count, r, rim - half_cols :]
        for c in range(cols):
            line[c] = after[c] - before[c]
        for k in range(count):
            sums = total[k, r]
            after, before = running[k, r, rim + half_cols + 1 :], running[k, r, rim - half_cols :]
            for c in range(cols):
                s = after[c] - before[c]
                sums[c] = s
                line[c] -= s * s * share
        for c in range(cols):
            line[c] = max(line[c], 0.0)
    return total, spread


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def normalise(layers, product, window, halves, mean, norm, half_rows, first_row, last_row):  # type: ignore[no-untyped-def]
    """Turn products into correlations, in place; (windows, rows, cols) mean square of the image in each window.

    A window's mean comes off, over the template's norm and the window's spread; 0 where the window leaves the image.
    """
    rim = halves.max()
    running = running_sums(layers, half_rows, rim)
    _, rows, cols = layers.shape
    energy = np.empty((halves.size, rows, cols), dtype=np.float32)
    root = np.empty((rows, cols), dtype=np.float32)
    for i in range(halves.size):
        half = halves[i]
        total, spread = window_sums(running, rim, half_rows, half)
        count = (2 * half_rows + 1) * (2 * half + 1) * layers.shape[0]
        floor = 1e-6 * max(spread.max(), 1e-12)
        for r in range(rows):
            for c in range(cols):
                energy[i, r, c] = spread[r, c] / count
                root[r, c] = np.sqrt(max(spread[r, c], floor))
        for t in range(window.size):
            if window[t] != i:
                continue
            product[t, :first_row], product[t, last_row:] = np.float32(0.0), np.float32(0.0)
            for r in range(first_row, last_row):
                _scaled(product[t, r], total, r, root[r], mean[t], np.float32(1.0 / norm[t]))
                product[t, r, : min(half, cols)] = np.float32(0.0)
                product[t, r, max(0, cols - half) :] = np.float32(0.0)
    return energy


@njit(cache=True, fastmath={"contract"})  # type: ignore[untyped-decorator,unused-ignore]
def _scaled(line, total, row, root, mean, scale):  # type: ignore[no-untyped-def]
    for k in range(mean.size):
        inside = total[k, row]
        for c in range(line.size):
            line[c] -= mean[k] * inside[c]
    for c in range(line.size):
        line[c] = line[c] * scale / root[c]
