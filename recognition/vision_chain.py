"""All ways to set a line of characters, summed: posteriors of every place without deciding where anything stands.

Characters follow each other as a font sets them: origin, ink, origin of the next one at the advance plus a
spacing that is about the same all along the line. With the evidence of every character at every column known,
sums from the left and from the right over all settings give the posterior of each place exactly::

    |<--- advance --->|<gap>|<--- advance --->|        evidence[c, x] : character c, its ink's middle at x
    o    ink(x)       e     o    ink(x')      e
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from recognition.vision_sums import backward_sums, exponentials, forward_sums, log_sum, places_of

Floats = NDArray[np.float64]
LOOSE_GAP = (-0.15, 0.55)
"""Spacing added to the advance that is taken for usual before the line's own is known, character heights."""
GAP_REACH = (-0.3, 1.2)
"""Least and greatest spacing at all."""
LOOSE_SLOPE, GAP_SIGMA, GAP_COST = 12.0, 0.05, 6.0
"""Log odds lost a height beyond the usual; scatter about a known spacing; most that a spacing can cost."""


@dataclass(frozen=True, eq=False)
class Metrics:
    """How a font sets its characters, pixels.

    Attributes:
        before: (T,) from the origin to the middle of the ink.
        advance: (T,) from origin to origin.
        pixels: to the character height.
    """

    before: NDArray[np.int64]
    advance: NDArray[np.int64]
    pixels: int


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


def gap_log_prior(metrics: Metrics, *, gap_heights: float | None, wide: bool = False) -> tuple[int, Floats]:
    """Least spacing, pixels, and the log prior of it and every further pixel; it sums to 1 in probability.

    Args:
        metrics: of the font.
        gap_heights: of the line, if known already.
        wide: a word gap: anything from the usual to two heights more.
    """
    return _gap_log_prior(metrics.pixels, gap_heights, wide)


@lru_cache(maxsize=256)
def _gap_log_prior(pixels: int, gap_heights: float | None, wide: bool) -> tuple[int, Floats]:
    low = round(GAP_REACH[0] * pixels)
    high = round((GAP_REACH[1] + (1.5 if wide else 0.0)) * pixels)
    gap = np.arange(low, high + 1) / pixels
    if wide:
        log = np.where(gap > 0.1, 0.0, -LOOSE_SLOPE * (0.1 - gap))
    elif gap_heights is None:
        log = -LOOSE_SLOPE * np.maximum(0.0, np.maximum(LOOSE_GAP[0] - gap, gap - LOOSE_GAP[1]))
    else:
        log = -np.minimum(0.5 * ((gap - gap_heights) / GAP_SIGMA) ** 2, GAP_COST)
    log = log - np.logaddexp.reduce(log)
    log.flags.writeable = False
    return low, np.asarray(log)


def settle(
    evidence: Floats,
    metrics: Metrics,
    allowed: NDArray[np.bool_],
    *,
    gap_heights: float | None = None,
    word_gaps: frozenset[int] = frozenset(),
) -> Settled | None:
    """Sum over all settings of a line.

    Args:
        evidence: (T, cols) log Bayes factor of each character at each column against none.
        metrics: of the font, in the same pixels.
        allowed: (places, T) which characters may stand where.
        gap_heights: spacing of the line, if known already.
        word_gaps: places after which a word gap lies.

    Returns:
        The posteriors; None where the line has no room.
    """
    setter = _Setter(evidence, metrics, allowed, gap_heights, word_gaps)
    return setter.settled()


def count_evidence(
    evidence: Floats, metrics: Metrics, *, most: int, gap_heights: float | None = None
) -> Floats:
    """(most + 1,) log Bayes factor of a line of 0, 1, 2 ... characters, any of them, against none."""
    allowed = np.ones((most, evidence.shape[0]), dtype=np.bool_)
    setter = _Setter(evidence, metrics, allowed, gap_heights, frozenset())
    out = [0.0]
    out.extend(float(log_sum(ends)) for ends in setter.forward()[1])
    return np.array(out)


class _Setter:
    """The two sweeps over one line; columns are widened so that origins and ends fall inside."""

    def __init__(
        self,
        evidence: Floats,
        metrics: Metrics,
        allowed: NDArray[np.bool_],
        gap_heights: float | None,
        word_gaps: frozenset[int],
    ) -> None:
        cols = evidence.shape[1]
        reach = int(max(metrics.before.max(), (metrics.advance - metrics.before).max(), 0)) + 1
        reach = max(reach, -int(min(metrics.before.min(), (metrics.advance - metrics.before).min(), 0)) + 1)
        self.width, self.places = cols + 2 * reach, allowed.shape[0]
        # where the origin and the end of each character lie whose ink has its middle at column 0
        self.origin = np.asarray(reach - metrics.before, dtype=np.int64)
        self.end = self.origin + np.asarray(metrics.advance, dtype=np.int64)
        # every character is as likely as another before anything is seen, and any column for the first
        with np.errstate(divide="ignore"):
            self.prior = np.log(allowed / np.maximum(allowed.sum(axis=1, keepdims=True), 1))
        self.evidence, self.start = np.ascontiguousarray(evidence, dtype=np.float64), -math.log(cols)
        self.scaled = exponentials(self.evidence)
        kinds = [gap_log_prior(metrics, gap_heights=gap_heights)]
        if word_gaps:
            kinds.append(gap_log_prior(metrics, gap_heights=None, wide=True))
        self.low = np.array([low for low, _ in kinds], dtype=np.int64)
        # impossible spacings at the end make them all of one length
        self.gaps = np.full((len(kinds), max(log.size for _, log in kinds)), -np.inf)
        for row, (_, log) in zip(self.gaps, kinds, strict=True):
            row[: log.size] = log
        self.kind = np.array([int(k in word_gaps) for k in range(self.places)], dtype=np.int64)

    def forward(self) -> tuple[Floats, Floats]:
        """(places, width) sums by place: of what comes before each origin, and of what ends at each column."""
        here, ends = forward_sums(
            self.evidence, self.scaled, self.prior, self.origin, self.end,
            self.width, self.start, self.low, self.gaps, self.kind,
        )  # fmt: skip
        return here, ends

    def settled(self) -> Settled | None:
        here, ends = self.forward()
        total = float(log_sum(ends[-1]))
        if not np.isfinite(total):
            return None
        after = backward_sums(
            self.evidence, self.scaled, self.prior, self.origin, self.end,
            self.width, self.low, self.gaps, self.kind,
        )  # fmt: skip
        belief, column = places_of(self.evidence, self.prior, self.origin, self.end, here, after)
        return Settled(belief - total, column, total)
