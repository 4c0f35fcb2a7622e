"""Calibration: of all readings with confidence p, a share p should be right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.shares import Share, share

BINS = 10


@dataclass(frozen=True)
class ReliabilityBin:
    """Readings of about one confidence.

    Attributes:
        confidence: mean of those said.
        right: share that was right.
    """

    confidence: float
    right: Share


@dataclass(frozen=True)
class Reliability:
    """A reliability diagram.

    Attributes:
        bins: those that hold anything, by confidence.
        error: expected calibration error: mean over all of |share right - mean confidence| of its bin.
    """

    bins: tuple[ReliabilityBin, ...]
    error: float


def reliability(confidences: Sequence[float], right: Sequence[bool], *, bins: int = BINS) -> Reliability:
    """The diagram over bins of equal width, each open below and closed above but for the first.

    Raises:
        ValueError: lengths that differ or confidences out of 0 to 1.
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
