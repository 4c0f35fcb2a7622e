"""Paired tests of two modes on the same parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.benchmark.analysis.shares import Estimate, bootstrap_share

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
    """

    only_first: int
    only_second: int
    p_differ: float


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> SerialTest:
    """Compare two modes on the same parts, serial by serial.

    Raises:
        ValueError: lengths that differ.
    """
    from scipy.stats import binomtest

    pairs = list(zip(first, second, strict=True))
    only_a, only_b = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    p_differ = binomtest(only_a, only_a + only_b, 0.5).pvalue if only_a + only_b else 1.0
    return SerialTest(only_a, only_b, float(p_differ))


@dataclass(frozen=True)
class CharacterTest:
    """Characters right of two modes, compared part by part.

    Attributes:
        difference: share right of the first less that of the second, whole parts drawn again.
        p_differ: chance of so large a difference either way, were the modes exchangeable on every part.
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
        ValueError: lengths that differ.
    """
    from scipy.stats import permutation_test

    less = [a - b for a, b, _ in zip(first, second, total, strict=True)]
    differing = [d for d in less if d]
    if not differing:
        return CharacterTest(Estimate(0.0, 0.0, 0.0), 1.0)
    found = permutation_test(
        (np.array([*differing, 0.0]),),  # the test takes at least two values, and a nought has no sign
        lambda x, axis: x.sum(axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=_FLIPS,
        random_state=np.random.default_rng(_SEED),
    )
    return CharacterTest(bootstrap_share(less, total), float(found.pvalue))
