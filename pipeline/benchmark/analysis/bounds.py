"""Exact bounds of rare errors, and the number of parts that they take.

Clopper and Pearson 1934: the upper bound of k of n is the share at which k or fewer come by chance in 1 of 20. Nothing
wrong among 6 parts therefore shows no more than "at most 39 %"; "at most 1 in 1,000" takes 2,995 parts without one.
"""

from __future__ import annotations

from pipeline.common.shares import CONFIDENCE_LEVEL, Share
from recognition.decision.accepted_risk import parts_needed, share_bounds


class Bounded(Share):
    """A share whose `low` and `high` are exact one-sided bounds at 95 %, each by itself."""


def bounded(count: int, total: int) -> Bounded:
    """A share with Clopper and Pearson's one-sided 95 % bounds, each by itself.

    Raises:
        ValueError: more than all, or fewer than none.
    """
    low, high = share_bounds(count, total, confidence=CONFIDENCE_LEVEL)
    return Bounded(count, total, low, high)


def parts_without_wrong(limit: float) -> int:
    """Number of parts without a wrong one that shows a share of at most the limit: ln(0.05) / ln(1 - limit).

    Raises:
        ValueError: a limit that is no share between 0 and 1.
    """
    return parts_needed(limit, confidence=CONFIDENCE_LEVEL)
