"""The blank plate before stamping: form, tilt, waviness, machining lay and roughness."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from glyphs.stamping.variation import PlateVariation


def plate_form(
    x_mm: NDArray[np.float64],
    y_mm: NDArray[np.float64],
    variation: PlateVariation,
    *,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Form, tilt and waviness (rows, cols), mm, over x (cols,) and y (rows,); zero in the middle. Raises StampError."""
    slope_x, slope_y = np.tan(np.radians(variation.tilt_deg * rng.standard_normal(2)))
    z = slope_x * (x_mm - x_mm.mean())[None, :] + slope_y * (y_mm - y_mm.mean())[:, None]
    # Three waves of different lengths and directions: regular enough to have a wavelength, but not a pure sine.
    for weight, ratio in ((0.7, 1.0), (0.5, 0.73), (0.4, 1.61)):
        heading, phase = rng.uniform(0.0, 2 * math.pi, 2)
        k = 2 * math.pi / (variation.waviness_wavelength_mm * ratio)
        amplitude = weight * variation.waviness_um * 1e-3
        if amplitude > 0.0:
            # sin(a + b) = sin a cos b + cos a sin b: sines of a row and a column instead of every sample
            a, b = k * math.cos(heading) * x_mm, k * math.sin(heading) * y_mm + phase
            z += amplitude * (
                np.cos(b)[:, None] * np.sin(a)[None, :] + np.sin(b)[:, None] * np.cos(a)[None, :]
            )
    if not variation.form.flat:
        z += variation.form.height_mm(x_mm - x_mm.mean(), y_mm - y_mm.mean())
    return np.asarray(z, dtype=np.float32)


def plate_texture(
    x_mm: NDArray[np.float64],
    y_mm: NDArray[np.float64],
    variation: PlateVariation,
    *,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Lay and roughness (rows, cols), mm, over plate coordinates x (cols,) and y (rows,)."""
    from scipy.ndimage import gaussian_filter

    shape = (y_mm.size, x_mm.size)
    z = np.zeros(shape, dtype=np.float32)
    phases = rng.uniform(0.0, 2 * math.pi, 5)
    if variation.lay_um > 0.0:
        along = math.radians(variation.lay_direction_deg)
        u = _weighted_sum(math.cos(along), x_mm, math.sin(along), y_mm)
        v = _weighted_sum(-math.sin(along), x_mm, math.cos(along), y_mm)
        k = 2 * math.pi / variation.lay_wavelength_mm
        # The tool chatters: the phase wanders slowly along and across the ridges.
        wander = np.sin(u / 3.1 + phases[0]) + np.sin(v / 1.7 + phases[1]) + np.sin((u + v) / 5.3 + phases[2])
        phase = np.float32(k) * v + np.float32(variation.lay_jitter * math.sqrt(2 / 3)) * wander
        lay = np.sin(phase + phases[3]) + np.float32(0.3) * np.sin(2 * phase + phases[4])
        z += np.float32(variation.lay_um * 1e-3) * lay.astype(np.float32)
    if variation.roughness_ra_um > 0.0:
        white = rng.standard_normal(shape, dtype=np.float32)
        # Filtering with a Gaussian of width s gives an autocorrelation exp(-r^2 / 4 s^2): 1/e at r = 2 s.
        pitch = float(x_mm[1] - x_mm[0])
        rough = gaussian_filter(white, variation.roughness_length_mm / 2 / pitch, mode="wrap", truncate=3.0)
        spread = float(rough.std())
        if spread > 0.0:
            # Ra of a Gaussian surface is sqrt(2/pi) of its standard deviation.
            z += rough * np.float32(variation.roughness_ra_um * 1e-3 / (spread * math.sqrt(2 / math.pi)))
    return z


def _weighted_sum(
    a: float, x_mm: NDArray[np.float64], b: float, y_mm: NDArray[np.float64]
) -> NDArray[np.float32]:
    across, down = a * x_mm[None, :], b * y_mm[:, None]
    if min(abs(a), abs(b)) > 1e-12:
        return (across + down).astype(np.float32)
    return (across if abs(b) <= 1e-12 else down).astype(np.float32)
