"""Two modes on the same parts: is one better, or is it chance?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.shares import drawn_parts
from pipeline.common.shares import CONFIDENCE_LEVEL

MOST_EXACT = 14
"""Parts that differ up to which every pattern of signs is counted out: 2^14."""
_FLIPS = 20_000
_SEED = 20240301


@dataclass(frozen=True)
class SerialTest:
    """McNemar's exact test: of the parts that one mode read and the other did not.

    Attributes:
        only_first: right by the first alone.
        only_second: right by the second alone.
        p_differ: chance of so uneven a split, or a more uneven one, were both alike (two-sided).
        p_first_worse: chance of so few or fewer for the first were both alike (one-sided): small speaks for
            the first being worse.
    """

    only_first: int
    only_second: int
    p_differ: float
    p_first_worse: float


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> SerialTest:
    """Compare two modes on the same parts, serial by serial.

    Raises:
        ValueError: lengths that differ.
    """
    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    if a.shape != b.shape:
        raise ValueError(f"{a.size} parts against {b.size}; a paired test needs the same parts")
    only_a, only_b = int((a & ~b).sum()), int((b & ~a).sum())
    if only_a + only_b == 0:
        return SerialTest(0, 0, 1.0, 1.0)
    from scipy.stats import binomtest

    both = binomtest(only_a, only_a + only_b, 0.5)
    fewer = binomtest(only_a, only_a + only_b, 0.5, alternative="less")
    return SerialTest(only_a, only_b, float(both.pvalue), float(fewer.pvalue))


@dataclass(frozen=True)
class CharacterTest:
    """Characters right of two modes, compared part by part.

    Attributes:
        difference: share right of the first less that of the second.
        low: lower end of the 95 % interval of it, whole parts drawn again.
        high: upper end.
        p_differ: chance of so large a difference either way, were the modes exchangeable on every part.
        p_first_worse: chance of so low a difference.
    """

    difference: float
    low: float
    high: float
    p_differ: float
    p_first_worse: float


def compare_characters(first: Sequence[int], second: Sequence[int], total: Sequence[int]) -> CharacterTest:
    """Compare two modes on the same parts by their characters: permutation test and bootstrap, both by part.

    Args:
        first: (parts,) characters right by the first.
        second: (parts,) by the second.
        total: (parts,) characters.

    Raises:
        ValueError: lengths that differ.
    """
    n = np.asarray(total, dtype=np.float64)
    d = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    if d.shape != n.shape:
        raise ValueError(f"{d.size} parts against {n.size}; a paired test needs the same parts")
    if d.size == 0 or n.sum() == 0.0:
        return CharacterTest(0.0, 0.0, 0.0, 1.0, 1.0)
    drawn = drawn_parts(d.size)
    tail = 50.0 * (1.0 - CONFIDENCE_LEVEL)
    low, high = np.percentile((drawn @ d) / np.maximum(drawn @ n, 1.0), [tail, 100.0 - tail])
    p_differ, p_worse = _sign_flips(d[d != 0.0], np.random.default_rng(_SEED))
    return CharacterTest(float(d.sum() / n.sum()), float(low), float(high), p_differ, p_worse)


def _sign_flips(d: NDArray[np.float64], rng: np.random.Generator) -> tuple[float, float]:
    """(two-sided, lower one-sided) p of the sum when the sign of every part's difference is a coin's."""
    if d.size == 0:
        return 1.0, 1.0
    if d.size <= MOST_EXACT:
        patterns = np.arange(2**d.size)[:, None] >> np.arange(d.size)[None, :] & 1
        sums = (2.0 * patterns - 1.0) @ np.abs(d)
        extra = 0
    else:
        sums = rng.choice((-1.0, 1.0), size=(_FLIPS, d.size)) @ np.abs(d)
        # the pattern that was seen is one of those possible, so that p is never 0
        extra = 1
    seen, among = float(d.sum()), sums.size + extra
    differ = (int((np.abs(sums) >= math.fabs(seen) - 1e-9).sum()) + extra) / among
    worse = (int((sums <= seen + 1e-9).sum()) + extra) / among
    return differ, worse
