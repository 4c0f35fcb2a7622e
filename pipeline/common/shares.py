"""Shares and how sure they are: Wilson's interval."""

from __future__ import annotations

from dataclasses import dataclass

CONFIDENCE_LEVEL = 0.95


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
