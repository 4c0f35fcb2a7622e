"""Where the land lies in a sweep: the moment of undisturbed surface under every sample.

The land is the level that most samples share; marks stand out from it on one side or the other. Each
whisker's gain is read off where whiskers meet; then a quadratic over the plate (the mounting's tilt, a slight
dome) is fitted robustly to all lines of a sweep, and each line's drift is read off against it. Nothing here
looks at edges.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

LAND_SHARE = 0.35
"""Share of samples that must agree on a level to make it land: less than a full line of text leaves."""
TUKEY_CUT = 0.05
"""Samples further than this from the expected land, relative to it, have no say: marks are 10 % and more."""
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
    count = np.isfinite(ordered).sum(axis=-1)
    flat, n = ordered.reshape(-1, ordered.shape[-1]), count.reshape(-1)
    out = np.full(flat.shape[0], np.nan)
    for size in np.unique(n[n > 0]):
        rows = np.flatnonzero(n == size)
        width = max(1, int(share * size))
        block = flat[rows, :size]
        gaps = block[:, width - 1 :] - block[:, : size - width + 1]
        first = np.argmin(gaps, axis=1)
        each = np.arange(rows.size)
        out[rows] = 0.5 * (block[each, first] + block[each, first + width - 1])
    return out.reshape(values.shape[:-1])


def _quadratic(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)


def _solve(
    design: NDArray[np.float64], target: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weighted least squares, slightly damped so that unseen terms stay zero."""
    weighted = design * weight[:, None]
    normal = weighted.T @ design
    normal[np.diag_indices_from(normal)] += 1e-9 * float(np.trace(normal))
    return np.asarray(np.linalg.solve(normal, weighted.T @ target), dtype=np.float64)


def plate_land(moment: NDArray[np.float64]) -> NDArray[np.float64]:
    """Land of a whole sweep, (lines, samples): a robust quadratic in both directions; NaN are left out.

    The start is flat at the most common level, or tilted as the levels of lines and of columns say, so a tilt
    of many times the mark's depth does no harm; the fit is then tightened around it.
    """
    lines, samples = moment.shape
    u, v = np.linspace(-1.0, 1.0, samples), np.linspace(-1.0, 1.0, lines)
    level = float(shorth(moment[np.isfinite(moment)][None, :])[0])
    if level == 0.0:
        return np.zeros(moment.shape)  # most samples feel nothing at all: there is no land to fit
    best_coefficients, best_inliers = np.zeros(6), -1.0
    # of the two starts the better explains more samples
    step_l, step_s = max(1, lines // 40), max(1, samples // 80)
    thin = moment[::step_l, ::step_s]
    uu, vv = np.meshgrid(u[::step_s], v[::step_l])
    design = _quadratic(uu.ravel(), vv.ravel())
    target = thin.ravel()
    known = np.isfinite(target)
    design, target = design[known], target[known]
    for start in (np.full(target.shape, level), design @ _tilted_start(thin, uu[0], vv[:, 0], level)):
        expected = start
        coefficients = np.array([level, 0, 0, 0, 0, 0], dtype=np.float64)
        for cut in (0.2, 0.1, 0.07, TUKEY_CUT, TUKEY_CUT):
            residual = (target - expected) / (cut * abs(level))
            weight = np.clip(1.0 - residual**2, 0.0, None) ** 2
            if weight.sum() < 12:
                break
            coefficients = _solve(design, target, weight)
            expected = design @ coefficients
        inliers = float((np.abs(target - expected) < 0.5 * TUKEY_CUT * abs(level)).mean())
        if inliers > best_inliers + 1e-9:
            best_inliers, best_coefficients = inliers, coefficients
    c = best_coefficients
    along, across = c[0] + c[1] * u + c[3] * u * u, c[2] * v + c[5] * v * v
    return np.asarray(along + across[:, None] + c[4] * np.outer(v, u))


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
        slope = float(np.median((y[k:] - y[:-k]) / (x[k:] - x[:-k])))
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
    with np.errstate(invalid="ignore", divide="ignore"):
        step = np.log(np.abs(lines[asked + 1] / lines[asked]))
    step = np.where(np.isfinite(step), step, np.nan)
    known = np.zeros(whisker.size - 1, dtype=np.bool_)
    known[asked] = np.isfinite(step).sum(axis=1) >= 20
    middle = np.zeros(whisker.size - 1)
    middle[known] = np.nanmedian(step[known[asked]], axis=1)
    index = np.searchsorted(names, whisker)
    rows, target = [np.full(names.size, 1.0 / names.size)], [0.0]
    for i in border:
        if not known[i]:
            continue
        beside = [
            j for j in (i - 1, i + 1) if 0 <= j < known.size and known[j] and whisker[j] == whisker[j + 1]
        ]
        slope = float(np.mean(middle[beside])) if beside else 0.0
        row = np.zeros(names.size)
        row[index[i + 1]] += 1.0
        row[index[i]] -= 1.0
        rows.append(row)
        target.append(middle[i] - slope)
    solution = np.linalg.lstsq(np.array(rows), np.array(target), rcond=None)[0]
    gain: NDArray[np.float64] = np.exp(solution[index])
    return gain


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _robust_lines(ratio, t, cut, least, ridge, offset, slope, few):  # type: ignore[no-untyped-def]
    """Straight line near 1 through each row by three rounds of Tukey's biweight; rows with too few say 1."""
    for i in range(ratio.shape[0]):
        o, s = 1.0, 0.0
        for _ in range(3):
            total, sum_t, sum_v, sum_tt, sum_tv = 1e-9, 0.0, 0.0, 0.0, 0.0
            for j in range(t.size):
                residual = (ratio[i, j] - o - s * t[j]) / cut
                weight = 1.0 - residual * residual
                if weight > 0.0:  # not for NaN either
                    weight *= weight
                    total += weight
                    sum_t += weight * t[j]
                    sum_v += weight * ratio[i, j]
                    sum_tt += weight * t[j] * t[j]
                    sum_tv += weight * t[j] * ratio[i, j]
            mean_t, mean_v = sum_t / total, sum_v / total
            # ridge on the slope: a line with land at one end only must not tilt
            s = (sum_tv - total * mean_t * mean_v) / (sum_tt - total * mean_t * mean_t + ridge)
            o = mean_v - s * mean_t
            few[i] = total < least
            if few[i]:
                o, s = 1.0, 0.0
        offset[i], slope[i] = o, s


def line_drift(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """What each line's land departs from its neighbours', (lines, samples): a robust line along the trace.

    A surface is alike from line to line; a sensor's drift is not. So only the departure from the median of
    the lines around is drift, the rest is form. Lines that run mostly in a mark say nothing of their land.
    """
    from scipy import ndimage

    lines, samples = ratio.shape
    t = np.linspace(-1.0, 1.0, samples)
    offset, slope, few = np.empty(lines), np.empty(lines), np.empty(lines, dtype=np.bool_)
    _robust_lines(ratio, t, TUKEY_CUT, MIN_INLIERS * samples, 0.05 * samples, offset, slope, few)

    def departure(values: NDArray[np.float64]) -> NDArray[np.float64]:
        own = values - ndimage.median_filter(values, size=min(NEIGHBOUR_LINES, values.size), mode="nearest")
        own[few] = 0.0
        return np.asarray(np.clip(own, -MAX_DRIFT, MAX_DRIFT))

    drift: NDArray[np.float64] = 1.0 + departure(offset)[:, None] + departure(slope)[:, None] * t
    return drift
