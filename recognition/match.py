"""Normalised correlation of an image with all templates, at all places.

The score of a template at a place is the correlation coefficient over its *window* (ink plus a narrow rim), each
channel's mean removed, all channels normalised together: 1 is the same shape at whatever depth, negative the
opposite polarity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from recognition.correlation import InkLists, ink_lists, normalise, products, running_sums, window_sums
from recognition.frames import LineImage, channels
from recognition.templates import PIXELS, TemplateSet
from whisker_array.estimation.spreading import averaging

SEARCH_PIXELS = 16
"""Pixels to a character height in the search."""
RIM_HEIGHTS = 0.07
"""Land around the ink that counts as part of the window, in character heights."""


@dataclass(frozen=True, eq=False)
class SearchTemplates:
    """Templates on the search grid.

    Attributes:
        patches: (T, channels, rows, cols) float32, mean-free and zero outside each template's window.
        half_cols: (T,) half width of each window, pixels.
        half_rows: half height of all windows, pixels.
        norm: (T,) root of the sum of squares of each patch.
        ink: the windows before their means were taken off.
    """

    patches: NDArray[np.float32]
    half_cols: NDArray[np.int64]
    half_rows: int
    norm: NDArray[np.float64]
    ink: InkLists


@dataclass(frozen=True, eq=False)
class DenseScores:
    """Scores of all templates at all places.

    Attributes:
        score: (T, rows, cols) float32 correlation, 0 where the window leaves the image.
        window: (T,) which of the windows each template has.
        window_energy: (windows, rows, cols) float32 mean square of the image in each of the windows.
    """

    score: NDArray[np.float32]
    window: NDArray[np.int64]
    window_energy: NDArray[np.float32]

    @property
    def energy(self) -> NDArray[np.float32]:
        """(T, rows, cols) mean square of the image in each template's window."""
        return self.window_energy[self.window]


def search_templates(templates: TemplateSet, directions: tuple[TraceDirection, ...]) -> SearchTemplates:
    """Template channels on the search grid; kept in the set's work space."""
    kept = templates.work.get("search")
    if isinstance(kept, SearchTemplates):
        return kept
    fine = channels(templates.patches, directions, axis=1)
    count, _, rows, cols = fine.shape
    ratio = PIXELS / SEARCH_PIXELS

    def weights(n: int) -> NDArray[np.float32]:
        half = int((n - 1) // 2 / ratio)
        at = np.arange(n, dtype=np.float64) - (n - 1) // 2
        w = averaging(at, np.arange(-half, half + 1) * ratio, ratio).toarray()
        return np.asarray(w / w.sum(axis=1, keepdims=True), dtype=np.float32)

    down, across = weights(rows), weights(cols)
    coarse = np.einsum("rR,tkRC,cC->tkrc", down, fine, across, optimize=True)
    mid_row, mid_col = coarse.shape[2] // 2, coarse.shape[3] // 2
    half_rows = min(mid_row, math.ceil((0.5 + RIM_HEIGHTS) * SEARCH_PIXELS))
    half_cols = np.ceil((templates.half_width + RIM_HEIGHTS) * SEARCH_PIXELS).astype(np.int64)
    half_cols = np.minimum(mid_col, half_cols)
    patches, windows = np.zeros_like(coarse), np.zeros_like(coarse)
    mean = np.zeros(coarse.shape[:2], dtype=np.float32)
    for t in range(count):
        window = (slice(mid_row - half_rows, mid_row + half_rows + 1), _around(mid_col, half_cols[t]))
        inside = coarse[t][:, window[0], window[1]]
        mean[t] = inside.mean(axis=(1, 2))
        windows[t][:, window[0], window[1]] = inside
        patches[t][:, window[0], window[1]] = inside - mean[t][:, None, None]
    norm = np.sqrt((patches.astype(np.float64) ** 2).sum(axis=(1, 2, 3)))
    made = SearchTemplates(
        patches=patches,
        half_cols=half_cols,
        half_rows=half_rows,
        norm=np.maximum(norm, 1e-9),
        ink=ink_lists(windows, mean),
    )
    templates.work["search"] = made
    return made


def _around(middle: int, half: int) -> slice:
    return slice(middle - int(half), middle + int(half) + 1)


def dense_scores(
    image: LineImage,
    templates: TemplateSet,
    directions: tuple[TraceDirection, ...],
    *,
    rows: tuple[int, int] | None = None,
) -> DenseScores:
    """Correlate a search image (SEARCH_PIXELS to the character height) with all templates at all places.

    Args:
        image: to be searched.
        templates: to be found.
        directions: of the image.
        rows: first and last plus one, of the rows that are asked for; others score 0.
    """
    search = search_templates(templates, directions)
    layers = np.ascontiguousarray(image.channels)
    _, n_rows, n_cols = layers.shape
    first, last = rows if rows is not None else (0, n_rows)
    low = min(n_rows, max(first, search.half_rows))
    high = max(low, min(last, n_rows - search.half_rows))
    score = np.zeros((search.norm.size, n_rows, n_cols), dtype=np.float32)
    ink = search.ink
    if high > low:
        products(layers, ink, low, high, score)
    halves, window = np.unique(search.half_cols, return_inverse=True)
    window = window.astype(np.int64)
    energy = normalise(layers, score, window, halves, ink.mean, search.norm, search.half_rows, low, high)
    return DenseScores(score=score, window=window, window_energy=energy)


def window_energy(
    layers: NDArray[np.float32], half_rows: int, half_cols: int
) -> tuple[NDArray[np.float64], int]:
    """Sum of squares about the mean, over channels, in a window around every pixel; and the values in a window."""
    running = running_sums(np.ascontiguousarray(layers), half_rows, half_cols)
    spread: NDArray[np.float64] = window_sums(running, half_cols, half_rows, half_cols)[1]
    return spread, (2 * half_rows + 1) * (2 * half_cols + 1) * layers.shape[0]
