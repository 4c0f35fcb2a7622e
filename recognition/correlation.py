"""Correlation with lists of ink: the product of all windows with all templates, land left out.

Of a template's pixels three quarters predict nothing. Without them the product costs a third of what it costs a
general matrix product, and no window need be written out::

    product[t, r, c] = sum over the ink n of template t of value[n] * layers[channel[n], r + row[n], c + column[n]]

With the image's rows end to end this is, for each n, a stretch of pixels added to a stretch of sums. What the mean
of a window takes off it is known from sums over windows, which neighbouring places share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import ANY_ORDER, CONTRACTED, kernel

Image: TypeAlias = NDArray[np.float32]
Floats: TypeAlias = NDArray[np.float64]

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


@kernel(allow=ANY_ORDER)
def add_stretches(total, low, size, flat, at, value, first, last):  # type: ignore[no-untyped-def]
    """total[low + i] += sum of value[n] * flat[at[n] + i] over first <= n < last; eight at once, to save on stores."""
    begin, n = np.uint64(low), first  # what has no sign need not be looked at as an index from the end
    while n + 8 <= last:
        v0, v1, v2, v3 = value[n], value[n + 1], value[n + 2], value[n + 3]
        v4, v5, v6, v7 = value[n + 4], value[n + 5], value[n + 6], value[n + 7]
        a0, a1, a2, a3 = np.uint64(at[n]), np.uint64(at[n + 1]), np.uint64(at[n + 2]), np.uint64(at[n + 3])
        a4, a5, a6, a7 = (
            np.uint64(at[n + 4]),
            np.uint64(at[n + 5]),
            np.uint64(at[n + 6]),
            np.uint64(at[n + 7]),
        )
        for j in range(size):
            i = np.uint64(j)
            some = v0 * flat[a0 + i] + v1 * flat[a1 + i] + v2 * flat[a2 + i] + v3 * flat[a3 + i]
            more = v4 * flat[a4 + i] + v5 * flat[a5 + i] + v6 * flat[a6 + i] + v7 * flat[a7 + i]
            total[begin + i] += some + more
        n += 8
    while n < last:
        v0, a0 = value[n], np.uint64(at[n])
        for j in range(size):
            i = np.uint64(j)
            total[begin + i] += v0 * flat[a0 + i]
        n += 1


@kernel()
def _products(flat, base, at, value, start, first, last, out):  # type: ignore[no-untyped-def]
    """Add up the pixels from first to last of all templates, block by block; `at` is room for the ink's places."""
    for begin in range(first, last, BLOCK):
        size = min(BLOCK, last - begin)
        for n in range(base.size):
            at[n] = base[n] + begin
        for t in range(out.shape[0]):
            add_stretches(out[t], begin, size, flat, at, value, start[t], start[t + 1])


def products(layers: Image, ink: InkLists, first_row: int, last_row: int, out: Image) -> None:
    """out[t, r, c] += the product of the template with the window there, of rows first_row <= r < last_row.

    Rows must keep the templates' half height from the rim; what stands within their half width of a rim is void.
    """
    _, rows, cols = layers.shape
    rim = max(int(np.abs(ink.column).max(initial=0)), 1)
    flat = np.pad(layers.ravel(), rim)
    base = (ink.channel * rows + ink.row) * cols + ink.column + rim
    _products(
        flat, base, np.empty_like(base), ink.value, ink.start, first_row * cols, last_row * cols,
        out.reshape(out.shape[0], -1),
    )  # fmt: skip


