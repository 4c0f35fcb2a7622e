"""All ways to set a line of characters, summed: posteriors of every place without deciding where anything stands.

Characters follow each other as a font sets them: origin, ink, origin of the next one at the advance plus a
spacing that is about the same all along the line. With the evidence of every character at every column known,
sums from the left and from the right over all settings give the posterior of each place exactly::

    |<--- advance --->|<gap>|<--- advance --->|        evidence[c, x] : character c, its ink's middle at x
    o    ink(x)       e     o    ink(x')      e
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    low = round(GAP_REACH[0] * metrics.pixels)
    high = round((GAP_REACH[1] + (1.5 if wide else 0.0)) * metrics.pixels)
    gap = np.arange(low, high + 1) / metrics.pixels
    if wide:
        log = np.where(gap > 0.1, 0.0, -LOOSE_SLOPE * (0.1 - gap))
    elif gap_heights is None:
        log = -LOOSE_SLOPE * np.maximum(0.0, np.maximum(LOOSE_GAP[0] - gap, gap - LOOSE_GAP[1]))
    else:
        log = -np.minimum(0.5 * ((gap - gap_heights) / GAP_SIGMA) ** 2, GAP_COST)
    return low, np.asarray(log - np.logaddexp.reduce(log))


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
    for ends in setter.forward()[1]:
        out.append(float(np.logaddexp.reduce(ends)))
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
        count, cols = evidence.shape
        reach = int(max(metrics.before.max(), (metrics.advance - metrics.before).max(), 0)) + 1
        reach = max(reach, -int(min(metrics.before.min(), (metrics.advance - metrics.before).min(), 0)) + 1)
        self.width, self.cols, self.places = cols + 2 * reach, cols, allowed.shape[0]
        x = np.arange(cols)
        self.origin = x[None, :] + reach - metrics.before[:, None]
        self.end = self.origin + metrics.advance[:, None]
        # every character is as likely as another before anything is seen, and any column for the first
        with np.errstate(divide="ignore"):
            prior = np.log(allowed / np.maximum(allowed.sum(axis=1, keepdims=True), 1))
        self.evidence, self.prior, self.start = evidence, prior, -np.log(cols)
        usual = gap_log_prior(metrics, gap_heights=gap_heights)
        word = gap_log_prior(metrics, gap_heights=None, wide=True)
        self.gaps = [word if k in word_gaps else usual for k in range(self.places)]
        self.count = count

    def forward(self) -> tuple[list[Floats], list[Floats]]:
        """By place: (T, cols) sums of what ends in each character at each column; and by end column."""
        held, ends = [], []
        here = np.full(self.width, self.start)
        for k in range(self.places):
            value = self.evidence + self.prior[k][:, None] + here[self.origin]
            held.append(value)
            ends.append(self._gathered(value, self.end))
            here = self._moved(ends[-1], *self.gaps[k], back=False)
        return held, ends

    def settled(self) -> Settled | None:
        held, ends = self.forward()
        total = float(np.logaddexp.reduce(ends[-1]))
        if not np.isfinite(total):
            return None
        on = np.zeros(self.width)
        belief = np.empty((self.places, self.count))
        column = np.empty((self.places, self.count), dtype=np.int64)
        for k in range(self.places - 1, -1, -1):
            whole = held[k] + on[self.end]
            belief[k] = np.logaddexp.reduce(whole, axis=1) - total
            column[k] = whole.argmax(axis=1)
            if k:
                value = self.evidence + self.prior[k][:, None] + on[self.end]
                on = self._moved(self._gathered(value, self.origin), *self.gaps[k - 1], back=True)
        return Settled(belief, column, total)

    def _gathered(self, value: Floats, at: NDArray[np.int64]) -> Floats:
        """Log sums over characters of what lies at the same column after its own shift."""
        shifted = np.full((self.count, self.width), -np.inf)
        np.put_along_axis(shifted, at, value, axis=1)
        return _log_sum(shifted)

    def _moved(self, value: Floats, low: int, log: Floats, *, back: bool) -> Floats:
        """Log sums over spacings: ends to origins, or back."""
        n = log.size
        if back:
            padded = np.concatenate([np.full(max(0, -low), -np.inf), value, np.full(n + abs(low), -np.inf)])
            windows = np.lib.stride_tricks.sliding_window_view(padded, n)
            start = max(0, -low) + low
            return _log_sum((windows[start : start + self.width] + log).T)
        padded = np.concatenate([np.full(n + abs(low), -np.inf), value, np.full(n + abs(low), -np.inf)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, n)
        # origin o gathers ends o - low - n + 1 .. o - low
        start = n + abs(low) - low - n + 1
        return _log_sum((windows[start : start + self.width] + log[::-1]).T)


def _log_sum(values: Floats) -> Floats:
    """Log of the sum of exponentials over the first axis."""
    top = values.max(axis=0)
    safe = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(safe + np.log(np.exp(values - safe).sum(axis=0)))
