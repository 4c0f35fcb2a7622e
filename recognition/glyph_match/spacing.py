"""Where the places of a line lie: how far apart its characters stand, and where each ends."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.glyph_match.chain import Placed, Spacing

SIDE_HEIGHTS = 0.25
"""Land beside a character's ink that its place takes in at most."""
STEP_COST, STEP_LIMIT, STANDS_OUT = 6.0, 1.2, 0.35


def usual_spacing(
    placed: Sequence[Placed],
    chars: Sequence[str],
    font: Font,
    *,
    full: NDArray[np.float64],
    gaps: frozenset[int] = frozenset(),
    pixels: int,
) -> Spacing | None:
    """Estimate the spacing of characters from neighbours that both stand out; None if none do.

    Either as the font has it, all letter-spaced alike, or evenly: whichever fits the more closely. Of templates
    (T,) `chars` are the characters, and `full` is what each earns standing there clean.
    """
    glyphs = [font.glyph(c) for c in chars]
    middle = np.array([0.5 * (g.ink_box[0] + g.ink_box[2]) for g in glyphs])
    after = (np.array([g.advance for g in glyphs]) - middle) * pixels
    before = middle * pixels
    pairs = [
        (a, b)
        for k, (a, b) in enumerate(pairwise(placed))
        if k not in gaps and min(a.reward / full[a.template], b.reward / full[b.template]) > STANDS_OUT
    ]
    if not pairs:
        return None
    apart = np.array([b.column - a.column for a, b in pairs], dtype=np.float64)
    extra = apart - np.array([after[a.template] + before[b.template] for a, b in pairs])
    cost, limit = STEP_COST / pixels**2, STEP_LIMIT
    if np.abs(extra - np.median(extra)).mean() <= np.abs(apart - np.median(apart)).mean():
        return Spacing(before, after + float(np.median(extra)), cost, limit, gaps)
    return Spacing(np.zeros_like(before), np.full_like(after, float(np.median(apart))), cost, limit, gaps)


def place_bounds(
    placed: Sequence[Placed], half_cols: NDArray[np.int64], width: int, *, pixels: int
) -> list[tuple[int, int]]:
    """Columns of each place: from halfway to the one neighbour's ink to halfway to the other's.

    Args:
        placed: the characters.
        half_cols: (T,) half the ink's width of each template, pixels.
        width: of the image.
        pixels: to a character height.
    """
    left = [p.column - int(half_cols[p.template]) for p in placed]
    right = [p.column + int(half_cols[p.template]) for p in placed]
    side = round(SIDE_HEIGHTS * pixels)
    out = []
    for i in range(len(placed)):
        low, high = left[i] - side, right[i] + side
        if i > 0:
            low = max(low, (right[i - 1] + left[i]) // 2)
        if i + 1 < len(placed):
            high = min(high, (right[i] + left[i + 1]) // 2)
        out.append((max(0, low), min(width, high + 1)))
    return out