def running_sums(layers: Image, half_rows: int, rim: int) -> Floats:
    """(channels + 1, rows, rim + cols + 1 + rim) sums over rows within half_rows and all columns before.

    The last are of squares. In the rims stands what lies before and after all columns.
    """
    count, rows, cols = layers.shape
    down = np.empty((count + 1, rows, cols))
    down[:count] = layers
    np.einsum("krc,krc->rc", down[:count], down[:count], out=down[count])
    np.cumsum(down, axis=1, out=down)
    sums = down[:, np.minimum(np.arange(half_rows, half_rows + rows), rows - 1)]
    sums[:, half_rows + 1 :] -= down[:, : max(0, rows - half_rows - 1)]
    out = np.zeros((count + 1, rows, cols + 1 + 2 * rim))
    np.cumsum(sums, axis=2, out=out[:, :, rim + 1 : rim + cols + 1])
    out[:, :, rim + cols + 1 :] = out[:, :, rim + cols, None]
    return out


@kernel(allow=CONTRACTED)
def _window_sums(running, before, after, share, total, spread):  # type: ignore[no-untyped-def]
    """As `window_sums`, into total and spread; a window goes from before to after, counted from its middle."""
    count, rows, cols = total.shape
    for r in range(rows):
        line, sums = spread[r], running[count, r]
        for c in range(cols):
            line[c] = sums[c + after] - sums[c + before]
        for k in range(count):
            sums, inside = running[k, r], total[k, r]
            for c in range(cols):
                value = sums[c + after] - sums[c + before]
                inside[c] = value
                line[c] -= value * value * share
        for c in range(cols):
            line[c] = line[c] if line[c] > 0.0 else 0.0


def window_sums(running: Floats, rim: int, half_rows: int, half_cols: int) -> tuple[Image, Floats]:
    """Sum over a window about every pixel, of each channel, and the sum of squares about the mean over channels."""
    count, rows, cols = running.shape[0] - 1, running.shape[1], running.shape[2] - 1 - 2 * rim
    total, spread = np.empty((count, rows, cols), dtype=np.float32), np.empty((rows, cols))
    share = 1.0 / ((2 * half_rows + 1) * (2 * half_cols + 1))
    _window_sums(running, rim - half_cols, rim + half_cols + 1, share, total, spread)
    return total, spread


def normalise(
    layers: Image,
    product: Image,
    window: NDArray[np.int64],
    halves: NDArray[np.int64],
    mean: Image,
    norm: NDArray[np.float64],
    half_rows: int,
    first_row: int,
    last_row: int,
) -> Image:
    """Turn products into correlations, in place; (windows, rows, cols) mean square of the image in each window.

    A window's mean comes off, over the template's norm and the window's spread; 0 where the window leaves the image.
    """
    rim = int(halves.max())
    running = running_sums(layers, half_rows, rim)
    count, rows, cols = layers.shape
    energy = np.empty((halves.size, rows, cols), dtype=np.float32)
    total, spread = (
        np.empty_like(layers),
        np.empty((rows, cols)),
    )  # once for all: new memory costs more than the sums
    root = np.empty((rows, cols), dtype=np.float32)
    scale = (1.0 / norm).astype(np.float32)
    product[:, :first_row] = product[:, last_row:] = 0.0
    for i, half in enumerate(halves.tolist()):
        size = (2 * half_rows + 1) * (2 * half + 1)
        _window_sums(running, rim - half, rim + half + 1, 1.0 / size, total, spread)
        np.divide(spread, size * count, out=energy[i], casting="same_kind")
        np.maximum(spread, 1e-6 * max(float(spread.max()), 1e-12), out=spread)
        np.sqrt(spread, out=root, casting="same_kind")
        _scaled(product, window, i, total, root, mean, scale, first_row, last_row)
        product[window == i, :, : min(half, cols)] = 0.0
        product[window == i, :, max(0, cols - half) :] = 0.0
    return energy


@kernel(allow=CONTRACTED)
def _scaled(product, window, which, total, root, mean, scale, first_row, last_row):  # type: ignore[no-untyped-def]
    count, _, cols = total.shape
    for t in range(window.size):
        if window[t] != which:
            continue
        for r in range(first_row, last_row):
            line = product[t, r]
            for k in range(count):
                inside, share = total[k, r], mean[t, k]
                for c in range(cols):
                    line[c] -= share * inside[c]
            for c in range(cols):
                line[c] = line[c] * scale[t] / root[r, c]
