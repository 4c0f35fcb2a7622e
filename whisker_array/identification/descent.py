"""The way down from a bench to the one that explains a recording best: Levenberg and Marquardt's, made for contact.

A tip that slips makes the sum of squares rough. So what a number does to a sample is taken across many roughnesses,
and not at all where the tip jumps; a loss that is bounded keeps what jumps from drowning the rest; and what the
recording hardly tells is moved by steps of its own, for a whole one is stopped by the roughness of what it tells well.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.bench import Bench, Unknown, of_whisker
from whisker_array.identification.forward import Forward, Trace
from whisker_array.whisker.sections import WhiskerError

PLACE_MM = 0.005
"""By how much a stage's place is off: screws that are bought wave by as much with every turn."""
FEW = 4.0
"""Sigmas beyond which a residual is no scatter."""
MOST_STEPS = 25
SETTLED_SDS = 0.01
"""A step so small ends the descent."""
DAMPED_TRIES = 6
SOFT = 100.0
"""Curvature of a direction that the recording hardly tells, in units of what was known before."""
STEP_SDS = 0.3
"""Of a difference by which the derivative is taken, in standard deviations of what was known before."""
MOST_SIGMAS = 150.0
"""What a number may do to a sample, in sigmas for each standard deviation before: more, and the tip has jumped."""


