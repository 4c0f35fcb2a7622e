"""Shares and how sure they are: Wilson's interval, and resampling of whole parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CONFIDENCE_LEVEL = 0.95
RESAMPLES = 2000
_SEED = 20240229


@dataclass(frozen=True)
class Share:
    """k of n, with its interval.

    Attributes:
        count: how many.
        total: of how many.
        low: lower end of Wilson's 95 % interval; 0 of nothing.
        high: upper end; 1 of nothing.
    """

    count: int
    total: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The share; 0 of nothing."""
        return self.count / self.total if self.total else 0.0


def share(count: int, total: int) -> Share:
    """A share with Wilson's 95 % interval, which takes the trials for independent.

    Raises:
        ValueError: more than all, or fewer than none.
    """
    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total} is not a share")
    if total == 0:
        return Share(0, 0, 0.0, 1.0)
    from scipy.stats import binomtest

    interval = binomtest(count, total).proportion_ci(CONFIDENCE_LEVEL, method="wilson")
    return Share(count, total, float(interval.low), float(interval.high))


def resampled(right: Sequence[int], total: Sequence[int]) -> tuple[float, float]:
    """95 % interval of a share of characters, whole parts drawn again (percentile bootstrap).

    Characters of one part share its dirt, so that they are not independent. Where every part is alike nothing
    varies and the interval has no width; Wilson's then tells more.

    Args:
        right: (parts,) characters right.
        total: (parts,) characters.
    """
    k, n = np.asarray(right, dtype=np.float64), np.asarray(total, dtype=np.float64)
    if k.size == 0 or n.sum() == 0.0:
        return (0.0, 1.0)
    rng = np.random.default_rng(_SEED)
    drawn = rng.multinomial(k.size, np.full(k.size, 1.0 / k.size), size=RESAMPLES)
    chars = drawn @ n
    shares = (drawn @ k) / np.where(chars > 0.0, chars, 1.0)
    tail = 50.0 * (1.0 - CONFIDENCE_LEVEL)
    low, high = np.percentile(shares[chars > 0.0], [tail, 100.0 - tail])
    return (float(low), float(high))
