"""The loops of `registration`, compiled: how badly plays fit eq. (16), and the correlation of two maps."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_ANY_ORDER = {"reassoc", "contract", "arcp", "nsz"}


@njit(cache=True, error_model="numpy", fastmath=_ANY_ORDER)  # type: ignore[untyped-decorator,unused-ignore]
def _halves(ahead, behind, half, total, edges):  # type: ignore[no-untyped-def]
    """Half sum and half difference of two lines moved towards each other, interpolated, their ends repeated."""
    n = total.size
    there, back = math.floor(half), math.floor(-half)
    part, rest = half - there, -half - back
    a0, b0 = int(there), int(back)
    ends = min(max(abs(a0), abs(b0)) + 1, n)  # so far from the ends none is in sight
    for j in range(ends):
        _one_half(ahead, behind, a0, part, b0, rest, total, edges, j)
    for j in range(max(n - ends, ends), n):
        _one_half(ahead, behind, a0, part, b0, rest, total, edges, j)
    for j in range(ends, n - ends):
        a = (1.0 - part) * ahead[j - a0] + part * ahead[j - a0 - 1]
        b = (1.0 - rest) * behind[j - b0] + rest * behind[j - b0 - 1]
        total[j], edges[j] = 0.5 * (a + b), 0.5 * (a - b)


@njit(cache=True, error_model="numpy", inline="always")  # type: ignore[untyped-decorator,unused-ignore]
def _one_half(ahead, behind, a0, part, b0, rest, total, edges, j):  # type: ignore[no-untyped-def]
    last = total.size - 1
    a = (1.0 - part) * ahead[min(max(j - a0, 0), last)] + part * ahead[min(max(j - a0 - 1, 0), last)]
    b = (1.0 - rest) * behind[min(max(j - b0, 0), last)] + rest * behind[min(max(j - b0 - 1, 0), last)]
    total[j], edges[j] = 0.5 * (a + b), 0.5 * (a - b)


@njit(cache=True, error_model="numpy", fastmath=_ANY_ORDER)  # type: ignore[untyped-decorator,unused-ignore]
def _miss(total, edges, per_pixel, steepest, mu, row, arm, per_land, rim, reach, slope, step):  # type: ignore[no-untyped-def]
    """Sum of squares of the edges felt less those that eq. (16) predicts on the profile `total`, the rim left out."""
    n = total.size
    # R'a of `enhancement._lift_and_turn` at slope and -slope; a whisker that jams says nothing: 1
    lift, turn = row[1] - row[0] * mu, arm[1] - arm[0] * mu
    by_lift, by_turn = row[0] + row[1] * mu, arm[0] + arm[1] * mu
    for j in range(n):
        reach[j] = 1.0 + total[j]
    for _ in range(2):
        slope[0], slope[n - 1] = reach[1] - reach[0], reach[n - 1] - reach[n - 2]
        for j in range(1, n - 1):
            slope[j] = 0.5 * (reach[j + 1] - reach[j - 1])
        for j in range(n):
            p = min(max(slope[j] * per_pixel, -steepest), steepest)
            up, down = lift - by_lift * p, lift + by_lift * p
            rising = per_land * (turn - by_turn * p) / up if up > 0.0 else 1.0
            falling = per_land * (turn + by_turn * p) / down if down > 0.0 else 1.0
            reach[j] = (1.0 + total[j]) / max(0.5 * (rising + falling), 0.1)
            step[j] = 0.5 * (rising - falling)
    cost = 0.0
    for j in range(rim, n - rim):
        miss = edges[j] - reach[j] * step[j]
        cost += miss * miss
    return cost


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def disagreements(ahead, behind, halves, per_pixel, steepest, mu, row, arm, per_land, rim):  # type: ignore[no-untyped-def]
    """Mean square of felt less predicted edges for every half play tried.

    Args:
        ahead, behind: (lines, samples) enhancement.
        halves: half plays, pixels.
        per_pixel: preload over pitch: slopes of heights in preloads a pixel.
        steepest: slopes are cut here.
        mu: friction.
        row, arm: of the tip, (3,) each, as in eq. (16).
        per_land: lift over turn on the land.
        rim: samples at both ends that do not count.

    Returns:
        (halves,) float64.
    """
    n = ahead.shape[1]
    total, edges, reach, slope, step = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    cost = np.zeros(halves.size)
    for k in range(halves.size):
        for i in range(ahead.shape[0]):
            _halves(ahead[i], behind[i], halves[k], total, edges)
            cost[k] += _miss(
                total, edges, per_pixel, steepest, mu, row, arm, per_land, rim, reach, slope, step
            )
    return cost / (ahead.shape[0] * max(n - 2 * rim, 1))


@njit(cache=True, error_model="numpy", fastmath=_ANY_ORDER)  # type: ignore[untyped-decorator,unused-ignore]
def _dot(a, b):  # type: ignore[no-untyped-def]
    total = np.float32(0.0)
    for j in range(a.size):
        total += a[j] * b[j]
    return total


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def correlation(reference, moved, reach):  # type: ignore[no-untyped-def]
    """Sum of reference(r + dr, c + dc) moved(r, c) for shifts up to `reach` each way, (2 reach + 1, 2 reach + 1)."""
    rows = moved.shape[0]
    out = np.zeros((2 * reach + 1, 2 * reach + 1))
    for i in range(rows):
        for r in range(max(0, i - reach), min(rows, i + reach + 1)):
            for c in range(-reach, reach + 1):
                here, there = reference[r, max(c, 0) :], moved[i, max(-c, 0) :]
                n = min(here.size, there.size)
                out[r - i + reach, c + reach] += _dot(here[:n], there[:n])
    return out
