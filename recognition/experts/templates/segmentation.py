"""Where the places of a line lie: how far apart its characters stand, where each ends, what lies beside them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.experts.templates.decode import Placed, Spacing
from recognition.experts.templates.predicted import TemplateSet
from recognition.experts.templates.sparse_templates import EVIDENCE_PIXELS

MARGIN_PIXELS = 6
RIM_PIXELS = 1
"""Padding around the map, and how far from its step nothing is looked for."""
BESIDE_HEIGHTS = 1.6
SIDE_HEIGHTS = 0.35
STEP_COST, STEP_LIMIT, STANDS_OUT = 6.0, 1.2, 0.35


def usual_spacing(
    placed: Sequence[Placed],
    templates: TemplateSet,
    font: Font,
    *,
    full: NDArray[np.float64],
    gaps: frozenset[int] = frozenset(),
) -> Spacing | None:
    """How far apart characters stand, from neighbours that both stand out; None if none do.

    Either as the font has it, all letter-spaced alike, or evenly: whichever fits the more closely. `full` (T,) is
    what each template earns standing there clean.
    """
    glyphs = [font.glyph(c) for c in templates.chars]
    middle = np.array([0.5 * (g.ink_box[0] + g.ink_box[2]) for g in glyphs])
    after = (np.array([g.advance for g in glyphs]) - middle) * EVIDENCE_PIXELS
    before = middle * EVIDENCE_PIXELS
    pairs = [
        (a, b)
        for k, (a, b) in enumerate(pairwise(placed))
        if k not in gaps and min(a.reward / full[a.template], b.reward / full[b.template]) > STANDS_OUT
    ]
    if not pairs:
        return None
    apart = np.array([b.column - a.column for a, b in pairs], dtype=np.float64)
    extra = apart - np.array([after[a.template] + before[b.template] for a, b in pairs])
    cost, limit = STEP_COST / EVIDENCE_PIXELS**2, STEP_LIMIT
    if np.abs(extra - np.median(extra)).mean() <= np.abs(apart - np.median(apart)).mean():
        return Spacing(before, after + float(np.median(extra)), cost, limit, gaps)
    return Spacing(np.zeros_like(before), np.full_like(after, float(np.median(apart))), cost, limit, gaps)


def place_bounds(placed: Sequence[Placed], half_cols: NDArray[np.int64], width: int) -> list[tuple[int, int]]:
    """Columns of each place: from halfway to the one neighbour's ink to halfway to the other's."""
    left = [p.column - int(half_cols[p.template]) for p in placed]
    right = [p.column + int(half_cols[p.template]) for p in placed]
    side = round(SIDE_HEIGHTS * EVIDENCE_PIXELS)
    out = []
    for i in range(len(placed)):
        low, high = left[i] - side, right[i] + side
        if i > 0:
            low = max(low, (right[i - 1] + left[i]) // 2)
        if i + 1 < len(placed):
            high = min(high, (right[i] + left[i + 1]) // 2)
        out.append((max(0, low), min(width, high + 1)))
    return out


def largest_beside(
    share: NDArray[np.floating], taken: Sequence[tuple[int, int]], half_cols: NDArray[np.int64]
) -> float:
    """Largest share (T, columns) of templates that keep clear of the columns taken, near the line's ends or in it."""
    reach = round(BESIDE_HEIGHTS * EVIDENCE_PIXELS)
    # off the rim, where the land's level steps to the padding's
    rim = MARGIN_PIXELS + RIM_PIXELS
    low, high = max(rim, taken[0][0] - reach), min(share.shape[1] - rim, taken[-1][1] + reach)
    best = 0.0
    for half in np.unique(half_cols):
        columns = np.arange(low + half, max(low + half, high - half))
        clear = np.ones(columns.size, dtype=np.bool_)
        for left, right in taken:
            clear &= (columns + half < left) | (columns - half > right)
        if clear.any():
            best = max(best, float(share[half_cols == half][:, columns[clear]].max()))
    return best
