"""Random fields with a correlation length, for patches of dirt and textures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]


def smooth_noise(
    shape: tuple[int, int], *, pitch_mm: float, length_mm: float, rng: np.random.Generator
) -> Field:
    """Gaussian noise of mean 0 and variance 1 whose autocorrelation falls to 1/e at `length_mm`; 0 gives white noise.
    The field is periodic on a grid somewhat larger than the requested one."""
    from scipy import fft

    # a margin, so that opposite edges of the part do not match
    room = min(int(2.0 * length_mm / pitch_mm), 2 * max(shape))
    rows, cols = (int(fft.next_fast_len(n + room, real=True)) for n in shape)
    white = rng.standard_normal((rows, cols), dtype=np.float32)
    # a Gaussian of width s as filter gives an autocorrelation exp(-r^2 / 4 s^2): 1/e at r = 2 s
    width = np.pi * length_mm / pitch_mm
    down = np.exp(-0.5 * (width * np.fft.fftfreq(rows)) ** 2).astype(np.float32)
    across = np.exp(-0.5 * (width * np.fft.rfftfreq(cols)) ** 2).astype(np.float32)
    spectrum = fft.rfft2(white) * down[:, None] * across[None, :]
    field = fft.irfft2(spectrum, s=(rows, cols))
    # Parseval: the expected variance, not that of the sample, so that the area of a few large patches can vary
    full = np.exp(-((width * np.fft.fftfreq(cols)) ** 2))
    expected = float(np.mean(down.astype(np.float64) ** 2) * np.mean(full))
    return np.asarray(field[: shape[0], : shape[1]] / np.sqrt(expected), dtype=np.float32)


def share(noise: Field) -> Field:
    """Convert noise to ranks 0 to 1: the ranks above 1 - f cover a share f of the plane for any length."""
    from scipy.special import ndtr

    return np.asarray(ndtr(noise), dtype=np.float32)


def ramp(values: Field, low: float | np.float32 | Field, high: float | np.float32 | Field) -> Field:
    """0 below `low`, 1 above `high`, smooth between (the cubic 3 t^2 - 2 t^3)."""
    t = np.clip((values - low) / np.maximum(np.subtract(high, low), 1e-9), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), dtype=np.float32)


def bilinear(values: NDArray[np.floating], row: NDArray[np.floating], col: NDArray[np.floating]) -> Field:
    """Interpolate a coarse grid at fractional rows and columns; it is constant beyond its last sample."""
    r, c = np.clip(row, 0, values.shape[0] - 1), np.clip(col, 0, values.shape[1] - 1)
    r0, c0 = np.minimum(r.astype(int), values.shape[0] - 2), np.minimum(c.astype(int), values.shape[1] - 2)
    down, right = (r - r0.astype(r.dtype))[:, None], (c - c0.astype(c.dtype))[None, :]
    # interpolate along the columns of the coarse grid first: it has few rows, and whole rows are then copied
    left = np.take(values, c0, axis=1)
    along = left + right * (np.take(values, c0 + 1, axis=1) - left)
    above = np.take(along, r0, axis=0)
    return np.asarray(above + down * (np.take(along, r0 + 1, axis=0) - above), dtype=np.float32)
