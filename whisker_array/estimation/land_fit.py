"""Robust fits of the land: shortest intervals, a quadratic, lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import ANY_ORDER, kernel, read_only

Floats = NDArray[np.float64]


def shortest(ordered: Floats, share: float) -> Floats:
    """Middle of the shortest interval with a share of each row's samples; sorted, NaN last; the first of equals."""
    middle = np.full(ordered.shape[0], np.nan)
    sizes = (ordered < np.inf).sum(axis=1)
    for size in np.unique(sizes[sizes > 0]):
        rows, reach = np.flatnonzero(sizes == size), max(1, int(share * size)) - 1
        some = ordered[rows, :size]
        at, first = np.arange(rows.size), np.argmin(some[:, reach:] - some[:, : size - reach], axis=1)
        middle[rows] = 0.5 * (some[at, first] + some[at, first + reach])
    return middle


def common_level(values: Floats, share: float, *, bins: int = 2048) -> float:
    """Middle of the shortest interval with a share of all samples, NaN left out; NaN without any.

    Equal to `shortest` of all samples in one row, at a third of its time: a histogram tells in which bins the
    shortest interval may begin and end, and only the samples of these bins are sorted.
    """
    known = values[values < np.inf]
    reach = max(1, int(share * known.size)) - 1
    rough = np.sort(known[::64])
    low, high = rough[[rough.size // 50, -1 - rough.size // 50]] if rough.size > 100 else (0.0, 0.0)
    if not low < high:
        return float(shortest(np.sort(known)[None], share)[0])
    bin_of = np.clip((known - low) * ((bins - 2) / (high - low)) + 1.0, 0.0, bins - 1.0).astype(np.int16)
    before = np.concatenate([[0], np.cumsum(np.bincount(bin_of, minlength=bins))])
    starts = np.flatnonzero(np.diff(before))
    starts = starts[before[starts] + reach < known.size]
    spans = np.searchsorted(before, before[starts] + reach, side="right") - 1 - starts
    # the outermost bins have no width; an interval is shorter than its bins, and longer than those between its ends
    whole = (starts > 0) & (starts + spans < bins - 1)
    near = starts[spans <= spans[whole].min(initial=bins) + 2]
    ranks = np.array([before[near[0]], min(before[near[-1] + 1], known.size - reach) - 1])
    last = np.searchsorted(before, ranks + reach, side="right") - 1
    begin, end = (
        np.sort(known[(bin_of >= a) & (bin_of <= b)])[rank - before[a] :][: np.ptp(ranks) + 1]
        for (a, b), rank in ((near[[0, -1]], ranks[0]), (last, ranks[0] + reach))
    )
    k = np.argmin(end - begin)
    return float(0.5 * (begin[k] + end[k]))


@kernel(allow=ANY_ORDER)
def _row_sums(target, u, base, linear, square, inv_cut, sums):  # type: ignore[no-untyped-def]
    """Sums of each row: w u^0..4 and w y u^0..2, w the biweight about base + linear u + square u^2."""
    for i in range(target.shape[0]):
        s0 = s1 = s2 = s3 = s4 = y0 = y1 = y2 = 0.0
        for j in range(u.size):
            x = u[j]
            residual = (target[i, j] - (base[i] + x * (linear[i] + x * square))) * inv_cut
            weight = 1.0 - residual * residual
            known = weight > 0.0  # not for NaN either
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
    target: Floats, u: Floats, v: Floats, *, start: Floats, level: float, cuts: Floats, damping: float
) -> tuple[Floats, float]:
    """Robust c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2 from a start, a round for each cut; NaN are left out.

    Args:
        target: (rows, cols), v runs along the rows, u along the columns.
        u, v: coordinates.
        start: (6,) coefficients to begin with.
        level: what a fit without enough samples falls back to.
        cuts: distance from the last fit at which samples lose all weight, one a round.
        damping: added to the normal equations, as a share of their trace: terms without samples stay zero.

    Returns:
        (6,) coefficients, and the share of known samples within half of the last cut.
    """
    target, u = read_only(target), read_only(u)
    powers, sums = np.vander(v, 5, increasing=True), np.empty((v.size, 8))
    expected, found = start, np.array([level, 0.0, 0.0, 0.0, 0.0, 0.0])
    for cut in cuts:
        _row_sums(target, u, *_by_row(expected, v), float(expected[3]), 1.0 / float(cut), sums)
        of_weights, of_values = sums[:, :5].T @ powers, sums[:, 5:].T @ powers[:, :3]
        if of_weights[0, 0] < 12.0:
            break
        normal = of_weights[PAIRS]
        normal.flat[::7] += damping * normal.trace()
        found = expected = np.linalg.solve(normal, of_values[POWER_U, POWER_V])
    explained = np.abs(target - quadratic(expected, u, v)) < 0.5 * cuts[-1]
    return found, float(explained.sum() / max(np.isfinite(target).sum(), 1))


def _by_row(c: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Constant and linear coefficients of a quadratic along each row."""
    return c[0] + v * (c[2] + v * c[5]), c[1] + v * c[4]


def quadratic(c: Floats, u: Floats, v: Floats) -> Floats:
    """The quadratic with coefficients c, (v, u)."""
    base, linear = _by_row(c, v)
    return np.asarray(base[:, None] + u * (linear[:, None] + u * c[3]))


@kernel(allow=ANY_ORDER)
def robust_lines(ratio, t, cut, least, ridge, offset, slope, few):  # type: ignore[no-untyped-def]
    """Straight line near 1 through each row by three rounds of Tukey's biweight; rows with too few say 1."""
    inv_cut = 1.0 / cut
    for i in range(ratio.shape[0]):
        o, s = 1.0, 0.0
        for _ in range(3):
            total, sum_t, sum_v, sum_tt, sum_tv = 1e-9, 0.0, 0.0, 0.0, 0.0
            for j in range(t.size):
                residual = (ratio[i, j] - o - s * t[j]) * inv_cut
                weight = 1.0 - residual * residual
                known = weight > 0.0  # not for NaN either
                weight = weight * weight if known else 0.0
                value = weight * ratio[i, j] if known else 0.0
                total += weight
                sum_v += value
                sum_tv += value * t[j]
                weight *= t[j]
                sum_t += weight
                sum_tt += weight * t[j]
            mean_t, mean_v = sum_t / total, sum_v / total
            # ridge on the slope: a line with land at one end only must not tilt
            s = (sum_tv - total * mean_t * mean_v) / (sum_tt - total * mean_t * mean_t + ridge)
            o = mean_v - s * mean_t
            few[i] = total < least
            if few[i]:
                o, s = 1.0, 0.0
        offset[i], slope[i] = o, s
