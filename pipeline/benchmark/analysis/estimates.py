"""Intervals and paired tests: bootstrap by part, since trials of a part are dependent, and exact bounds of rare errors.

Clopper and Pearson 1934: the upper bound for k of n is the share at which k or fewer occur by chance in 1 of 20 cases.
No error among 6 parts therefore shows no more than "at most 39 %"; "at most 1 in 1,000" takes 2,995 parts without one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import CONFIDENCE_LEVEL, Share, share_bounds

RESAMPLES = 2000
_SEED = 20240229
# number of sign patterns: all those of up to 14 differing parts and the added zero, else as many random ones
_FLIPS = 2**15
_FLIPS_SEED = 20240301


@dataclass(frozen=True)
class Estimate:
    """An estimate with its 95 % interval from resampling whole parts.

    Attributes:
        value: measured value.
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
        """Make an estimate from its value and the percentiles over all draws.

        Args:
            value: measured value.
            again: (draws,) values of the draws, NaN if undefined; if all are NaN, the interval is the value.
        """
        known = again[np.isfinite(again)]
        tail = 50.0 * (1.0 - CONFIDENCE_LEVEL)
        low, high = np.percentile(known, [tail, 100.0 - tail]) if known.size else (value, value)
        return cls(float(value), float(low), float(high))


@lru_cache(maxsize=4)
def draw_parts(parts: int) -> NDArray[np.float64]:
    """(RESAMPLES, parts) counts of each part in samples of the same size with replacement."""
    rng = np.random.default_rng(_SEED)
    drawn = rng.multinomial(parts, np.full(parts, 1.0 / parts), size=RESAMPLES).astype(np.float64)
    drawn.flags.writeable = False
    return drawn


def exact_share(count: int, total: int) -> Share:
    """A share with Clopper and Pearson's one-sided 95 % bounds.

    Raises:
        ValueError: the count is below 0 or above the total.
    """
    return Share(count, total, *share_bounds(count, total, confidence=CONFIDENCE_LEVEL))


def bootstrap_share(right: Sequence[int], total: Sequence[int]) -> Estimate:
    """A share of characters with its 95 % interval, by resampling whole parts (percentile bootstrap).

    Characters of one part share its dirt, so they are not independent. If all parts have the same share, the interval
    has no width, and Wilson's is more informative.

    Args:
        right: (parts,) characters right, or the difference between two readers.
        total: (parts,) characters.
    """
    k, n = np.asarray(right, dtype=np.float64), np.asarray(total, dtype=np.float64)
    if k.size == 0 or n.sum() == 0.0:
        return Estimate(0.0, 0.0, 1.0)
    drawn = draw_parts(k.size)
    chars = drawn @ n
    again = np.where(chars > 0.0, (drawn @ k) / np.maximum(chars, 1.0), np.nan)
    return Estimate.of(k.sum() / n.sum(), again)


@dataclass(frozen=True)
class SerialTest:
    """McNemar's exact test on the parts that one mode read and the other did not.

    Attributes:
        only_first: number of parts that only the first read right.
        only_second: number of parts that only the second read right.
        p_differ: two-sided probability of a split at least as uneven, if both are equally good.
    """

    only_first: int
    only_second: int
    p_differ: float


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> SerialTest:
    """Compare two modes on the same parts, serial by serial.

    Raises:
        ValueError: the lengths differ.
    """
    from scipy.stats import binomtest

    pairs = list(zip(first, second, strict=True))
    only_a, only_b = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    p_differ = binomtest(only_a, only_a + only_b, 0.5).pvalue if only_a + only_b else 1.0
    return SerialTest(only_a, only_b, float(p_differ))


@dataclass(frozen=True)
class CharacterTest:
    """Comparison of the characters right of two modes, part by part.

    Attributes:
        difference: share right of the first minus that of the second, by resampling whole parts.
        p_differ: two-sided probability of a difference at least as large, if the modes are exchangeable on every part.
    """

    difference: Estimate
    p_differ: float


def compare_characters(first: Sequence[int], second: Sequence[int], total: Sequence[int]) -> CharacterTest:
    """Compare two modes on the same parts by their characters: permutation test and bootstrap, both by part.

    Args:
        first: (parts,) characters right by the first.
        second: (parts,) by the second.
        total: (parts,) characters.

    Raises:
        ValueError: the lengths differ.
    """
    from scipy.stats import permutation_test

    gained = [a - b for a, b, _ in zip(first, second, total, strict=True)]
    differing = [d for d in gained if d]
    if not differing:
        return CharacterTest(Estimate(0.0, 0.0, 0.0), 1.0)
    found = permutation_test(
        (np.array([*differing, 0.0]),),  # the test needs at least two values, and a zero changes nothing
        lambda x, axis: x.sum(axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=_FLIPS,
        random_state=np.random.default_rng(_FLIPS_SEED),
    )
    return CharacterTest(bootstrap_share(gained, total), float(found.pvalue))
