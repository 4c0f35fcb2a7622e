"""The lines of a recording that are fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import median_abs_deviation

from glyphs.surface.display import OneLine
from glyphs.surface.maps import MapError
from whisker_array.arrays import Floats
from whisker_array.estimation.edges import usable_moments
from whisker_array.scan.scan import Scan
from whisker_array.whisker.passes import SweepPlan

MOST_TRACES = 96
JAM_LANDS = 1.7
"""Greatest moment used, in land moments; higher ones occur only in samples just before a tip jams."""
_BESIDE = 3


@dataclass(frozen=True, eq=False, repr=False)
class Trace(OneLine):
    """One recorded line of one whisker: (samples,) signal minus that in the air, NaN where unusable."""

    plan: SweepPlan
    cluster: int
    whisker: int
    line_mm: float
    measured_n_mm: Floats


def traces_of(scan: Scan, *, most: int = MOST_TRACES) -> tuple[Trace, ...]:
    """Choose the lines with the most relief of every whisker and sweep. Raises MapError without any."""
    groups: list[list[Trace]] = []
    cluster = 0
    for sweep in scan.sweeps:
        moment = usable_moments(scan, sweep)
        for whisker in range(moment.shape[1]):
            lines = [
                Trace(
                    sweep.plan,
                    cluster + p,
                    whisker,
                    float(sweep.plan.line_mm[p, whisker]),
                    mask_jams(moment[p, whisker]),
                )
                for p in range(moment.shape[0])
                if np.isfinite(moment[p, whisker]).mean() > 0.5
            ]
            if lines:
                groups.append(sorted(lines, key=_walls_n_mm, reverse=True))
        cluster += moment.shape[0]
    if not groups:
        raise MapError("no line of the recording can be used", hint="record passes that run over the piece")
    each = max(1, most // len(groups))
    # evenly from the better half, because the very best lines are alike
    chosen = [
        group[k]
        for group in groups
        for k in sorted({int(n) for n in np.linspace(0, max(0, len(group) // 2 - 1), min(each, len(group)))})
    ]
    return tuple(chosen)


def _walls_n_mm(trace: Trace) -> float:
    return float(np.nanstd(np.diff(trace.measured_n_mm)))


def mask_jams(moment_n_mm: Floats, *, share: float = 1.0) -> Floats:
    """Set the moments of a line to NaN at and beside samples above `share` of JAM_LANDS."""
    land = np.nanmedian(moment_n_mm)
    near = np.abs(moment_n_mm) > share * JAM_LANDS * np.abs(land)
    if not near.any():
        return moment_n_mm
    wide = np.convolve(near, np.ones(2 * _BESIDE + 1), mode="same") > 0.5
    return np.where(wide, np.nan, moment_n_mm)


def sample_sigma_n_mm(trace: Trace, scatter_n_mm: float, *, place_mm: float) -> Floats:
    """(samples,) uncertainty of each sample: its scatter and the effect of an error of position; inf where not used."""
    step = np.abs(np.diff(np.nan_to_num(trace.measured_n_mm, nan=0.0), prepend=np.nan, append=np.nan))
    steepest = np.fmax(step[1:], step[:-1]) / trace.plan.step_mm
    sigma = np.hypot(scatter_n_mm, place_mm * np.nan_to_num(steepest))
    return np.asarray(np.where(np.isnan(trace.measured_n_mm), np.inf, sigma))


def scatter_n_mm(traces: Sequence[Trace]) -> float:
    """Scatter of a sample from differences of neighbours, robust against edges."""
    steps = np.concatenate([np.diff(trace.measured_n_mm) for trace in traces])
    level = float(np.nanmedian(np.abs(np.concatenate([trace.measured_n_mm for trace in traces]))))
    return max(
        float(median_abs_deviation(steps, scale="normal", nan_policy="omit")) / math.sqrt(2.0), 1e-5 * level
    )
