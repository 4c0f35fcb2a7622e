"""Fit the land of a sweep: the moment of undisturbed surface under every sample.

The land is the level that most samples share; marks stand out from it on one side or the other. Each
whisker's gain is read off where whiskers meet; then a quadratic over the plate (the mounting's tilt, a slight
dome) is fitted robustly to all lines of a sweep, and each line's drift is read off against it. Nothing here
looks at edges.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import read_only
from whisker_array.estimation.land_fit import (
    fit_quadratic,
    quadratic,
    robust_lines,
    running_median,
    shortest,
)

LAND_SHARE = 0.35
"""Share of samples that must agree on a level to make it land: less than a full line of text leaves."""
TUKEY_CUT = 0.05
"""Samples further than this from the expected land, relative to it, have no say: marks are 10 % and more."""
DAMPING = 1e-9
"""Damping of the fit's normal equations, as a share of their trace: unseen terms stay zero."""
MIN_INLIERS = 0.15
"""A line with fewer land samples than this takes its land from the neighbours alone."""
NEIGHBOUR_LINES = 9
MAX_DRIFT = 0.03
"""Drift of one line against its neighbours, at most: more is surface."""


def shorth(values: NDArray[np.float64], *, share: float = LAND_SHARE) -> NDArray[np.float64]:
    """Centre of the shortest interval that holds a share of the samples of the last axis; NaN are left out.

    A robust mode (Grübel 1988): unlike the median it stays on the land when marks cover half a line on one
    side.
    Rows without any sample give NaN.
    """
    ordered = np.sort(values, axis=-1)
    return shortest(ordered.reshape(-1, ordered.shape[-1]), share).reshape(ordered.shape[:-1])


def plate_land(moment: NDArray[np.float64]) -> NDArray[np.float64]:
    """Land of a whole sweep, (lines, samples): a robust quadratic in both directions; NaN are left out."""
    lines, samples = moment.shape
    u, v = np.linspace(-1.0, 1.0, samples), np.linspace(-1.0, 1.0, lines)
    return quadratic(land_coefficients(moment), u, v)


