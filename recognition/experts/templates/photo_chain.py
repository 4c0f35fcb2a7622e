"""All ways to set a line of characters, summed: posteriors of every place without deciding where anything stands.

Characters follow each other as a font sets them: origin, ink, origin of the next one at the advance plus a
spacing that is about the same all along the line. With the evidence of every character at every column known,
sums from the left and from the right over all settings give the posterior of each place exactly::

    |<--- advance --->|<gap>|<--- advance --->|        evidence[c, x] : character c, its ink's middle at x
    o    ink(x)       e     o    ink(x')      e
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel
from recognition.experts.templates.photo_shapes import PhotoShapes

Floats = NDArray[np.float64]
LOOSE_GAP = (-0.15, 0.55)
"""Spacing added to the advance that is taken for usual before the line's own is known, character heights."""
GAP_REACH, WORD_GAP = (-0.3, 1.2), 2.7
"""Least and greatest spacing at all, and greatest between words."""
LOOSE_SLOPE, GAP_SIGMA, GAP_COST = 12.0, 0.05, 6.0
"""Log odds lost a height beyond the usual; scatter about a known spacing; most that a spacing can cost."""


@dataclass(frozen=True, eq=False)
class Settled:
    """A line summed over all its settings.

    Attributes:
        log_belief: (places, T) posterior of each character at each place.
        column: (places, T) where each would stand, most probably.
        log_evidence: log Bayes factor of a line of so many characters against none.
    """

    log_belief: Floats
    column: NDArray[np.int64]
    log_evidence: float


def settled(
    evidence: Floats,
    shapes: PhotoShapes,
    allowed: NDArray[np.bool_],
    *,
    gap: float | None,
    word_gaps: frozenset[int],
) -> Settled | None:
    """Sum over all settings of a line; None where it has no room.

    Args:
        evidence: (T, cols) log Bayes factor of each character at each column against none.
        shapes: how the font sets them.
        allowed: (places, T) which characters may stand where, one at least.
        gap: spacing of the line, pixels, if known already.
        word_gaps: places after which a word gap lies.
    """
    places, cols = len(allowed), evidence.shape[1]
    before = np.round(shapes.middle).astype(np.int64)
    advance = np.round(shapes.advance).astype(np.int64)
    reach = int(np.abs(np.concatenate([before, advance - before])).max()) + 1
    with np.errstate(divide="ignore"):
        prior = np.log(allowed / allowed.sum(axis=1, keepdims=True))
    kinds = [_spacing(gap, shapes.pixels, word=word) for word in (False, True)]
    word = np.array([k in word_gaps for k in range(places)])
    belief, column, total = _sums(
        np.ascontiguousarray(evidence),
        prior,
        reach - before,
        reach - before + advance,
        cols + 2 * reach,
        word,
        *kinds[0],
        *kinds[1],
    )
    return Settled(belief - total, column, total) if np.isfinite(total) else None


@kernel()
def _sums(  # type: ignore[no-untyped-def]
    evidence, prior, origin, end, width, word, low, kernel, word_low, word_kernel
):
    """Log sums over all settings, by place and character; where each would stand; and of all.

    `here[k]` is what stands before place k by where its origin lies, `after[k]` what follows by where it ends.
    """
    places, count = prior.shape
    cols = evidence.shape[1]
    here, after = np.full((places, width), -np.inf), np.zeros((places, width))
    here[0] = -math.log(cols)
    belief, column = np.full((places, count), -np.inf), np.zeros((places, count), dtype=np.int64)
    total = -np.inf
    for k in range(places):
        ends, top = _gathered(evidence, prior[k], here[k], origin, end)
        if k + 1 == places:
            total = top + math.log(ends.sum()) if top > -np.inf else -np.inf
        elif word[k]:
            here[k + 1] = _moved(ends, top, word_low, word_kernel, 1)
        else:
            here[k + 1] = _moved(ends, top, low, kernel, 1)
    if total == -np.inf:
        return belief, column, total
    for k in range(places - 1, 0, -1):
        starts, top = _gathered(evidence, prior[k], after[k], end, origin)
        if word[k - 1]:
            after[k - 1] = _moved(starts, top, word_low, word_kernel, -1)
        else:
            after[k - 1] = _moved(starts, top, low, kernel, -1)
    for k in range(places):
        for c in range(count):
            if prior[k, c] == -np.inf:
                continue
            most, best = -np.inf, 0
            whole = np.empty(cols)
            for x in range(cols):
                whole[x] = evidence[c, x] + here[k, origin[c] + x] + after[k, end[c] + x]
                if whole[x] > most:
                    most, best = whole[x], x
            column[k, c] = best
            if most > -np.inf:
                belief[k, c] = prior[k, c] + most + math.log(np.exp(whole - most).sum())
    return belief, column, total


