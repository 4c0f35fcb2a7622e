"""How wrong a reader may be that was hardly ever wrong: exact bounds, and how many parts they take.

Clopper and Pearson 1934: the upper bound of k of n is the share at which k or fewer come by chance in 1 of 20. Nothing
wrong among 6 parts therefore shows no more than "at most 39 %"; "at most 1 in 1,000" takes 2,995 parts without one.
"""

from __future__ import annotations

import math

from pipeline.common.shares import CONFIDENCE_LEVEL, Share


class Bounded(Share):
    """A share whose `low` and `high` are exact one-sided bounds at 95 %, each by itself."""


def bounded(count: int, total: int) -> Bounded:
    """A share with Clopper and Pearson's one-sided 95 % bounds, each by itself.

    Raises:
        ValueError: more than all, or fewer than none.
    """
    from scipy.stats import beta

    chance = 1.0 - CONFIDENCE_LEVEL
    low = float(beta.ppf(chance, count, total - count + 1)) if count else 0.0
    high = float(beta.ppf(1.0 - chance, count + 1, total - count)) if count < total else 1.0
    return Bounded(count, total, low, high)


def parts_without_wrong(limit: float) -> int:
    """How many parts without a wrong one show that the share is at most the limit: ln(0.05) / ln(1 - limit).

    Raises:
        ValueError: a limit that is no share between 0 and 1.
    """
    if not 0.0 < limit < 1.0:
        raise ValueError(f"a limit of {limit} cannot be shown")
    return math.ceil(math.log(1.0 - CONFIDENCE_LEVEL) / math.log1p(-limit) - 1e-9)
