"""What a fit makes of the difference between what was felt and what is predicted."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.traces import Trace

PLACE_MM = 0.005
"""By how much a stage's place is off: screws that are bought wave by as much with every turn."""
FEW = 4.0
"""Sigmas beyond which a residual is no scatter."""


class Loss(Enum):
    """What a residual costs beyond some sigmas, where tips slip around steep edges as they like."""

    HUBER = "in proportion"
    """Far from the answer too it tells the way."""
    BOUNDED = "no more than a few sigmas do"
    """Geman and McClure's: what jumps does not drown what the rest tells."""

    def of(self, misses: NDArray[np.float64]) -> float:
        """Twice the loss of residuals in sigmas."""
        size = np.abs(misses)
        if self is Loss.HUBER:
            return float(np.where(size <= FEW, size**2, 2.0 * FEW * size - FEW**2).sum())
        return float((size**2 / (1.0 + (size / FEW) ** 2)).sum())

    def weight(self, misses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of each residual in a sum of squares whose slope is the loss's."""
        size = np.abs(misses)
        if self is Loss.HUBER:
            return np.asarray(np.minimum(1.0, FEW / np.maximum(size, 1e-12)))
        return np.asarray((1.0 + (size / FEW) ** 2) ** -2.0)


def sample_sigma_n_mm(trace: Trace, scatter_n_mm: float) -> NDArray[np.float64]:
    """(samples,) uncertainty of each sample: its scatter, and what a place a little off makes of it."""
    step = np.abs(np.diff(np.nan_to_num(trace.felt_n_mm, nan=0.0), prepend=np.nan, append=np.nan))
    steepest = np.fmax(step[1:], step[:-1]) / trace.plan.step_mm
    return np.asarray(np.hypot(scatter_n_mm, PLACE_MM * np.nan_to_num(steepest)))


def residuals(traces: Sequence[Trace], predicted: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """(samples,) of every trace, 0 where it is not to be used."""
    return [np.nan_to_num(t.felt_n_mm - p, nan=0.0) for t, p in zip(traces, predicted, strict=True)]