@kernel()
def _gathered(evidence, prior, come, from_, to):  # type: ignore[no-untyped-def]
    """Sums over a place's characters by the column `to` which they lead, shares of exp(the second value)."""
    count, cols = evidence.shape
    top = -np.inf
    for c in range(count):
        if prior[c] > -np.inf:
            for x in range(cols):
                top = max(top, evidence[c, x] + prior[c] + come[from_[c] + x])
    found = np.zeros(come.size)
    if top > -np.inf:
        for c in range(count):
            if prior[c] > -np.inf:
                for x in range(cols):
                    found[to[c] + x] += math.exp(evidence[c, x] + prior[c] + come[from_[c] + x] - top)
    return found, top


@kernel()
def _moved(values, top, low, kernel, sign):  # type: ignore[no-untyped-def]
    """out[y] = top + log sum over n of values[y - sign (low + n)] kernel[n]."""
    size = values.size
    found = np.zeros(size)
    for y in range(size):
        if values[y] > 0.0:
            for n in range(kernel.size):
                at = y + sign * (low + n)
                if 0 <= at < size:
                    found[at] += values[y] * kernel[n]
    for y in range(size):
        found[y] = top + math.log(found[y]) if found[y] > 0.0 else -np.inf
    return found


def gap_of(
    shapes: PhotoShapes, which: Sequence[int], columns: Sequence[int], word_gaps: frozenset[int]
) -> float | None:
    """Median spacing beyond the font's advance, pixels; None of a few characters."""
    at = np.asarray(columns) - shapes.middle[list(which)]
    gaps = np.diff(at) - shapes.advance[list(which)][:-1]
    usual = [gap for k, gap in enumerate(gaps) if k not in word_gaps]
    return float(np.median(usual)) if len(usual) > 1 else None


def _spacing(gap: float | None, pixels: int, *, word: bool) -> tuple[int, Floats]:
    """Least spacing, pixels, and the prior of it and of every further pixel; it sums to 1."""
    low = round(GAP_REACH[0] * pixels)
    gaps = np.arange(low, round((WORD_GAP if word else GAP_REACH[1]) * pixels) + 1) / pixels
    if word:
        log = -LOOSE_SLOPE * np.maximum(0.0, 0.1 - gaps)
    elif gap is None:
        log = -LOOSE_SLOPE * np.maximum(0.0, np.maximum(LOOSE_GAP[0] - gaps, gaps - LOOSE_GAP[1]))
    else:
        log = -np.minimum(0.5 * ((gaps - gap / pixels) / GAP_SIGMA) ** 2, GAP_COST)
    prior = np.exp(log - log.max())
    return low, prior / prior.sum()


def log_sum(values: Floats, axis: int) -> Floats:
    """Log of the sum of exponentials; numpy's own `logaddexp.reduce` takes several times as long."""
    top = np.maximum(values.max(axis=axis, keepdims=True), -1e300)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(values - top).sum(axis=axis)) + top.squeeze(axis))
