"""Intervals of shares: bootstrap by part, where trials belong together, and exact bounds of rare errors.

Clopper and Pearson 1934: the upper bound of k of n is the share at which k or fewer come by chance in 1 of 20. Nothing
wrong among 6 parts therefore shows no more than "at most 39 %"; "at most 1 in 1,000" takes 2,995 parts without one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import CONFIDENCE_LEVEL, Share
from recognition.decision.accepted_risk import share_bounds

RESAMPLES = 2000
_SEED = 20240229


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval, whole parts drawn again.

    Attributes:
        value: as measured.
        low: lower end.
        high: upper end.
    """

    value: float
    low: float
    high: float

    @property
    def sure(self) -> bool:
        """True if the interval excludes zero."""
        return self.low > 0.0 or self.high < 0.0

    @classmethod
    def of(cls, value: float, again: NDArray[np.float64]) -> Estimate:
        """A number with the percentiles of what each draw gives.

        Args:
            value: as measured.
            again: (draws,) NaN where a draw says nothing; the value alone where none says anything.
        """
        known = again[np.isfinite(again)]
        tail = 50.0 * (1.0 - CONFIDENCE_LEVEL)
        low, high = np.percentile(known, [tail, 100.0 - tail]) if known.size else (value, value)
        return cls(float(value), float(low), float(high))


@lru_cache(maxsize=4)
def draw_parts(parts: int) -> NDArray[np.float64]:
    """(RESAMPLES, parts) how often each part comes when as many are drawn again, with putting back."""
    rng = np.random.default_rng(_SEED)
    drawn = rng.multinomial(parts, np.full(parts, 1.0 / parts), size=RESAMPLES).astype(np.float64)
    drawn.flags.writeable = False
    return drawn


def exact_share(count: int, total: int) -> Share:
    """A share with Clopper and Pearson's one-sided 95 % bounds, each by itself.

    Raises:
        ValueError: more than all, or fewer than none.
    """
    return Share(count, total, *share_bounds(count, total, confidence=CONFIDENCE_LEVEL))


def bootstrap_share(right: Sequence[int], total: Sequence[int]) -> Estimate:
    """A share of characters with its 95 % interval, whole parts drawn again (percentile bootstrap).

    Characters of one part share its dirt, so that they are not independent. Where every part is alike nothing
    varies and the interval has no width; Wilson's then tells more.

    Args:
        right: (parts,) characters right, or the difference of two readers'.
        total: (parts,) characters.
    """
    k, n = np.asarray(right, dtype=np.float64), np.asarray(total, dtype=np.float64)
    if k.size == 0 or n.sum() == 0.0:
        return Estimate(0.0, 0.0, 1.0)
    drawn = draw_parts(k.size)
    chars = drawn @ n
    again = np.where(chars > 0.0, (drawn @ k) / np.maximum(chars, 1.0), np.nan)
    return Estimate.of(k.sum() / n.sum(), again)
