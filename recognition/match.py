"""Normalised correlation of an image with all templates, as batched products (FFT for the search, BLAS to refine).

The score of a template at a place is the correlation coefficient over its *window* (ink plus a narrow rim), each
channel's mean removed, all channels normalised together: 1 is the same shape at whatever depth, negative the
opposite polarity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.maps import TraceDirection
from recognition.frames import LineImage, channels
from recognition.templates import PIXELS, TemplateSet
from whisker_array.gridding import averaging

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
    """

    patches: NDArray[np.float32]
    half_cols: NDArray[np.int64]
    half_rows: int
    norm: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DenseScores:
    """Scores of all templates at all places.

    Attributes:
        score: (T, rows, cols) float32 correlation, 0 where the window leaves the image.
        energy: (T, rows, cols) float32 mean square of the image in the window.
    """

    score: NDArray[np.float32]
    energy: NDArray[np.float32]


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
    patches = np.zeros_like(coarse)
    for t in range(count):
        window = (slice(mid_row - half_rows, mid_row + half_rows + 1), _around(mid_col, half_cols[t]))
        inside = coarse[t][:, window[0], window[1]]
        patches[t][:, window[0], window[1]] = inside - inside.mean(axis=(1, 2), keepdims=True)
    norm = np.sqrt((patches.astype(np.float64) ** 2).sum(axis=(1, 2, 3)))
    made = SearchTemplates(
        patches=patches, half_cols=half_cols, half_rows=half_rows, norm=np.maximum(norm, 1e-9)
    )
    templates.work["search"] = made
    return made


def _around(middle: int, half: int) -> slice:
    return slice(middle - int(half), middle + int(half) + 1)


def _template_spectra(
    templates: TemplateSet, search: SearchTemplates, shape: tuple[int, int]
) -> NDArray[np.complex64]:
    from scipy import fft

    key = ("spectra", shape)
    kept = templates.work.get(key)
    if isinstance(kept, np.ndarray):
        return kept
    # middles at the corner of the grid, so that a product is indexed by the middle of the window
    rows, cols = search.patches.shape[2:]
    centred = np.zeros((*search.patches.shape[:2], *shape), dtype=np.float32)
    centred[:, :, :rows, :cols] = search.patches
    centred = np.roll(centred, (-(rows // 2), -(cols // 2)), (2, 3))
    spectra: NDArray[np.complex64] = np.conj(fft.rfft2(centred))
    for old in [k for k in templates.work if isinstance(k, tuple) and k[0] == "spectra"][:-4]:
        del templates.work[old]
    templates.work[key] = spectra
    return spectra


def dense_scores(
    image: LineImage, templates: TemplateSet, directions: tuple[TraceDirection, ...]
) -> DenseScores:
    """Correlate a search image (SEARCH_PIXELS to the character height) with all templates at all places."""
    from scipy import fft

    search = search_templates(templates, directions)
    _, rows, cols = image.channels.shape
    # few sizes, so that spectra of the templates are found again
    shape = (
        -(-(rows + search.patches.shape[2]) // 32) * 32,
        fft.next_fast_len(-(-(cols + search.patches.shape[3]) // 64) * 64, real=True),
    )
    spectra = _template_spectra(templates, search, (shape[0], shape[1]))
    seen = fft.rfft2(image.channels, shape)
    product = np.einsum("khw,tkhw->thw", seen, spectra)
    raw = fft.irfft2(product, shape)[:, :rows, :cols]
    score = np.zeros(raw.shape, dtype=np.float32)
    energy = np.zeros(raw.shape, dtype=np.float32)
    for half in np.unique(search.half_cols):
        these = np.flatnonzero(search.half_cols == half)
        spread, count = window_energy(image.channels, search.half_rows, int(half))
        floor = 1e-6 * max(float(spread.max()), 1e-12)
        score[these] = raw[these] / (search.norm[these, None, None] * np.sqrt(np.maximum(spread, floor)))
        energy[these] = spread / count
        # windows must lie in the image
        hr, hc = search.half_rows, int(half)
        outside = np.ones((rows, cols), dtype=np.bool_)
        outside[hr : max(hr, rows - hr), hc : max(hc, cols - hc)] = False
        score[these] = np.where(outside, 0.0, score[these])
    return DenseScores(score=score, energy=energy)


def window_energy(
    layers: NDArray[np.float32], half_rows: int, half_cols: int
) -> tuple[NDArray[np.float64], int]:
    """Sum of squares about the mean, over channels, in a window around every pixel; and the values in a window."""
    _, rows, cols = layers.shape
    count = (2 * half_rows + 1) * (2 * half_cols + 1)

    def box(values: NDArray[np.float64]) -> NDArray[np.float64]:
        padded = np.zeros((rows + 2 * half_rows + 1, cols + 2 * half_cols + 1))
        padded[half_rows + 1 : half_rows + 1 + rows, half_cols + 1 : half_cols + 1 + cols] = values
        total = padded.cumsum(axis=0).cumsum(axis=1)
        h, w = 2 * half_rows + 1, 2 * half_cols + 1
        return np.asarray(total[h:, w:] - total[:-h, w:] - total[h:, :-w] + total[:-h, :-w])

    values = layers.astype(np.float64)
    spread = box((values**2).sum(axis=0))
    for layer in values:
        spread -= box(layer) ** 2 / count
    return np.maximum(spread, 0.0), count * layers.shape[0]
