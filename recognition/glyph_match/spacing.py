"""Spacing of the characters of a line, and the bounds of each."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.glyph_match.chain import Placed, Spacing


def usual_spacing(
    placed: Sequence[Placed],
    chars: Sequence[str],
    font: Font,
    *,
    full: NDArray[np.float64],
    gaps: frozenset[int] = frozenset(),
    pixels: int,
    step_cost: float = 6.0,
    step_limit: float = 1.2,
    stands_out: float = 0.35,
) -> Spacing | None:
    """Estimate the spacing of characters from neighbours that both stand out; None if there are none.

    Either the spacing of the font plus a constant, or even spacing: whichever fits better.

    Args:
        placed: the characters.
        chars: (T,) characters of the templates.
        font: font of the templates.
        full: (T,) reward of each template on its own clean character.
        gaps: places before a word gap.
        pixels: pixels per character height.
        step_cost: cost of a distance that is off by a character height, in units of `full`.
        step_limit: greatest such cost.
        stands_out: least reward of both neighbours, as a share of `full`.
    """
    glyphs = [font.glyph(c) for c in chars]
    middle = np.array([0.5 * (g.ink_box[0] + g.ink_box[2]) for g in glyphs])
    after = (np.array([g.advance for g in glyphs]) - middle) * pixels
    before = middle * pixels
    pairs = [
        (a, b)
        for k, (a, b) in enumerate(pairwise(placed))
        if k not in gaps and min(a.reward / full[a.template], b.reward / full[b.template]) > stands_out
    ]
    if not pairs:
        return None
    apart = np.array([b.column - a.column for a, b in pairs], dtype=np.float64)
    extra = apart - np.array([after[a.template] + before[b.template] for a, b in pairs])
    cost, limit = step_cost / pixels**2, step_limit
    if np.abs(extra - np.median(extra)).mean() <= np.abs(apart - np.median(apart)).mean():
        return Spacing(before, after + float(np.median(extra)), cost, limit, gaps)
    return Spacing(np.zeros_like(before), np.full_like(after, float(np.median(apart))), cost, limit, gaps)


def place_bounds(
    placed: Sequence[Placed],
    half_cols: NDArray[np.int64],
    width: int,
    *,
    pixels: int,
    side_heights: float = 0.25,
) -> list[tuple[int, int]]:
    """Columns of each place: from halfway to the ink of one neighbour to halfway to that of the other.

    Args:
        placed: the characters.
        half_cols: (T,) half the ink's width of each template, pixels.
        width: width of the image.
        pixels: pixels per character height.
        side_heights: most land beside a character's ink that belongs to its place, character heights.
    """
    middles, half = np.array([p.column for p in placed]), half_cols[[p.template for p in placed]]
    left, right, side = middles - half, middles + half, round(side_heights * pixels)
    between = (right[:-1] + left[1:]) // 2
    low = np.maximum(left - side, np.r_[0, between])
    high = np.minimum(right + side, np.r_[between, width])
    return list(zip(np.maximum(low, 0).tolist(), np.minimum(high + 1, width).tolist(), strict=True))