def land_coefficients(moment: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit the land of a sweep, (lines, samples): (6,) of 1, u, v, u^2, u v, v^2, each from -1 to 1; NaN are left out.

    The start is flat at the most common level, or tilted as the levels of lines and of columns say, so a tilt
    of many times the mark's depth does no harm; the fit is then tightened around it. All zero where most samples
    feel nothing at all.
    """
    lines, samples = moment.shape
    u, v = np.linspace(-1.0, 1.0, samples), np.linspace(-1.0, 1.0, lines)
    level = float(shorth(moment.reshape(1, -1))[0])
    if level == 0.0:
        return np.zeros(6)  # there is no land to fit
    best_coefficients, best_inliers = np.zeros(6), -1.0
    # of the two starts the better explains more samples
    step_l, step_s = max(1, lines // 40), max(1, samples // 80)
    thin, at_u, at_v = moment[::step_l, ::step_s], u[::step_s], v[::step_l]
    cuts = np.array([0.2, 0.1, 0.07, TUKEY_CUT, TUKEY_CUT]) * abs(level)
    flat = np.array([level, 0.0, 0.0, 0.0, 0.0, 0.0])
    for coefficients in (flat, _tilted_start(thin, at_u, at_v, level)):
        inliers = fit_quadratic(
            thin, at_u, at_v, level, cuts, DAMPING, 0.5 * TUKEY_CUT * abs(level), coefficients
        )
        if inliers > best_inliers + 1e-9:
            best_inliers, best_coefficients = inliers, coefficients
    return best_coefficients


def divide_by_land(lines: NDArray[np.float64], coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moments over their land's, (lines, samples), in place of the moments."""
    u, v = np.linspace(-1.0, 1.0, lines.shape[1]), np.linspace(-1.0, 1.0, lines.shape[0])
    lines /= quadratic(coefficients, u, v)
    return lines


def _tilted_start(
    thin: NDArray[np.float64], u: NDArray[np.float64], v: NDArray[np.float64], level: float
) -> NDArray[np.float64]:
    """Quadratic coefficients from the robust level of each line (across) and of each column (along)."""
    coefficients = np.zeros(6)
    coefficients[0] = level
    across, along = shorth(thin), shorth(thin.T)
    for levels, at, linear, square in ((along, u, 1, 3), (across, v, 2, 5)):
        known = np.isfinite(levels)
        if known.sum() < 8:
            continue
        # the slope of most neighbours (Theil-Sen on a few pairs), then no curvature to begin with
        k = max(1, int(known.sum()) // 3)
        y, x = levels[known], at[known]
        slopes = np.sort((y[k:] - y[:-k]) / (x[k:] - x[:-k]))
        slope = float(0.5 * (slopes[(slopes.size - 1) // 2] + slopes[slopes.size // 2]))
        coefficients[linear] = slope
        coefficients[square] = 0.0
    return coefficients


def whisker_gain(lines: NDArray[np.float64], whisker: NDArray[np.int64]) -> NDArray[np.float64]:
    """Relative gain of each line's whisker, (lines,), from neighbouring lines that different whiskers felt.

    Two whiskers that meet at a border feel nearly the same surface there, mark or land, so the median ratio
    of their samples is the ratio of their gains; the surface's own slope across the border is read off the
    lines next to it and taken away. All borders are reconciled by least squares, with mean gain 1.
    """
    names = np.unique(whisker)
    border = np.flatnonzero(whisker[1:] != whisker[:-1])
    if names.size < 2 or border.size == 0:
        return np.ones(whisker.size)
    # the steps across the borders and those beside them; the others are not asked for
    asked = np.unique(np.clip(border[:, None] + np.array([-1, 0, 1]), 0, whisker.size - 2))
    known = np.zeros(whisker.size - 1, dtype=np.bool_)
    middle = np.zeros(whisker.size - 1)
    middle[asked], known[asked] = _log_step(lines, asked)
    index = np.searchsorted(names, whisker)
    steps = []
    for i in border:
        if not known[i]:
            continue
        beside = [
            j for j in (i - 1, i + 1) if 0 <= j < known.size and known[j] and whisker[j] == whisker[j + 1]
        ]
        slope = sum(float(middle[j]) for j in beside) / max(len(beside), 1)
        steps.append((int(index[i]), int(index[i + 1]), float(middle[i] - slope)))
    solution = reconcile_steps(steps, names.size)
    gain: NDArray[np.float64] = np.exp(solution[index])
    return gain


def reconcile_steps(steps: Sequence[tuple[int, int, float]], n: int) -> NDArray[np.float64]:
    """(n,) values of mean 0 that differ by given steps (from, to, step) as nearly as least squares allows."""
    rows, target = np.zeros((1 + len(steps), n)), np.zeros(1 + len(steps))
    rows[0] = 1.0 / n
    for k, (before, after, step) in enumerate(steps, start=1):
        rows[k, after] += 1.0
        rows[k, before] -= 1.0
        target[k] = step
    return np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0])


def _log_step(
    lines: NDArray[np.float64], first: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Median of log(next / line) of some lines, 0 where fewer than 20 samples tell it, and where they do."""
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(lines[first + 1] / lines[first])
    ratio[~((ratio > 0.0) & (ratio < np.inf))] = np.nan
    ratio.sort(axis=1)
    count = np.isfinite(ratio).sum(axis=1)
    known = count >= 20
    each, half = np.flatnonzero(known), count[known] // 2
    middle = np.zeros(first.size)
    # the logarithm keeps the order, so it is taken of the middle alone
    middle[known] = 0.5 * (np.log(ratio[each, (count[known] - 1) // 2]) + np.log(ratio[each, half]))
    return middle, known


def line_drift(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """Drift of each line's land against its neighbours', (lines, samples): a robust line along the trace.

    A surface is alike from line to line; a sensor's drift is not. So only the departure from the median of
    the lines around is drift, the rest is form. Lines that run mostly in a mark say nothing of their land.
    """
    offset, slope = _departures(ratio)
    drift: NDArray[np.float64] = (
        1.0 + offset[:, None] + slope[:, None] * np.linspace(-1.0, 1.0, ratio.shape[1])
    )
    return drift


def remove_drift(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """ratio / line_drift(ratio) - 1, in place of the ratio."""
    ratio /= line_drift(ratio)
    ratio -= 1.0
    return ratio


def _departures(ratio: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Offset and slope of each line's drift, (lines,) each."""
    lines, samples = ratio.shape
    t = np.linspace(-1.0, 1.0, samples)
    offset, slope, few = np.empty(lines), np.empty(lines), np.empty(lines, dtype=np.bool_)
    robust_lines(read_only(ratio), t, TUKEY_CUT, MIN_INLIERS * samples, 0.05 * samples, offset, slope, few)

    def departure(values: NDArray[np.float64]) -> NDArray[np.float64]:
        own = values - running_median(values, min(NEIGHBOUR_LINES, values.size))
        own[few] = 0.0
        return np.asarray(np.clip(own, -MAX_DRIFT, MAX_DRIFT))

    return departure(offset), departure(slope)
