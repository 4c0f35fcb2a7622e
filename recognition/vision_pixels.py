"""Sums over a photograph's pixels, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def mean_of_table(pixels, table):  # type: ignore[no-untyped-def]
    """(rows, cols) mean over the colours of what a table of 256 float32 holds for each of them."""
    rows, cols, colours = pixels.shape
    out = np.empty((rows, cols), dtype=np.float32)
    for r in range(rows):
        for c in range(cols):
            total = table[pixels[r, c, 0]]
            for k in range(1, colours):
                total += table[pixels[r, c, k]]
            out[r, c] = total / np.float32(colours)
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def all_beyond(pixels, black, white):  # type: ignore[no-untyped-def]
    """(rows, cols) whether all colours are at `white` or over it, or all at `black` or under it."""
    rows, cols, colours = pixels.shape
    out = np.empty((rows, cols), dtype=np.bool_)
    for r in range(rows):
        for c in range(cols):
            low = high = pixels[r, c, 0]
            for k in range(1, colours):
                low, high = min(low, pixels[r, c, k]), max(high, pixels[r, c, k])
            out[r, c] = low >= white or high <= black
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def sizes(layers):  # type: ignore[no-untyped-def]
    """(rows, cols) root of the sum of squares over two layers, float32."""
    out = np.empty(layers.shape[1:], dtype=np.float32)
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[r, c] = np.sqrt(layers[0, r, c] * layers[0, r, c] + layers[1, r, c] * layers[1, r, c])
    return out


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def cut_and_scaled(layers, size, good, top):  # type: ignore[no-untyped-def]
    """Layers whose size is brought down to `top`, over their root mean square where good; 0 elsewhere."""
    out = np.zeros(layers.shape, dtype=np.float32)
    power, count = 0.0, 0
    for r in range(size.shape[0]):
        for c in range(size.shape[1]):
            if not good[r, c]:
                continue
            share = np.float32(1.0)
            if top > np.float32(0.0):
                share = min(share, top / max(size[r, c], np.float32(1e-12)))
            count += layers.shape[0]
            for k in range(layers.shape[0]):
                out[k, r, c] = layers[k, r, c] * share
                power += np.float64(out[k, r, c]) * np.float64(out[k, r, c])
    mean = np.float32(max(np.sqrt(power / max(count, 1)), 1e-12))
    for k in range(out.shape[0]):
        for r in range(out.shape[1]):
            for c in range(out.shape[2]):
                out[k, r, c] /= mean
    return out