class Loss(Enum):
    """What a residual costs beyond some sigmas, where tips slip around steep edges as they like."""

    HUBER = "in proportion"
    """Far from the answer too it tells the way."""
    BOUNDED = "no more than a few sigmas do"
    """Geman and McClure's: what jumps does not drown what the rest tells."""

    def of(self, misses: NDArray[np.float64]) -> float:
        """Twice the loss of residuals in sigmas."""
        size = np.abs(misses)
        if self is Loss.HUBER:
            return float(np.where(size <= FEW, size**2, 2.0 * FEW * size - FEW**2).sum())
        return float((size**2 / (1.0 + (size / FEW) ** 2)).sum())

    def weight(self, misses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of each residual in a sum of squares whose slope is the loss's."""
        size = np.abs(misses)
        if self is Loss.HUBER:
            return np.asarray(np.minimum(1.0, FEW / np.maximum(size, 1e-12)))
        return np.asarray((1.0 + (size / FEW) ** 2) ** -2.0)


SETTLED_COST = {Loss.HUBER: 10.0, Loss.BOUNDED: 0.3}
"""One that gains so little (in squares of a sigma) ends it, too."""


def sample_sigma_n_mm(trace: Trace, scatter_n_mm: float) -> NDArray[np.float64]:
    """(samples,) uncertainty of each sample: its scatter, and what a place a little off makes of it."""
    step = np.abs(np.diff(np.nan_to_num(trace.felt_n_mm, nan=0.0), prepend=np.nan, append=np.nan))
    steepest = np.fmax(step[1:], step[:-1]) / trace.plan.step_mm
    return np.asarray(np.hypot(scatter_n_mm, PLACE_MM * np.nan_to_num(steepest)))


def residuals(traces: tuple[Trace, ...], predicted: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """(samples,) of every trace, 0 where it is not to be used."""
    return [np.nan_to_num(t.felt_n_mm - p, nan=0.0) for t, p in zip(traces, predicted, strict=True)]


def jacobian_of(
    forward: Forward,
    at: Bench,
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    here: list[NDArray[np.float64]],
    sigma: list[NDArray[np.float64]],
) -> list[NDArray[np.float64]]:
    """(samples, n) of every trace: what each number does to the prediction; nothing where the tip jumps by it."""
    vector, n_shared, stiffness = at.vector(), len(Unknown), list(Unknown).index(Unknown.STIFFNESS)
    out = [np.zeros((p.size, vector.size)) for p in here]
    for i in np.flatnonzero(free[:n_shared]):
        if i == stiffness:
            continue
        step = np.zeros(vector.size)
        # a tip's radius is felt through the grid: a difference across several of its samples
        step[i] = (0.5 if list(Unknown)[i] is Unknown.RADIUS else STEP_SDS) * before[i]
        for k, (there, p) in enumerate(
            zip(forward.moments(Bench.of_vector(vector + step)), here, strict=True)
        ):
            jumps = np.abs(there - p) > MOST_SIGMAS * step[i] / before[i] * sigma[k]
            out[k][:, i] = np.where(jumps, 0.0, there - p) / step[i]
    for k, (trace, pressed) in enumerate(zip(forward.traces, forward.pressed(at), strict=True)):
        own = of_whisker(trace.whisker, n_whiskers=at.gain.size)
        out[k][:, own] = np.stack([pressed / at.gain[trace.whisker], *forward.units(trace, pressed)], axis=1)
        if free[stiffness]:
            out[k][:, stiffness] = pressed / at[Unknown.STIFFNESS]
        out[k][np.isnan(trace.felt_n_mm)] = 0.0
    return out


def descended(
    forward: Forward,
    start: Bench,
    nominal: Bench,
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    scatter_n_mm: float,
    blur_mm: float,
    loss: Loss,
) -> tuple[Bench, bool]:
    """Levenberg and Marquardt's descent, in units of what was known before."""
    p0, at, damping = nominal.vector(), start, 1e-3
    widths = [max(1, round(blur_mm / trace.plan.step_mm)) for trace in forward.traces]
    sigma = [
        np.full(trace.felt_n_mm.size, scatter_n_mm) if blur_mm else sample_sigma_n_mm(trace, scatter_n_mm)
        for trace in forward.traces
    ]

    # moments are linear in these, or as good as
    linear = np.arange(before.size) >= len(Unknown)
    linear[list(Unknown).index(Unknown.STIFFNESS)] = True
    smooth = linear[free]
    factor = linear & (np.arange(before.size) < len(Unknown) + start.gain.size)

    def missed(predicted: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        residual = residuals(forward.traces, predicted)
        return [_averaged(r, w) / s for r, w, s in zip(residual, widths, sigma, strict=True)]

    def cost(bench: Bench, predicted: list[NDArray[np.float64]]) -> float:
        misses = sum(loss.of(r) for r in missed(predicted))
        return misses + float((((bench.vector() - p0) / before)[free] ** 2).sum())

    def tried(at: Bench, step: NDArray[np.float64]) -> tuple[Bench, list[NDArray[np.float64]], float] | None:
        moved, off = at.vector(), np.zeros(before.size)
        off[free] = step * before[free]
        # factors of one product are changed as factors, so that what one gains the other loses to all orders
        moved = np.where(factor, moved * np.exp(off / np.where(factor, moved, 1.0)), moved + off)
        try:
            there = Bench.of_vector(moved)
            predicted = forward.moments(there)
        except WhiskerError:
            return None
        return there, predicted, cost(there, predicted)

    here = forward.moments(at)
    now = cost(at, here)
    for _ in range(MOST_STEPS):
        jacobian = jacobian_of(forward, at, before, free, here, sigma)
        scaled = [
            _averaged(j[:, free], width) * before[free] / s[:, None]
            for j, width, s in zip(jacobian, widths, sigma, strict=True)
        ]
        curvature = np.eye(int(free.sum()))
        downhill = np.zeros(int(free.sum()))
        for j, r in zip(scaled, missed(here), strict=True):
            w = loss.weight(r)
            curvature += j.T @ (w[:, None] * j)
            downhill += j.T @ (w * r)
        downhill -= ((at.vector() - p0) / before)[free]
        was, gone = now, 0.0
        for _ in range(DAMPED_TRIES):
            damped = curvature + damping * np.diag(np.diag(curvature))
            step = np.clip(np.linalg.solve(damped, downhill), -2.0, 2.0)
            then = tried(at, step)
            if then is not None and then[2] < now:
                (at, here, now), damping = then, damping / 5.0
                gone = float(np.abs(step).max())
                # what is left of the slope, to first order
                downhill = downhill - curvature @ step
                break
            damping *= 8.0
        for ways in _of_their_own(curvature, smooth):
            # Newton's step along these ways alone
            step = ways @ np.linalg.solve(ways.T @ curvature @ ways, ways.T @ downhill)
            step *= min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
            then = tried(at, step)
            if then is not None and then[2] < now:
                at, here, now = then
                gone = max(gone, float(np.abs(step).max()))
                downhill = downhill - curvature @ step
        if gone < SETTLED_SDS or was - now < SETTLED_COST[loss]:
            return at, True
    return at, False


def _of_their_own(curvature: NDArray[np.float64], smooth: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
    """(n, ways) along which steps are tried alone.

    A whole step is stopped by the roughness of contact, and then nothing else moves either: neither what only scales
    and adds, nor what the recording hardly tells, way by way.
    """
    yield np.eye(smooth.size)[:, smooth]
    values, vectors = np.linalg.eigh(curvature)
    for k in np.flatnonzero(values < SOFT):
        yield vectors[:, k : k + 1]


def _averaged(samples: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Each sample the mean of so many about it, along the first axis."""
    if width < 2:
        return samples
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(samples, width, axis=0, mode="nearest"))
