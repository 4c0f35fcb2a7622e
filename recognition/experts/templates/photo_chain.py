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
    (places, count), cols = allowed.shape, evidence.shape[1]
    before = np.round(shapes.middle).astype(np.int64)
    advance = np.round(shapes.advance).astype(np.int64)
    reach = int(np.abs(np.concatenate([before, advance - before])).max()) + 1
    # where the origin and the end of each character lie whose ink has its middle at column 0
    origin, end = (
        (reach - before)[:, None] + np.arange(cols),
        (reach - before + advance)[:, None] + np.arange(cols),
    )
    width = cols + 2 * reach
    with np.errstate(divide="ignore"):
        prior = np.log(allowed / allowed.sum(axis=1, keepdims=True))
    spacings = [_spacing(gap, shapes.pixels, word=k in word_gaps) for k in range(places - 1)]
    here = np.full((places, width), -np.inf)
    here[0] = -math.log(cols)
    after = np.zeros((places, width))
    total = -np.inf
    for k in range(places):
        ends = _gathered(evidence + prior[k][:, None] + here[k][origin], end, width)
        if k + 1 < places:
            here[k + 1] = _moved(ends, *spacings[k], sign=1)
        else:
            total = float(log_sum(ends, 0))
    if not np.isfinite(total):
        return None
    for k in range(places - 1, 0, -1):
        starts = _gathered(evidence + prior[k][:, None] + after[k][end], origin, width)
        after[k - 1] = _moved(starts, *spacings[k - 1], sign=-1)
    belief, column = np.full((places, count), -np.inf), np.zeros((places, count), dtype=np.int64)
    for k in range(places):
        whole = evidence + prior[k][:, None] + here[k][origin] + after[k][end]
        belief[k], column[k] = log_sum(whole, 1), whole.argmax(axis=1)
    return Settled(belief - total, column, total)


def gap_of(
    shapes: PhotoShapes, which: Sequence[int], columns: Sequence[int], word_gaps: frozenset[int]
) -> float | None:
    """Median spacing beyond the font's advance, pixels; None of a few characters."""
    at = np.asarray(columns) - shapes.middle[list(which)]
    gaps = np.diff(at) - shapes.advance[list(which)][:-1]
    usual = [gap for k, gap in enumerate(gaps) if k not in word_gaps]
    return float(np.median(usual)) if len(usual) > 1 else None


def _spacing(gap: float | None, pixels: int, *, word: bool) -> tuple[int, Floats]:
    """Least spacing, pixels, and the log prior of it and every further pixel; it sums to 1 in probability."""
    low = round(GAP_REACH[0] * pixels)
    gaps = np.arange(low, round((WORD_GAP if word else GAP_REACH[1]) * pixels) + 1) / pixels
    if word:
        log = -LOOSE_SLOPE * np.maximum(0.0, 0.1 - gaps)
    elif gap is None:
        log = -LOOSE_SLOPE * np.maximum(0.0, np.maximum(LOOSE_GAP[0] - gaps, gaps - LOOSE_GAP[1]))
    else:
        log = -np.minimum(0.5 * ((gaps - gap / pixels) / GAP_SIGMA) ** 2, GAP_COST)
    return low, log - log_sum(log, 0)


def _gathered(values: Floats, at: NDArray[np.int64], width: int) -> Floats:
    """(width,) log sums of values (T, cols) that belong to the columns `at`."""
    wide = np.full((values.shape[0], width), -np.inf)
    np.put_along_axis(wide, at, values, axis=1)
    return log_sum(wide, 0)


def _moved(values: Floats, low: int, log: Floats, *, sign: int) -> Floats:
    """out[y] = log sum over n of values[y - sign (low + n)] + log[n]: a convolution of exponentials."""
    top = float(values.max())
    if not np.isfinite(top):
        return np.full_like(values, -np.inf)
    kernel = np.exp(log)
    full = np.convolve(np.exp(values - top), kernel if sign > 0 else kernel[::-1])
    # of the full convolution, index i stands for y = i + low, or for y = i - (low + size - 1)
    first = -low if sign > 0 else low + log.size - 1
    padded = np.concatenate([np.zeros(max(0, -first)), full[max(0, first) :], np.zeros(values.size)])
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(padded[: values.size]) + top)


def log_sum(values: Floats, axis: int) -> Floats:
    """Log of the sum of exponentials; numpy's own `logaddexp.reduce` takes several times as long."""
    top = np.maximum(values.max(axis=axis, keepdims=True), -1e300)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(values - top).sum(axis=axis)) + top.squeeze(axis))
