"""Intervals and tests: bootstrap by part, since trials of a part are dependent, and exact bounds of rare errors.

Clopper and Pearson 1934: the upper bound for k of n is the share at which k or fewer occur by chance in 1 of 20 cases.
No error among 6 parts therefore shows no more than "at most 39 %"; "at most 1 in 1,000" takes 2,995 parts without one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import CONFIDENCE_LEVEL, Share, share, share_bounds

RESAMPLES = 2000
# for an interval by resampling; of fewer it is far too narrow
LEAST_PARTS = 8
_SEED = 20240229
# number of sign patterns: all those of up to 14 differing parts and the added zero, else as many random ones
_FLIPS = 2**15
_FLIPS_SEED = 20240301


@dataclass(frozen=True)
class Estimate:
    """An estimate with its 95 % interval from resampling whole parts; None with fewer than `LEAST_PARTS` parts."""

    value: float
    low: float | None = None
    high: float | None = None


@lru_cache(maxsize=4)
def draw_parts(parts: int) -> NDArray[np.float64]:
    """(RESAMPLES, parts) counts of each part in samples of the same size with replacement."""
    rng = np.random.default_rng(_SEED)
    drawn = rng.multinomial(parts, np.full(parts, 1.0 / parts), size=RESAMPLES).astype(np.float64)
    drawn.flags.writeable = False
    return drawn


def exact_share(count: int, total: int) -> Share:
    """A share with Clopper and Pearson's one-sided 95 % bounds; the count lies between 0 and the total."""
    return Share(count, total, *share_bounds(count, total, confidence=CONFIDENCE_LEVEL))


def resample(
    counts: NDArray[np.float64],  # (parts, columns), of every part
    statistic: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    *,
    parts: int | None = None,  # that the statistic is about (default: all)
    least: float = 0.0,  # value of a part; the greatest is 1
) -> Estimate:
    """Estimate a statistic of sums over parts; the interval resamples whole parts (BCa bootstrap, Efron 1987).

    If all parts agree, the share of parts that differ is at most Wilson's bound for none of them, and the interval has
    their least and greatest value there. `statistic` turns (draws, columns) sums of counts into (draws,) values.
    """
    from scipy.special import ndtr, ndtri

    (value,), parts = statistic(counts.sum(axis=0)[None]), len(counts) if parts is None else parts
    if parts < LEAST_PARTS:
        return Estimate(float(value))
    again, without = statistic(draw_parts(len(counts)) @ counts), statistic(counts.sum(axis=0) - counts)
    again, off = again[np.isfinite(again)], np.nan_to_num(np.nanmean(without) - without)
    if np.ptp(again) < 1e-12:
        differ = share(0, parts).high
        return Estimate(
            float(value),
            float((1.0 - differ) * value + differ * least),
            float((1.0 - differ) * value + differ),
        )
    bias = ndtri(0.5 * (np.mean(again < value) + np.mean(again <= value)))
    skew = (off**3).sum() / (6.0 * (off**2).sum() ** 1.5)
    z = bias + ndtri([0.5 - 0.5 * CONFIDENCE_LEVEL, 0.5 + 0.5 * CONFIDENCE_LEVEL])
    low, high = np.quantile(again, ndtr(bias + z / (1.0 - skew * z)))
    return Estimate(float(value), float(low), float(high))


def ratio(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """(draws,) first column over the second, (draws, 2); NaN where the second is 0."""
    return np.where(sums[:, 1] > 0.0, sums[:, 0] / np.maximum(sums[:, 1], 1.0), np.nan)


def bootstrap_share(right: Sequence[float], total: Sequence[int], *, least: float = 0.0) -> Estimate:
    """A share of characters with its 95 % interval, by resampling whole parts. `right` and `total` are (parts,); for a
    difference of two readers the least share of a part is -1."""
    return (
        resample(np.array([right, total], dtype=np.float64).T, ratio, least=least)
        if sum(total)
        else Estimate(0.0)
    )


@dataclass(frozen=True)
class SerialTest:
    """McNemar's exact test: parts that only the first, or only the second mode read right."""

    only_first: int
    only_second: int
    p_differ: float  # two-sided, of a split at least as uneven, if both are equally good


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> SerialTest:
    """Compare two modes on the same parts, serial by serial; a ValueError if the lengths differ."""
    from scipy.stats import binomtest

    pairs = list(zip(first, second, strict=True))
    only_a, only_b = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    p_differ = binomtest(only_a, only_a + only_b, 0.5).pvalue if only_a + only_b else 1.0
    return SerialTest(only_a, only_b, float(p_differ))


@dataclass(frozen=True)
class CharacterTest:
    """Difference of two modes' shares of characters right, by resampling whole parts."""

    difference: Estimate
    p_differ: float  # two-sided, of one at least as large, if the modes are exchangeable on every part


def compare_characters(
    first: Sequence[float], second: Sequence[float], total: Sequence[int]
) -> CharacterTest:
    """Compare two modes by their characters right, (parts,) each: permutation test and bootstrap, both by part."""
    from scipy.stats import permutation_test

    gained = [a - b for a, b, _ in zip(first, second, total, strict=True)]
    differing = [d for d in gained if d]
    estimate = bootstrap_share(gained, total, least=-1.0)
    if not differing:
        return CharacterTest(estimate, 1.0)
    test = permutation_test(
        (np.array([*differing, 0.0]),),  # the test needs at least two values, and a zero changes nothing
        lambda x, axis: x.sum(axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=_FLIPS,
        random_state=np.random.default_rng(_FLIPS_SEED),
    )
    return CharacterTest(estimate, float(test.pvalue))


def holm(p_values: Sequence[float]) -> list[float]:
    """Correct p-values for their number (Holm 1979)."""
    p, order = np.asarray(p_values, dtype=np.float64), np.argsort(p_values, kind="stable")
    corrected = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1)))
    return [float(value) for value in corrected[np.argsort(order)]]
