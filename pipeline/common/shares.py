"""Shares with confidence intervals: Wilson's, or the exact one of Clopper and Pearson."""

from __future__ import annotations

from dataclasses import dataclass, replace

CONFIDENCE_LEVEL = 0.95


@dataclass(frozen=True)
class Share:
    """k of n, with its 95 % interval; 0 to 1 without trials. Raises ValueError: the count is not within the total."""

    count: int
    total: int
    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0 <= self.count <= self.total:
            raise ValueError(f"{self.count} of {self.total} is not a share")

    @property
    def value(self) -> float:
        return self.count / self.total if self.total else 0.0


def share_bounds(count: int, total: int, *, confidence: float) -> tuple[float, float]:
    """Clopper and Pearson's one-sided bounds of a share, lower and upper, each by itself with this confidence. Raises
    ValueError: the count is not from 0 to the total, or the confidence does not lie between 0 and 1."""
    from scipy.special import betaincinv

    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total} is not a share")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"a confidence of {confidence} must lie between 0 and 1")
    low = float(betaincinv(count, total - count + 1, 1.0 - confidence)) if count else 0.0
    high = float(betaincinv(count + 1, total - count, confidence)) if count < total else 1.0
    return low, high


def share(count: int, total: int, *, exact: bool = False) -> Share:
    """A share with Wilson's 95 % interval, or the exact one, of independent trials. Raises ValueError: see `Share`."""
    unknown = Share(count, total, 0.0, 1.0)
    if total == 0:
        return unknown
    from scipy.stats import binomtest

    interval = binomtest(count, total).proportion_ci(CONFIDENCE_LEVEL, method="exact" if exact else "wilson")
    return replace(unknown, low=float(interval.low), high=float(interval.high))
