"""Calibration of confidences, and risk against coverage.

Calibration: of all readings with confidence p, a share p should be right.

Risk-coverage curve: the share of wrong serials among the most certain ones, as more are accepted::

    risk |            .--  all are accepted: the share of wrong serials
         |        .--'
         |______-'         a good confidence keeps the risk at 0 until only wrong ones are left
         +--------------
           coverage   1
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import Share, share

BINS = 10


@dataclass(frozen=True)
class ReliabilityBin:
    """Readings with about the same confidence.

    Attributes:
        confidence: mean of the reported confidences.
        right: share of right readings.
    """

    confidence: float
    right: Share


@dataclass(frozen=True)
class Reliability:
    """A reliability diagram.

    Attributes:
        bins: bins that are not empty, by confidence.
        error: expected calibration error: mean over all readings of |share right - mean confidence| of their bin.
    """

    bins: tuple[ReliabilityBin, ...]
    error: float


def reliability(confidences: Sequence[float], right: Sequence[bool], *, bins: int = BINS) -> Reliability:
    """Compute the diagram with bins of equal width, each open below (except the first) and closed above.

    Raises:
        ValueError: the lengths differ, or a confidence is not between 0 and 1.
    """
    said, was = np.asarray(confidences, dtype=np.float64), np.asarray(right, dtype=bool)
    if said.shape != was.shape:
        raise ValueError(f"{said.size} confidences for {was.size} readings")
    if said.size == 0:
        return Reliability((), 0.0)
    if not (np.isfinite(said).all() and said.min() >= 0.0 and said.max() <= 1.0):
        raise ValueError("a confidence lies between 0 and 1")
    where = np.clip(np.ceil(said * bins).astype(np.int64) - 1, 0, bins - 1)
    filled = tuple(
        ReliabilityBin(
            float(said[where == k].mean()), share(int(was[where == k].sum()), int((where == k).sum()))
        )
        for k in range(bins)
        if (where == k).any()
    )
    off = sum(b.right.total * abs(b.right.value - b.confidence) for b in filled)
    return Reliability(filled, float(off / said.size))


@dataclass(frozen=True, eq=False)
class RiskCoverage:
    """Risk against coverage.

    Attributes:
        coverage: (n,) 1/n, 2/n ... 1.
        risk: (n,) share of wrong serials among the most certain ones; equally certain ones are in expected random
            order.
        area: AURC, the mean of the risk.
        least_area: AURC of a confidence that puts every wrong serial last.
    """

    coverage: NDArray[np.float64]
    risk: NDArray[np.float64]
    area: float
    least_area: float

    def coverage_at(self, risk: float) -> float:
        """The largest coverage at which the risk does not exceed a limit; 0 if there is none."""
        within = self.coverage[self.risk <= risk + 1e-12]
        return float(within[-1]) if within.size else 0.0


def risk_coverage(confidences: Sequence[float], right: Sequence[bool]) -> RiskCoverage:
    """Compute the curve over readings, the most certain first.

    Raises:
        ValueError: the lengths differ.
    """
    said, wrong = np.asarray(confidences, dtype=np.float64), ~np.asarray(right, dtype=bool)
    if said.shape != wrong.shape:
        raise ValueError(f"{said.size} confidences for {wrong.size} readings")
    if said.size == 0:
        return RiskCoverage(np.zeros(0), np.zeros(0), 0.0, 0.0)
    count = np.arange(1, said.size + 1)
    levels, place = np.unique(-said, return_inverse=True)
    # within a group of equal confidence every reading counts as the group's mean
    mean_wrong = np.bincount(place, weights=wrong) / np.bincount(place)
    expected = np.repeat(mean_wrong, np.bincount(place, minlength=levels.size))
    risk = np.cumsum(expected) / count
    best = np.cumsum(np.sort(wrong)) / count
    return RiskCoverage(count / said.size, risk, float(risk.mean()), float(best.mean()))
