"""Remove stains from a colour photograph: subtract the brightness that its colour explains.

    colour of a pixel --mean brightness of all pixels of that colour--> its stain
    brightness minus its stain ----------------------------------------> shading: the relief

Rust, paint and oil change colour and brightness together; a flank that the lamp hits changes only brightness. Marks
filled with paint are removed as well, so the result is read in addition to the photograph, not instead of it.
Sources: B. Funt, M. Drew, M. Brockington, ECCV 1992 (shading from colour); E. Nadaraya, Theory Probab. Appl. 9 (1964)
141 (kernel regression, here in a table of colours).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo

Floats = NDArray[np.float32]
_GAMMA = 2.2
"""Exponent that makes the values of a photograph proportional to light."""
_DARK = np.float32(0.01)
"""Linear brightness added before a logarithm is taken."""


def without_stains(
    photo: Photo,
    *,
    bins: int = 32,
    kernel_bins: float = 1.5,
    focus_px: float = 1.0,
    # share of the variance of log brightness that colour must explain; below it there are no stains to
    # remove. On the 145 photographs of the calibration design above it, reading also without stains raises
    # correct characters from 52 to 64 %, and correct serials from 31 to 55.
    least_explained: float = 0.4,
) -> Floats | None:
    """Return the (rows, cols) brightness that colour does not explain, 0 to 1; None if it is grey or without stains."""
    from glyphs.opencv import cv2

    if photo.pixels.ndim == 2:
        return None
    linear = (photo.pixels.astype(np.float32) / np.float32(np.iinfo(photo.pixels.dtype).max)) ** _GAMMA
    brightness = np.log(photo.grey() ** _GAMMA + _DARK)
    red, green, blue = np.moveaxis(np.log(cv2.GaussianBlur(linear, (0, 0), focus_px) + _DARK), 2, 0)
    row, column = _bins(red - green, bins), _bins(blue - green, bins)
    row_bin, column_bin = (
        np.floor(place.ravel() + np.float64(0.5)).astype(np.intp) for place in (row, column)
    )
    count, total = (
        cv2.GaussianBlur(
            np.bincount(row_bin * bins + column_bin, weights, bins * bins).reshape(bins, bins).astype(np.float64),
            (0, 0), kernel_bins, borderType=cv2.BORDER_CONSTANT,
        )
        for weights in (None, brightness.ravel())
    )  # fmt: skip
    usual = (total / np.maximum(count, 1e-6)).astype(np.float32)
    shading = brightness - cv2.remap(usual, column, row, cv2.INTER_LINEAR)
    if shading.var() > (1.0 - least_explained) * brightness.var():
        return None
    clean = np.exp(shading + np.median(brightness)) - _DARK
    return np.asarray(np.clip(clean, 0.0, 1.0) ** (1.0 / _GAMMA), dtype=np.float32)


def _bins(
    ratio: Floats,
    bins: int,
    *,
    used: float = 0.75,
    usual_percent: tuple[float, float] = (0.5, 99.5),
    least: float = 0.3,
) -> Floats:
    low, high = np.percentile(ratio, usual_percent)
    spread = max(float(high - low), least)
    place = ((ratio - 0.5 * (low + high)) * used / spread + 0.5) * bins - 0.5
    return np.asarray(np.clip(place, 0.0, bins - 1.0), dtype=np.float32)
