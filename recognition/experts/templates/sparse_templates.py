"""Templates as lists of ink, and the sums of a pixel model over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from recognition.experts.templates.frames import channels
from recognition.experts.templates.pixel_model import N_PREDICTED, PixelModel
from recognition.experts.templates.predicted import PIXELS, TemplateSet
from recognition.experts.templates.ratio_sums import FEW, ratio_maps, sum_ratios
from whisker_array.estimation.spreading import averaging

EVIDENCE_PIXELS = 24
"""Pixels to a character height."""


@dataclass(frozen=True, eq=False)
class SparseTemplates:
    """The ink of every template: where it predicts anything, and what.

    Attributes:
        start: (T + 1,) where each template's pixels begin in the lists.
        channel, row, column: (N,) of each; row and column from the reference point.
        value: (N,) predicted enhancement.
        half_cols: (T,) half width of the ink, pixels.
    """

    start: NDArray[np.int64]
    channel: NDArray[np.int32]
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    value: NDArray[np.float32]
    half_cols: NDArray[np.int64]


def coarse_patches(templates: TemplateSet, directions: tuple[TraceDirection, ...]) -> NDArray[np.float32]:
    """(T, channels, rows, cols) of the set at EVIDENCE_PIXELS to the height; kept in the set's work space."""
    kept = templates.work.get("evidence")
    if isinstance(kept, np.ndarray):
        return kept
    fine = channels(templates.patches, directions, axis=1)
    ratio = PIXELS / EVIDENCE_PIXELS

    def weights(n: int) -> NDArray[np.float32]:
        half = int((n - 1) // 2 / ratio)
        at = np.arange(n, dtype=np.float64) - (n - 1) // 2
        w = averaging(at, np.arange(-half, half + 1) * ratio, ratio).toarray()
        return np.asarray(w / w.sum(axis=1, keepdims=True), dtype=np.float32)

    made = np.einsum("rR,tkRC,cC->tkrc", weights(fine.shape[2]), fine, weights(fine.shape[3]), optimize=True)
    made = np.ascontiguousarray(made, dtype=np.float32)
    templates.work["evidence"] = made
    return made


def _sparse(
    patches: NDArray[np.float32], half_width: NDArray[np.float64], reach: NDArray[np.float64]
) -> SparseTemplates:
    least = reach[None, :, None, None] / (N_PREDICTED - 1)
    t, k, r, c = np.nonzero(np.abs(patches) > least)
    middle_row, middle_col = patches.shape[2] // 2, patches.shape[3] // 2
    return SparseTemplates(
        start=np.searchsorted(t, np.arange(patches.shape[0] + 1)).astype(np.int64),
        channel=k.astype(np.int32),
        row=(r - middle_row).astype(np.int32),
        column=(c - middle_col).astype(np.int32),
        value=patches[t, k, r, c],
        half_cols=np.maximum(1, np.round(half_width * EVIDENCE_PIXELS)).astype(np.int64),
    )


def turned_templates(
    templates: TemplateSet, directions: tuple[TraceDirection, ...], turn: float, reach: NDArray[np.float64]
) -> SparseTemplates:
    """Sparse templates, turned; kept in the set's work space."""
    key = ("sparse", turn)
    kept = templates.work.get(key)
    if isinstance(kept, SparseTemplates):
        return kept
    patches = coarse_patches(templates, directions)
    if turn:
        from scipy import ndimage

        # positive turns from +u to +v, clockwise as seen; ndimage.rotate turns the other way
        patches = ndimage.rotate(patches, -turn, axes=(3, 2), reshape=False, order=1, mode="constant")
    made = _sparse(patches, templates.half_width, reach)
    templates.work[key] = made
    return made


def reach_of(templates: TemplateSet, directions: tuple[TraceDirection, ...]) -> NDArray[np.float64]:
    """(channels,) largest prediction of a set: the range of a channel's table."""
    kept = templates.work.get("evidence reach")
    if isinstance(kept, np.ndarray):
        return kept
    patches = coarse_patches(templates, directions)
    flat = np.abs(patches).transpose(1, 0, 2, 3).reshape(patches.shape[1], -1)
    made = np.asarray(np.percentile(flat, 99.9, axis=1), dtype=np.float64)
    templates.work["evidence reach"] = made
    return made


def dense_evidence(
    model: PixelModel,
    index: NDArray[np.int32],
    sparse: SparseTemplates,
    reach: NDArray[np.float64],
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
) -> NDArray[np.float32]:
    """(T, rows, cols) evidence of every template with its reference point at those rows and columns."""
    all_rows, all_cols = np.arange(rows.min(), rows.max() + 1), np.arange(cols.min(), cols.max() + 1)
    field = EvidenceField(model, index, all_rows, all_cols, reach_px=ink_reach(sparse))
    sums = field.sums(sparse, predicted_columns(model, sparse), all_rows, all_cols)
    if (rows.size, cols.size) == (all_rows.size, all_cols.size):
        return sums
    return sums[:, rows - all_rows[0]][:, :, cols - all_cols[0]]


def ink_reach(*sets: SparseTemplates) -> tuple[int, int]:
    """Rows and columns that ink lies from its reference point, at most."""
    return (
        max(int(np.abs(sparse.row).max(initial=0)) for sparse in sets),
        max(int(np.abs(sparse.column).max(initial=0)) for sparse in sets),
    )


class EvidenceField:
    """What every pixel about some places says of every prediction."""

    def __init__(
        self,
        model: PixelModel,
        index: NDArray[np.int32],
        rows: NDArray[np.int64],
        cols: NDArray[np.int64],
        *,
        reach_px: tuple[int, int],
    ) -> None:
        """Look up.

        Args:
            model: of pixels.
            index: what is felt, by the model.
            rows, cols: places, consecutive.
            reach_px: rows and columns that ink may lie from them.
        """
        tall, wide = reach_px
        self._row, self._column = int(rows[0]) - tall, int(cols[0]) - wide
        # short sums are taken in blocks, which may look beyond the last place
        n_rows, n_cols = rows.size + 2 * tall, cols.size + 2 * wide + FEW
        self._maps = ratio_maps(
            model.table.ravel(), index, N_PREDICTED, self._row, self._column, n_rows, n_cols
        )

    def sums(
        self,
        sparse: SparseTemplates,
        level: NDArray[np.int32],
        rows: NDArray[np.int64],
        cols: NDArray[np.int64],
        *,
        only: int | None = None,
    ) -> NDArray[np.float32]:
        """(T, rows, cols) evidence of all templates, or of one, at consecutive rows and columns."""
        first, last = (0, sparse.start.size - 1) if only is None else (only, only + 1)
        out = np.empty((last - first, rows.size, cols.size), dtype=np.float32)
        sum_ratios(
            self._maps, first, last, sparse.start, sparse.channel, sparse.row, sparse.column, level,
            int(rows[0]) - self._row, int(cols[0]) - self._column, out,
        )  # fmt: skip
        return out


def predicted_columns(model: PixelModel, sparse: SparseTemplates) -> NDArray[np.int32]:
    """(N,) column of the table of every pixel of ink."""
    reach = model.predicted_reach[sparse.channel]
    at = (sparse.value / reach + 1.0) * (0.5 * (N_PREDICTED - 1))
    return np.asarray(np.clip(np.rint(at), 0, N_PREDICTED - 1), dtype=np.int32)


def ideal_evidence(
    model: PixelModel, sparse: SparseTemplates, reach: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(T,) evidence of each template on its own prediction, nothing covered."""
    at = predicted_columns(model, sparse)
    felt = np.empty(at.size, dtype=np.int64)
    for k in range(reach.size):
        own = sparse.channel == k
        one = model.felt_index(
            np.broadcast_to(sparse.value[own], (reach.size, 1, int(own.sum()))), np.zeros((1, 1), np.float32)
        )
        felt[own] = one[k, 0]
    values = model.table.ravel()[felt + at]
    return np.asarray(np.add.reduceat(values, sparse.start[:-1]), dtype=np.float64)
