"""Robust fits of the land: a quadratic, and lines."""

from __future__ import annotations

import numpy as np

from glyphs.compiled import ANY_ORDER, kernel, read_only
from whisker_array.arrays import Floats


@kernel(allow=ANY_ORDER)
def _row_sums(target, u, base, linear, square, inv_cut, sums):  # type: ignore[no-untyped-def]
    for i in range(target.shape[0]):
        s0 = s1 = s2 = s3 = s4 = y0 = y1 = y2 = 0.0
        for j in range(u.size):
            x = u[j]
            residual = (target[i, j] - (base[i] + x * (linear[i] + x * square))) * inv_cut
            weight = 1.0 - residual * residual
            known = weight > 0.0  # False for NaN
            weight = weight * weight if known else 0.0
            y = weight * target[i, j] if known else 0.0
            s0 += weight
            y0 += y
            weight *= x
            y *= x
            s1 += weight
            y1 += y
            weight *= x
            y2 += y * x
            s2 += weight
            weight *= x
            s3 += weight
            s4 += weight * x
        sums[i, 0], sums[i, 1], sums[i, 2], sums[i, 3], sums[i, 4] = s0, s1, s2, s3, s4
        sums[i, 5], sums[i, 6], sums[i, 7] = y0, y1, y2


POWER_U, POWER_V = np.array([0, 1, 0, 2, 1, 0]), np.array([0, 0, 1, 0, 1, 2])
"""Powers of u and v in the terms of a quadratic."""
PAIRS = POWER_U[:, None] + POWER_U, POWER_V[:, None] + POWER_V
"""Powers of u and v in the products of any two terms."""


def fit_quadratic(
    target: Floats, u: Floats, v: Floats, *, start: Floats, level: float, cuts: Floats, damping: float = 1e-9
) -> tuple[Floats, float]:
    """Fit c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2 robustly from a start, one round per cut; NaN are ignored.

    `target` is (rows, cols), v runs along the rows, u along the columns. `damping` is added to the normal equations, as
    a share of their trace: terms without samples stay zero. Returns (6,) coefficients, and the share of known samples
    within half of the last cut.
    """
    target, u = read_only(target), read_only(u)
    powers, sums = np.vander(v, 5, increasing=True), np.empty((v.size, 8))
    expected, solved = start, np.array([level, 0.0, 0.0, 0.0, 0.0, 0.0])
    for cut in cuts:
        _row_sums(target, u, *_by_row(expected, v), float(expected[3]), 1.0 / float(cut), sums)
        of_weights, of_values = sums[:, :5].T @ powers, sums[:, 5:].T @ powers[:, :3]
        if of_weights[0, 0] < 12.0:
            break
        normal = of_weights[PAIRS]
        normal.flat[::7] += damping * normal.trace()
        solved = expected = np.linalg.solve(normal, of_values[POWER_U, POWER_V])
    explained = np.abs(target - quadratic(expected, u, v)) < 0.5 * cuts[-1]
    return solved, float(explained.sum() / max(np.isfinite(target).sum(), 1))


def _by_row(c: Floats, v: Floats) -> tuple[Floats, Floats]:
    return c[0] + v * (c[2] + v * c[5]), c[1] + v * c[4]


def quadratic(c: Floats, u: Floats, v: Floats) -> Floats:
    """The quadratic with coefficients c, (v, u)."""
    base, linear = _by_row(c, v)
    return np.asarray(base[:, None] + u * (linear[:, None] + u * c[3]))


@kernel(allow=ANY_ORDER)
def robust_lines(ratio, t, cut, least, ridge, offset, slope, few):  # type: ignore[no-untyped-def]
    """Fit a line near 1 to each row by three rounds of Tukey's biweight; rows with too few samples give 1."""
    inv_cut = 1.0 / cut
    for i in range(ratio.shape[0]):
        o, s = 1.0, 0.0
        for _ in range(3):
            total, sum_t, sum_v, sum_tt, sum_tv = 1e-9, 0.0, 0.0, 0.0, 0.0
            for j in range(t.size):
                residual = (ratio[i, j] - o - s * t[j]) * inv_cut
                weight = 1.0 - residual * residual
                known = weight > 0.0  # False for NaN
                weight = weight * weight if known else 0.0
                value = weight * ratio[i, j] if known else 0.0
                total += weight
                sum_v += value
                sum_tv += value * t[j]
                weight *= t[j]
                sum_t += weight
                sum_tt += weight * t[j]
            mean_t, mean_v = sum_t / total, sum_v / total
            # ridge on the slope, so that a line with land at one end only does not tilt
            s = (sum_tv - total * mean_t * mean_v) / (sum_tt - total * mean_t * mean_t + ridge)
            o = mean_v - s * mean_t
            few[i] = total < least
            if few[i]:
                o, s = 1.0, 0.0
        offset[i], slope[i] = o, s
