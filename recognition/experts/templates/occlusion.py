"""Dirt seen as dirt: where the surface is rougher than the part's clean land, or stands above it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

STRONG_EDGES, STRONG_PROFILE = 6.0, 0.3
"""Edges in standard deviations, profile in largest predictions, from which a pixel is ink or debris, not surface."""
RIM_HEIGHTS, WINDOW_HEIGHTS = 0.07, 0.22
ROUGHER, ROUGHER_WIDTH = 2.2, 0.2
"""Roughness against the cleanest of the land at which cover is as likely as not."""
RAISED, RAISED_WIDTH = 0.15, 0.02
"""Height above the land, in largest predictions, at which cover is as likely as not."""
LEAST_SURFACE = 0.2


def robust_spread(channels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Standard deviation of the land in each channel, (channels,), from the median of its magnitude."""
    flat = np.abs(channels.reshape(channels.shape[0], -1))
    return np.asarray(1.4826 * np.median(flat, axis=1), dtype=np.float64)


def covered(
    channels: NDArray[np.float32],
    *,
    profile: NDArray[np.bool_],
    reach: NDArray[np.float64],
    raised: bool,
    pixels_per_height: int,
) -> NDArray[np.float32]:
    """How likely each pixel is covered by dirt, (rows, cols) float32, 0 to 1.

    Strokes, chips and their rims are left out: only the surface between them tells of cover, and what lies
    under them is taken from beside.

    Args:
        channels: (channels, rows, cols) of the line image.
        profile: which of them are the profile; the others are edges.
        reach: (channels,) largest prediction of the templates.
        raised: raised marks.
        pixels_per_height: scale.
    """
    from scipy import ndimage

    edges = channels[~profile] if (~profile).any() else channels
    spread = np.maximum(robust_spread(edges), 1e-9)
    rough: NDArray[np.floating[Any]] = np.sqrt(((edges / spread[:, None, None]) ** 2).sum(axis=0))
    strong = rough > STRONG_EDGES
    level = np.zeros(rough.shape)
    for k in np.flatnonzero(profile):
        up = -channels[k] if raised else channels[k]
        level = level + up / reach[k]
        strong |= np.abs(channels[k]) > STRONG_PROFILE * reach[k]
    strong = ndimage.binary_opening(strong)
    surface = ~ndimage.binary_dilation(strong, iterations=max(1, round(RIM_HEIGHTS * pixels_per_height)))
    width = int(WINDOW_HEIGHTS * pixels_per_height) | 1
    share = ndimage.uniform_filter(surface.astype(np.float64), width)

    def mean(values: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        total = ndimage.uniform_filter(np.where(surface, values, 0.0).astype(np.float64), width)
        return np.asarray(total / np.maximum(share, 1e-3))

    enough = share > 0.5
    if not enough.any():
        return np.zeros(rough.shape, dtype=np.float32)
    rough, level = mean(np.minimum(rough, STRONG_EDGES)), mean(level)
    cleanest = max(float(np.quantile(rough[enough], 0.25)), 1e-9)
    land = float(np.quantile(level[enough], 0.3))
    sure = np.maximum(
        _logistic((rough / cleanest - ROUGHER) / ROUGHER_WIDTH),
        _logistic((level - land - RAISED) / RAISED_WIDTH),
    )
    return np.asarray(sure * np.clip((share - LEAST_SURFACE) / LEAST_SURFACE, 0.0, 1.0), dtype=np.float32)


def _logistic(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * x)))
