"""Calibration of confidences (of all readings with confidence p, a share p should be right), and risk against coverage:
the share of wrong serials among the most certain ones, as more are accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import Share, share

BINS = 10


@dataclass(frozen=True)
class ReliabilityBin:
    """Readings with about the same confidence: its mean, and the share of right ones."""

    confidence: float
    right: Share


@dataclass(frozen=True)
class Reliability:
    """A reliability diagram: bins that are not empty, and the expected calibration error, mean |right - confidence|."""

    bins: tuple[ReliabilityBin, ...]
    error: float


def reliability(confidences: Sequence[float], right: Sequence[bool], *, bins: int = BINS) -> Reliability:
    """Compute the diagram with bins of equal width, each closed above. Raises ValueError: no confidences, 0 to 1."""
    sure, is_right = np.asarray(confidences, dtype=np.float64), np.asarray(right, dtype=bool)
    if sure.shape != is_right.shape:
        raise ValueError(f"{sure.size} confidences for {is_right.size} readings")
    if sure.size == 0:
        return Reliability((), 0.0)
    if not (np.isfinite(sure).all() and sure.min() >= 0.0 and sure.max() <= 1.0):
        raise ValueError("a confidence lies between 0 and 1")
    places = np.clip(np.ceil(sure * bins).astype(np.int64) - 1, 0, bins - 1)
    filled = tuple(
        ReliabilityBin(float(sure[members].mean()), share(int(is_right[members].sum()), int(members.sum())))
        for members in (places == k for k in range(bins))
        if members.any()
    )
    off = sum(b.right.total * abs(b.right.value - b.confidence) for b in filled)
    return Reliability(filled, float(off / sure.size))


@dataclass(frozen=True, eq=False)
class RiskCoverage:
    """Risk, the share of wrong serials among the most certain ones, at coverages of 1/n, 2/n ... 1; both (n,). `area`
    is the AURC, the mean of the risk; `least_area` that of a confidence that puts every wrong serial last."""

    coverage: NDArray[np.float64]
    risk: NDArray[np.float64]
    area: float
    least_area: float

    def coverage_at(self, risk: float) -> float:
        within = self.coverage[self.risk <= risk + 1e-12]
        return float(within[-1]) if within.size else 0.0


def risk_coverage(confidences: Sequence[float], right: Sequence[bool]) -> RiskCoverage:
    """Compute the curve over readings, the most certain first. Raises ValueError: the lengths differ."""
    sure, wrong = np.asarray(confidences, dtype=np.float64), ~np.asarray(right, dtype=bool)
    if sure.shape != wrong.shape:
        raise ValueError(f"{sure.size} confidences for {wrong.size} readings")
    if sure.size == 0:
        return RiskCoverage(np.zeros(0), np.zeros(0), 0.0, 0.0)
    count = np.arange(1, sure.size + 1)
    levels, place = np.unique(-sure, return_inverse=True)
    # within a group of equal confidence every reading counts as the group's mean
    mean_wrong = np.bincount(place, weights=wrong) / np.bincount(place)
    expected = np.repeat(mean_wrong, np.bincount(place, minlength=levels.size))
    risk = np.cumsum(expected) / count
    best = np.cumsum(np.sort(wrong)) / count
    return RiskCoverage(count / sure.size, risk, float(risk.mean()), float(best.mean()))
