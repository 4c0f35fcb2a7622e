"""Find the line of characters with the best score: a chain of non-overlapping windows.

The reward of a character is its width times (score^2 - threshold^2): a stroke of an H that is mistaken for an I earns
little; the H explains both stems and the bar. A format fixes the number of characters inside the search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel
from glyphs.fonts.glyph import Font

_NONE = -1e9


@dataclass(frozen=True)
class Placed:
    """A template placed on the line: index, pixel column of its reference point, and its reward."""

    template: int
    column: int
    reward: float


@dataclass(frozen=True, eq=False)
class Spacing:
    """Usual distance between the middles of neighbours: after[one] + before[next], pixels, (T,) of each template."""

    before: NDArray[np.float64]
    after: NDArray[np.float64]
    cost: float
    limit: float
    free_after: frozenset[int] = frozenset()


# fmt: off
@kernel()
def _before(  # type: ignore[no-untyped-def]
    best, by_template, half, start, overlap, reach, gap_free, gap_cost, expected, behind, step_cost, step_limit
):
    before, end = _NONE, -1
    for e in range(max(0, start - reach), min(best.size, start + overlap)):
        value = best[e] - gap_cost * max(0, start - e - gap_free)
        last = by_template[e]
        if step_limit > 0.0 and last >= 0:
            off = expected - (e - half[last]) - behind[last]
            value -= min(step_cost * off * off, step_limit)
        if value > before:
            before, end = value, e
    return before, end


@kernel()
def _chain(  # type: ignore[no-untyped-def]
    reward, half, allowed, free, overlap, reach, gap_free, gap_cost,
    ahead, behind, step_cost, step_limit, earlier, earlier_end, best, from_end, by_template,
):
    n_places, n_templates = allowed.shape
    cols = reward.shape[1]
    for k in range(n_places):
        placed, spaced = False, step_limit[k] > 0.0
        if k > 0 and not spaced:
            # the best predecessor depends only on where a character starts
            for start in range(cols):
                earlier[start], earlier_end[start] = _before(
                    best[k - 1], by_template[k - 1], half, start, overlap, reach, gap_free, gap_cost,
                    0.0, behind, 0.0, 0.0,
                )
        for t in range(n_templates):
            if not allowed[k, t]:
                continue
            for c in range(half[t], cols - half[t]):
                gain = reward[t, c]
                if gain <= 0.0 and free:
                    continue
                start, end = c - half[t], c + half[t]
                before, before_end = 0.0, -1
                if k > 0:
                    if spaced:
                        before, before_end = _before(
                            best[k - 1], by_template[k - 1], half, start, overlap, reach, gap_free, gap_cost,
                            c - ahead[t], behind, step_cost, step_limit[k],
                        )
                    else:
                        before, before_end = earlier[start], earlier_end[start]
                    if before_end < 0:
                        continue
                value = before + gain
                if value > best[k, end]:
                    best[k, end] = value
                    from_end[k, end] = before_end
                    by_template[k, end] = t
                    placed = True
        if not placed:
            return
# fmt: on


def best_chain(
    reward: NDArray[np.float32],
    half_cols: NDArray[np.int64],
    *,
    allowed: NDArray[np.bool_] | None,
    overlap: int,
    reach: int,
    gap_free: int,
    gap_cost: float,
    spacing: Spacing | None = None,
    most_characters: int = 64,
) -> tuple[float, tuple[Placed, ...]]:
    """Return the greatest reward of a chain and its characters, left to right; (0, ()) if there is no chain."""
    free = allowed is None
    table = np.ones((most_characters, reward.shape[0]), dtype=np.bool_) if allowed is None else allowed
    cols = reward.shape[1]
    if spacing is None:
        spacing = Spacing(np.zeros(reward.shape[0]), np.zeros(reward.shape[0]), 0.0, 0.0)
    limit = np.full(table.shape[0], spacing.limit)
    limit[[k + 1 for k in spacing.free_after if k + 1 < limit.size]] = 0.0
    best = np.full((table.shape[0], cols), _NONE)
    from_end = np.full((table.shape[0], cols), -1, dtype=np.int64)
    by_template = np.full((table.shape[0], cols), -1, dtype=np.int64)
    _chain(
        np.ascontiguousarray(reward), np.ascontiguousarray(half_cols), table, free,
        overlap, reach, gap_free, float(gap_cost), spacing.before, spacing.after,
        float(spacing.cost), limit, np.empty(cols), np.empty(cols, dtype=np.int64), best, from_end, by_template,
    )  # fmt: skip
    k = int(np.unravel_index(int(np.argmax(best)), best.shape)[0]) if free else table.shape[0] - 1
    end = int(np.argmax(best[k]))
    total = float(best[k, end])
    if total <= _NONE / 2:
        return 0.0, ()
    placed = []
    while k >= 0:
        t = int(by_template[k, end])
        column = end - int(half_cols[t])
        placed.append(Placed(template=t, column=column, reward=float(reward[t, column])))
        end, k = int(from_end[k, end]), k - 1
    return total, tuple(reversed(placed))


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
    """Estimate the spacing of the font plus a constant, or an even one, from neighbours that stand out."""
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
    """Columns of each place: from halfway to one neighbour's ink, or `side_heights` of land, to the other's."""
    middles, half = np.array([p.column for p in placed]), half_cols[[p.template for p in placed]]
    left, right, side = middles - half, middles + half, round(side_heights * pixels)
    between = (right[:-1] + left[1:]) // 2
    low = np.maximum(left - side, np.r_[0, between])
    high = np.minimum(right + side, np.r_[between, width])
    return list(zip(np.maximum(low, 0).tolist(), np.minimum(high + 1, width).tolist(), strict=True))
