"""The loops of `land`, compiled: shortest intervals, the robust quadratic, robust lines, a running median.

Sums may be taken in any order (`reassoc`), so that they run in vectors; NaN keep their meaning throughout.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_ANY_ORDER = {"reassoc", "contract", "arcp", "nsz"}


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def shortest(ordered, share, middle):  # type: ignore[no-untyped-def]
    """Middle of the shortest interval with a share of each row's samples; sorted, NaN last; the first of equals."""
    for i in range(ordered.shape[0]):
        size = ordered.shape[1]
        while size > 0 and not np.isfinite(ordered[i, size - 1]):
            size -= 1
        if size == 0:
            middle[i] = np.nan
            continue
        reach = max(1, int(share * size)) - 1
        first, least = 0, ordered[i, reach] - ordered[i, 0]
        for j in range(1, size - reach):
            gap = ordered[i, j + reach] - ordered[i, j]
            if gap < least:
                first, least = j, gap
        middle[i] = 0.5 * (ordered[i, first] + ordered[i, first + reach])


@njit(cache=True, error_model="numpy", inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _solved(normal, right, size):  # type: ignore[no-untyped-def]
    """Solves normal x = right in place, by Cholesky; normal is symmetric and positive definite."""
    for i in range(size):
        for j in range(i + 1):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / normal[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= normal[i, k] * right[k]
        right[i] /= normal[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= normal[k, i] * right[k]
        right[i] /= normal[i, i]


@njit(cache=True, error_model="numpy", fastmath=_ANY_ORDER)  # type: ignore[untyped-decorator,unused-ignore]
def _row_sums(target, u, base, linear, square, inv_cut):  # type: ignore[no-untyped-def]
    """Of one row: sums of w u^0..4 and w y u^0..2, w the biweight about base + linear u + square u^2."""
    s0 = s1 = s2 = s3 = s4 = y0 = y1 = y2 = 0.0
    for j in range(u.size):
        x = u[j]
        residual = (target[j] - (base + x * (linear + x * square))) * inv_cut
        weight = 1.0 - residual * residual
        known = weight > 0.0  # not for NaN either
        weight = weight * weight if known else 0.0
        y = weight * target[j] if known else 0.0
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
    return s0, s1, s2, s3, s4, y0, y1, y2


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def fit_quadratic(target, u, v, level, cuts, damping, near, coefficients):  # type: ignore[no-untyped-def]
    """Robust c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2 from a start, a round for each cut; NaN are left out.

    Args:
        target: (rows, cols), v runs along the rows, u along the columns.
        u, v: coordinates.
        level: what a fit without enough samples falls back to.
        cuts: distance from the last fit at which samples lose their say, one a round.
        damping: added to the normal equations, as a share of their trace: unseen terms stay zero.
        near: distance within which a sample counts as explained.
        coefficients: (6,) the start; overwritten by the fit.

    Returns:
        The share of known samples that the fit explains.
    """
    expected = coefficients.copy()
    coefficients[:] = 0.0
    coefficients[0] = level
    normal, right = np.empty((6, 6)), np.empty(6)
    for cut in cuts:
        normal[:] = 0.0
        right[:] = 0.0
        c = expected
        for i in range(v.size):
            b = v[i]
            base, linear = c[0] + b * (c[2] + b * c[5]), c[1] + b * c[4]
            s0, s1, s2, s3, s4, y0, y1, y2 = _row_sums(target[i], u, base, linear, c[3], 1.0 / cut)
            # powers (in u, in v) of the terms: 00 10 01 20 11 02
            normal[0, 0] += s0
            normal[1, 0] += s1
            normal[1, 1] += s2
            normal[2, 0] += s0 * b
            normal[2, 1] += s1 * b
            normal[2, 2] += s0 * b * b
            normal[3, 1] += s3
            normal[3, 2] += s2 * b
            normal[3, 3] += s4
            normal[4, 2] += s1 * b * b
            normal[4, 3] += s3 * b
            normal[4, 4] += s2 * b * b
            normal[5, 2] += s0 * b * b * b
            normal[5, 4] += s1 * b * b * b
            normal[5, 5] += s0 * b * b * b * b
            right[0] += y0
            right[1] += y1
            right[2] += y0 * b
            right[3] += y2
            right[4] += y1 * b
            right[5] += y0 * b * b
        if normal[0, 0] < 12.0:
            break
        normal[3, 0] = normal[1, 1]
        normal[4, 0] = normal[2, 1]
        normal[4, 1] = normal[3, 2]
        normal[5, 0] = normal[2, 2]
        normal[5, 1] = normal[4, 2]
        normal[5, 3] = normal[4, 4]
        trace = 0.0
        for k in range(6):
            trace += normal[k, k]
        for k in range(6):
            normal[k, k] += damping * trace
        _solved(normal, right, 6)
        for k in range(6):
            coefficients[k] = expected[k] = right[k]
    count = explained = 0
    for i in range(v.size):
        b = v[i]
        base, linear = expected[0] + b * (expected[2] + b * expected[5]), expected[1] + b * expected[4]
        for j in range(u.size):
            value = target[i, j]
            count += np.isfinite(value)
            explained += abs(value - (base + u[j] * (linear + u[j] * expected[3]))) < near
    return explained / max(count, 1)


@njit(cache=True, error_model="numpy", fastmath=_ANY_ORDER)  # type: ignore[untyped-decorator,unused-ignore]
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


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def running_median(values, size):  # type: ignore[no-untyped-def]
    """Median of `size` neighbours, the ends repeated; of an even number the upper of the two in the middle."""
    out = np.empty(values.size)
    window = np.empty(size)
    for i in range(values.size):
        for k in range(size):
            value = values[min(max(i - size // 2 + k, 0), values.size - 1)]
            place = k
            while place > 0 and window[place - 1] > value:
                window[place] = window[place - 1]
                place -= 1
            window[place] = value
        out[i] = window[size // 2]
    return out


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def in_order(signal, flags, offset, order, lead, unusable, lines):  # type: ignore[no-untyped-def]
    """Lines of a sweep less their offsets, in an order, lead-in and -out left off, NaN where flags say so.

    Returns:
        (lines,) whether any sample of a line is known.
    """
    some = np.zeros(order.size, dtype=np.bool_)
    for i in range(order.size):
        given, marked, zero = signal[order[i]], flags[order[i]], offset[order[i]]
        any_known = False
        for j in range(lines.shape[1]):
            value = np.float64(given[lead + j]) - zero
            value = np.nan if marked[lead + j] & unusable else value
            lines[i, j] = value
            any_known |= np.isfinite(value)
        some[i] = any_known
    return some


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def divide_by_land(lines, c, u, v):  # type: ignore[no-untyped-def]
    """Lines over the quadratic with coefficients c, in place."""
    for i in range(v.size):
        base, linear = c[0] + v[i] * (c[2] + v[i] * c[5]), c[1] + v[i] * c[4]
        line = lines[i]
        for j in range(u.size):
            line[j] /= base + u[j] * (linear + u[j] * c[3])


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def take_off_drift(ratio, t, offset, slope):  # type: ignore[no-untyped-def]
    """Ratio over the drift 1 + offset + slope t of each line, less 1, in place."""
    for i in range(offset.size):
        line, base = ratio[i], 1.0 + offset[i]
        for j in range(t.size):
            line[j] = line[j] / (base + slope[i] * t[j]) - 1.0
