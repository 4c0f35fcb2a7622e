"""Fit the land of a sweep: the moment of undisturbed surface under every sample, the level that most samples share.

Gains are estimated where lines of different whiskers meet. Then a quadratic over the plate (tilt, a slight dome) is
fitted robustly to all lines of a sweep, and each line's drift is estimated relative to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import read_only
from whisker_array.arrays import AnyFloats, Floats, quantile_of_known
from whisker_array.estimation.land_fit import fit_quadratic, quadratic, robust_lines

CUT = 0.05
"""Distance from the land, as a share of it, from which a sample has no weight in its fit."""
LEAST_LAND = 0.15
"""Least share of a line's samples on its land, for an estimate of its drift."""
NEIGHBOURS = 9
"""Number of neighbouring lines whose median is the form of the surface."""
MOST_DRIFT = 0.03
"""Greatest drift of a line, share of the land."""


def shorth(values: Floats, *, share: float = 0.35) -> Floats:
    """Centre of the shortest interval (the first) that holds a share of each row's samples, (rows,); NaN are left out.
    A robust mode (Grübel 1988): it stays on the land when marks cover half a line on one side."""
    ordered, middle = np.sort(values, axis=-1), np.full(values.shape[0], np.nan)
    sizes = (ordered < np.inf).sum(axis=1)
    for size in np.unique(sizes[sizes > 0]):
        rows, reach = np.flatnonzero(sizes == size), max(1, int(share * size)) - 1
        some = ordered[rows, :size]
        lines, first = np.arange(rows.size), np.argmin(some[:, reach:] - some[:, : size - reach], axis=1)
        middle[rows] = 0.5 * (some[lines, first] + some[lines, first + reach])
    return middle


def land_surface(coefficients: Floats, shape: tuple[int, ...]) -> Floats:
    """Moment of the land, (lines, samples), from its coefficients."""
    return quadratic(coefficients, np.linspace(-1.0, 1.0, shape[1]), np.linspace(-1.0, 1.0, shape[0]))


def land_coefficients(moment: Floats) -> Floats:
    """Fit the land of a sweep by a robust quadratic in both directions, each from -1 to 1.

    The fit starts flat at the most common level, or tilted by the levels of lines and columns; it is then tightened,
    until samples further than the share `CUT` from the land have no weight. Returns (6,) coefficients of 1, u, v, u^2,
    u v, v^2; all zero if the most common level is zero.
    """
    lines, samples = moment.shape
    # in 32 bits it sorts in half the time
    level = float(shorth(moment.reshape(1, -1).astype(np.float32))[0])
    if level == 0.0:
        return np.zeros(6)  # there is no land to fit
    step_l, step_s = max(1, lines // 40), max(1, samples // 80)
    u, v = np.linspace(-1.0, 1.0, samples)[::step_s], np.linspace(-1.0, 1.0, lines)[::step_l]
    thin = moment[::step_l, ::step_s]
    cuts = np.array([0.2, 0.1, 0.07, CUT, CUT]) * abs(level)
    # keep the start that explains more samples
    starts = (np.array([level, 0.0, 0.0, 0.0, 0.0, 0.0]), _tilted_start(thin, u, v, level))
    fits = (fit_quadratic(thin, u, v, start=start, level=level, cuts=cuts) for start in starts)
    return max(fits, key=itemgetter(1))[0]


def _tilted_start(thin: Floats, u: Floats, v: Floats, level: float) -> Floats:
    coefficients = np.array([level, 0.0, 0.0, 0.0, 0.0, 0.0])
    for linear, axis, levels in ((1, u, shorth(thin.T)), (2, v, shorth(thin))):
        known = np.isfinite(levels)
        if known.sum() < 8:
            continue
        # a robust slope (Theil-Sen on a few pairs); the start has no curvature
        k = max(1, int(known.sum()) // 3)
        y, x = levels[known], axis[known]
        coefficients[linear] = np.median((y[k:] - y[:-k]) / (x[k:] - x[:-k]))
    return coefficients


def whisker_gain(lines: AnyFloats, whisker: NDArray[np.int64]) -> Floats:
    """Relative gain of each line's whisker, (lines,), of mean 1: least squares over all borders of the median ratio of
    samples of neighbouring lines, less the slope of the surface."""
    names, index = np.unique(whisker, return_inverse=True)
    border = np.flatnonzero(whisker[1:] != whisker[:-1])
    if names.size < 2 or border.size == 0:
        return np.ones(whisker.size)
    # only the steps across the borders and beside them are needed
    needed = np.unique(np.clip(border[:, None] + np.array([-1, 0, 1]), 0, whisker.size - 2))
    with np.errstate(invalid="ignore", divide="ignore"):
        step = np.log(np.abs(lines[needed + 1] / lines[needed]))
    step[np.isinf(step)] = np.nan
    middle = np.full(whisker.size - 1, np.nan)
    middle[needed] = quantile_of_known(step, fewest=20)
    known = np.isfinite(middle)
    steps = []
    for i in border[known[border]]:
        beside = [
            j for j in (i - 1, i + 1) if 0 <= j < known.size and known[j] and whisker[j] == whisker[j + 1]
        ]
        slope = sum(float(middle[j]) for j in beside) / max(len(beside), 1)
        steps.append((int(index[i]), int(index[i + 1]), float(middle[i] - slope)))
    return np.asarray(np.exp(reconcile_steps(steps, names.size)[index]))


def reconcile_steps(steps: Sequence[tuple[int, int, float]], n: int) -> Floats:
    """(n,) values of mean 0 that differ by given steps (from, to, step), in the least-squares sense."""
    rows, target = np.zeros((1 + len(steps), n)), np.zeros(1 + len(steps))
    rows[0] = 1.0 / n
    for k, (before, after, step) in enumerate(steps, start=1):
        rows[k, after] += 1.0
        rows[k, before] -= 1.0
        target[k] = step
    return np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0])


def remove_drift(ratio: Floats) -> Floats:
    """Divide each line, in place, by the drift of its land: a robust line along the trace of the deviation from the
    median of the neighbouring lines. Lines that run mostly in a mark do not show their land."""
    from scipy.ndimage import median_filter

    lines, samples = ratio.shape
    t = np.linspace(-1.0, 1.0, samples)
    fits, few = np.empty((2, lines)), np.empty(lines, dtype=np.bool_)
    robust_lines(read_only(ratio), t, CUT, LEAST_LAND * samples, 0.05 * samples, *fits, few)
    form = median_filter(fits, (1, NEIGHBOURS), mode="nearest")
    offset, slope = np.where(few, 0.0, np.clip(fits - form, -MOST_DRIFT, MOST_DRIFT))
    ratio /= 1.0 + offset[:, None] + slope[:, None] * t
    return ratio
