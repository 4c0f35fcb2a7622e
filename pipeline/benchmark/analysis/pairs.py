"""Two modes on the same parts: is one better, or is it chance?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.analysis.shares import Estimate, drawn_parts

# patterns of signs: those of 14 parts that differ and of the nought beside them, else so many are drawn
_FLIPS = 2**15
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
    found = Estimate.of(d.sum() / n.sum(), (drawn @ d) / np.maximum(drawn @ n, 1.0))
    differing = d[d != 0.0]
    if not differing.size:
        return CharacterTest(found.value, found.low, found.high, 1.0, 1.0)
    p_differ, p_worse = (_sign_flips(differing, alternative) for alternative in ("two-sided", "less"))
    return CharacterTest(found.value, found.low, found.high, p_differ, p_worse)


def _sign_flips(d: NDArray[np.float64], alternative: str) -> float:
    """P of the sum of differences were the sign of each a coin's; every pattern is counted out for up to 14 parts."""
    from scipy.stats import permutation_test

    found = permutation_test(
        (np.append(d, 0.0),),  # the test takes at least two values, and a nought has no sign
        lambda x, axis: x.sum(axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=_FLIPS,
        alternative=alternative,
        random_state=np.random.default_rng(_SEED),
    )
    return float(found.pvalue)
