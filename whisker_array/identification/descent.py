"""The way down from a bench to the one that explains a recording best: Levenberg and Marquardt's, made for contact.

A tip that slips makes the sum of squares rough. So what a number does to a sample is taken across many roughnesses,
and not at all where the tip jumps; a loss that is bounded keeps what jumps from drowning the rest; and what the
recording hardly tells is moved by steps of its own, for a whole one is stopped by the roughness of what it tells well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.bench import Bench, Unknown, of_screw
from whisker_array.identification.forward import Forward
from whisker_array.identification.misses import Loss, innovations, residuals
from whisker_array.identification.tangents import jacobian_of
from whisker_array.whisker.sections import WhiskerError

MOST_STEPS = 25
SETTLED_SDS = 0.01
"""A step so small ends the descent."""
DAMPED_TRIES = 6
UNTOLD, SOFT = 1.5, 100.0
"""Curvatures in units of what was known before: of a way that the recording does not tell, and of one that it hardly
tells."""
SETTLED_COST = {Loss.HUBER: 10.0, Loss.BOUNDED: 0.3}
"""One that gains so little (in squares of a sigma) ends it, too."""


def descended(
    forward: Forward,
    start: Bench,
    nominal: Bench,
    before: NDArray[np.float64],
    free: NDArray[np.bool_],
    sigma: Sequence[NDArray[np.float64]],
    *,
    scatter_n_mm: float,
    loss: Loss,
    reach: float,
    blur_mm: float = 0.0,
) -> tuple[Bench, bool]:
    """Levenberg and Marquardt's descent, in units of what was known before.

    Args:
        forward: predicts.
        start: the bench to begin with.
        nominal: as drawn.
        before: (n,) standard deviations of the numbers before.
        free: (n,) those to be found.
        sigma: (samples,) of every trace.
        scatter_n_mm: of a sample.
        loss: of residuals.
        reach: of differences (`jacobian_of`).
        blur_mm: over which the signal is averaged.

    Returns:
        The bench, and whether the descent came to rest.
    """
    p0, at, damping = nominal.vector(), start, 1e-3
    widths = [max(1, round(blur_mm / trace.plan.step_mm)) for trace in forward.traces]

    # moments are linear in these, or as good as
    linear = np.arange(before.size) >= len(Unknown)
    linear[list(Unknown).index(Unknown.STIFFNESS)] = True
    smooth = linear[free]
    # of these there are too many to try each
    screws = np.zeros(before.size, dtype=np.bool_)
    for along_x in (True, False):
        screws[of_screw(before.size, along_x=along_x)] = True
    factor = linear & (np.arange(before.size) < len(Unknown) + start.gain.size)

    def seen(values: Iterable[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        return [
            innovations(_averaged(v, width), s, scatter=scatter_n_mm)
            for v, width, s in zip(values, widths, sigma, strict=True)
        ]

    def missed(predicted: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        return seen(residuals(forward.traces, predicted))

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
        jacobian = jacobian_of(forward, at, before, free, here, sigma, reach=reach)
        scaled = seen(j[:, free] * before[free] for j in jacobian)
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
        # a whole step is stopped by the roughness of contact, and then nothing else moves either: neither what only
        # scales and adds, nor what the recording hardly tells
        soft = (way[:, None] for way in _soft_ways(curvature, screws[free]))
        for ways in (np.eye(smooth.size)[:, smooth], *soft):
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


def _soft_ways(curvature: NDArray[np.float64], others: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
    """(n,) ways that the recording hardly tells, if it tells them at all; others give way to whatever is moved."""
    every = np.eye(others.size)
    give = np.linalg.solve(curvature[np.ix_(others, others)], curvature[np.ix_(others, ~others)])
    rest = every[:, ~others] - every[:, others] @ give
    values, vectors = np.linalg.eigh(rest.T @ curvature @ rest)
    for k in np.flatnonzero((values > UNTOLD) & (values < SOFT)):
        yield rest @ vectors[:, k]


def _averaged(samples: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Each sample the mean of so many about it, along the first axis."""
    if width < 2:
        return samples
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(samples, width, axis=0, mode="nearest"))
