"""The sums of `recognition.vision_chain`, compiled.

Sums of exponentials over neighbouring columns are taken as products of numbers scaled to the middle of what a double
can hold. Where the logarithms span more than that, they are taken one by one over their largest.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

WIDEST = 1200.0
"""Nats that products may span: doubles hold some 1400."""
LIFT = 600.0
"""Natural logarithm to which the largest is scaled."""
NOTHING = 45.0
"""Nats below the largest from which on a term is lost in the rounding of the sum."""


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def ends_and_span(values):  # type: ignore[no-untyped-def]
    """Largest, and how far below it the smallest lies that is not -inf."""
    high, low = -np.inf, np.inf
    for v in values:
        high = max(high, v)
        if v > -np.inf:
            low = min(low, v)
    return high, (high - low if high > -np.inf else 0.0)


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def log_sum(values):  # type: ignore[no-untyped-def]
    """Log of the sum of exponentials of a row."""
    top = -np.inf
    for v in values:
        top = max(top, v)
    if top == -np.inf:
        return top
    total = 0.0
    for v in values:
        if v > top - NOTHING:
            total += math.exp(v - top)
    return top + math.log(total)


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def gathered(evidence, scaled, prior, here, at, to, out):  # type: ignore[no-untyped-def]
    """out[x + to[c]] = log sum over c of evidence[c, x] + prior[c] + here[x + at[c]].

    `scaled` holds the exponentials of the evidence over its largest, which is followed by its span.
    """
    count, cols = evidence.shape
    exp_evidence, high, span = scaled
    top, reach = ends_and_span(here)
    out[:] = -np.inf
    if top == -np.inf:
        return
    width = here.size
    if span + reach < WIDEST:
        total = np.zeros(width)
        lifted = np.empty(width)
        for x in range(width):
            lifted[x] = math.exp(here[x] - top + LIFT) if here[x] > -np.inf else 0.0
        for c in range(count):
            if prior[c] == -np.inf:
                continue
            share = math.exp(prior[c])
            row, source, target = exp_evidence[c], lifted[at[c] : at[c] + cols], total[to[c] : to[c] + cols]
            for x in range(cols):
                target[x] += share * (row[x] * source[x])
        for x in range(width):
            if total[x] > 0.0:
                out[x] = math.log(total[x]) + (top + high - LIFT)
        return
    for y in range(width):
        best = -np.inf
        for c in range(count):
            x = y - to[c]
            if prior[c] > -np.inf and 0 <= x < cols:
                best = max(best, evidence[c, x] + prior[c] + here[x + at[c]])
        if best == -np.inf:
            continue
        total_here = 0.0
        for c in range(count):
            x = y - to[c]
            if prior[c] > -np.inf and 0 <= x < cols:
                v = evidence[c, x] + prior[c] + here[x + at[c]]
                if v > best - NOTHING:
                    total_here += math.exp(v - best)
        out[y] = best + math.log(total_here)


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def moved(value, low, gaps, sign, out):  # type: ignore[no-untyped-def]
    """out[y] = log sum over n of value[y - sign (low + n)] + gaps[n]."""
    width = value.size
    top, reach = ends_and_span(value)
    high, span = ends_and_span(gaps)
    out[:] = -np.inf
    if top == -np.inf:
        return
    if span + reach < WIDEST:
        total, lifted = np.zeros(width), np.empty(width)
        for x in range(width):
            lifted[x] = math.exp(value[x] - top + LIFT) if value[x] > -np.inf else 0.0
        for n in range(gaps.size):
            share, by = math.exp(gaps[n] - high), sign * (low + n)
            first, last = max(0, by), min(width, width + by)
            if last <= first:
                continue
            source, target = lifted[first - by : last - by], total[first:last]
            for x in range(last - first):
                target[x] += share * source[x]
        for x in range(width):
            if total[x] > 0.0:
                out[x] = math.log(total[x]) + (top + high - LIFT)
        return
    for y in range(width):
        best = -np.inf
        for n in range(gaps.size):
            x = y - sign * (low + n)
            if 0 <= x < width:
                best = max(best, value[x] + gaps[n])
        if best == -np.inf:
            continue
        total_here = 0.0
        for n in range(gaps.size):
            x = y - sign * (low + n)
            if 0 <= x < width and value[x] + gaps[n] > best - NOTHING:
                total_here += math.exp(value[x] + gaps[n] - best)
        out[y] = best + math.log(total_here)


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def exponentials(evidence):  # type: ignore[no-untyped-def]
    """(T, cols) exponentials over the largest, the largest, and the span of the logarithms; zeros if it is too wide."""
    high, span = ends_and_span(evidence.ravel())
    out = np.zeros(evidence.shape)
    if span < WIDEST:
        for c in range(evidence.shape[0]):
            for x in range(evidence.shape[1]):
                if evidence[c, x] > -np.inf:
                    out[c, x] = math.exp(evidence[c, x] - high)
    return out, high, span


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def forward_sums(evidence, scaled, prior, origin, end, width, start, low, gaps, kind):  # type: ignore[no-untyped-def]
    """By place: (width,) log sums of what comes before each origin, and of what ends at each column.

    `gaps[kind[k]]` are the spacings after place k, from `low[kind[k]]` on.
    """
    places = prior.shape[0]
    here, ends = np.empty((places, width)), np.empty((places, width))
    here[0] = start
    for k in range(places):
        gathered(evidence, scaled, prior[k], here[k], origin, end, ends[k])
        if k + 1 < places:
            moved(ends[k], low[kind[k]], gaps[kind[k]], 1, here[k + 1])
    return here, ends


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def backward_sums(evidence, scaled, prior, origin, end, width, low, gaps, kind):  # type: ignore[no-untyped-def]
    """By place: (width,) log sums of what follows each end."""
    places = prior.shape[0]
    after = np.empty((places, width))
    after[places - 1] = 0.0
    starts = np.empty(width)
    for k in range(places - 1, 0, -1):
        gathered(evidence, scaled, prior[k], after[k], end, origin, starts)
        moved(starts, low[kind[k - 1]], gaps[kind[k - 1]], -1, after[k - 1])
    return after


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def places_of(evidence, prior, origin, end, here, after):  # type: ignore[no-untyped-def]
    """(places, T) log sums over columns of each character at each place, and the column of the largest term."""
    places, (count, cols) = prior.shape[0], evidence.shape
    belief = np.full((places, count), -np.inf)
    column = np.zeros((places, count), dtype=np.int64)
    whole = np.empty(cols)
    for k in range(places):
        for c in range(count):
            if prior[k, c] == -np.inf:
                continue
            before, later = here[k, origin[c] : origin[c] + cols], after[k, end[c] : end[c] + cols]
            best = -np.inf
            for x in range(cols):
                whole[x] = evidence[c, x] + prior[k, c] + before[x] + later[x]
                if whole[x] > best:
                    best, column[k, c] = whole[x], x
            belief[k, c] = log_sum(whole)
    return belief, column
