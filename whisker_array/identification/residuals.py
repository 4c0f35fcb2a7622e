r"""Residuals of a fit: measured minus predicted samples, whitened.

    measured - predicted = level + scatter,      level(n) = level(n - 1) + step,     sd of a step: WALK of the scatter

The level is the drift of the zero, and the creep of a gauge, which is not predicted. The innovations of a Kalman
filter for such a walk are independent (A. C. Harvey, Forecasting, Structural Time Series Models and the Kalman Filter,
1989, 4.1)::

    e = (v - l) / sqrt(P + sigma^2),     g = P / (P + sigma^2),     l += g (v - l),     P = P (1 - g) + step^2

They are linear in v, so derivatives of a prediction pass through the same filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import CONTRACTED, kernel, read_only
from whisker_array.identification.traces import Trace

WALK = 0.03
"""Step of a level's walk between two samples, divided by their scatter; measured on benches of known parameters."""
START_ERROR = 0.5
"""Error of a level at the start of a pass, divided by the scatter of a sample."""


def weight(residual: NDArray[np.float64], *, bound: float) -> NDArray[np.float64]:
    """Weight of each residual (in sigmas) in a sum of squares: that of Geman and McClure, whose loss is bounded.

    So the jumps of tips that slip at steep edges do not dominate the other samples. A residual beyond the bound
    counts as an outlier.
    """
    return np.asarray((1.0 + (residual / bound) ** 2) ** -2.0)


def sample_sigma_n_mm(trace: Trace, scatter_n_mm: float, *, place_mm: float = 0.005) -> NDArray[np.float64]:
    """(samples,) uncertainty of each sample: its scatter and the effect of an error of position; inf where not used.

    The position error `place_mm` is the amplitude of the waves of usual screws within a turn.
    """
    step = np.abs(np.diff(np.nan_to_num(trace.measured_n_mm, nan=0.0), prepend=np.nan, append=np.nan))
    steepest = np.fmax(step[1:], step[:-1]) / trace.plan.step_mm
    sigma = np.hypot(scatter_n_mm, place_mm * np.nan_to_num(steepest))
    return np.asarray(np.where(np.isnan(trace.measured_n_mm), np.inf, sigma))


def residuals(traces: Sequence[Trace], predicted: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Residuals (samples,) of every trace, 0 where a sample is not used."""
    return [np.nan_to_num(t.measured_n_mm - p, nan=0.0) for t, p in zip(traces, predicted, strict=True)]


def innovations(
    values: NDArray[np.float64], sigma: NDArray[np.float64], *, scatter: float
) -> NDArray[np.float64]:
    """Innovations e (see the module) of a trace's residuals or derivatives; 0 where a sample is not used.

    Args:
        values: (samples,) or (samples, n), N mm.
        sigma: (samples,) uncertainty of each, inf where it is not used.
        scatter: scatter of a sample; the walk of the level is a part of it.
    """
    given = np.ascontiguousarray(values.reshape(sigma.size, -1), dtype=np.float64)
    found = np.empty_like(given)
    _innovations(
        read_only(given), read_only(sigma), (START_ERROR * scatter) ** 2, (WALK * scatter) ** 2, found
    )
    return found.reshape(values.shape)


@kernel(allow=CONTRACTED)
def _innovations(values, sigma, spread, step, out):  # type: ignore[no-untyped-def]
    level = np.zeros(values.shape[1])
    for k in range(values.shape[0]):
        if math.isinf(sigma[k]):
            out[k, :] = 0.0
        else:
            whole = spread + sigma[k] * sigma[k]
            root, gain = 1.0 / math.sqrt(whole), spread / whole
            for c in range(level.size):
                off = values[k, c] - level[c]
                out[k, c] = off * root
                level[c] += gain * off
            spread *= 1.0 - gain
        spread += step
