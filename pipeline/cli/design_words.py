"""Sentences about designs: why no whisker meets all limits, and figures of a whisker that is built."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from whisker_array.design.checks import check, normal_forces_n
from whisker_array.design.design import NoWhiskerError, worst_edge
from whisker_array.design.limits import Bound, DesignError, Request
from whisker_array.design.search import Problem
from whisker_array.identification.predictions import Quantity
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch


def explain_failure(error: NoWhiskerError) -> str:
    """Name the limits that cannot be met together, by how much the nearest whisker misses them, and what would help."""
    problem, nearest = error.problem, error.nearest
    if problem is None or nearest is None:
        return error.what
    scale, preload = problem.error_scale, nearest.preload_mm
    checked = check(nearest.whisker, problem.request, problem.limits, preload_mm=preload, error_scale=scale)
    rows = {row.bound: row for row in checked.rows()}
    missed = "; ".join(
        f"{bound.label} comes to {rows[bound].value:.3g} where "
        f"{'at most' if rows[bound].at_most else 'at least'} {rows[bound].limit:.3g} is allowed"
        for bound in error.bounds
    )
    kind = "round wire" if problem.section == "round" else "ribbon"
    return (
        f"no whisker of {kind} meets all limits together; the nearest one: {missed}. Mend: {error.hint}"
        + (_jam_hint(problem) if Bound.JAMMING in error.bounds else "")
    )


def _jam_hint(problem: Problem) -> str:
    """The steepest wall and the greatest friction that some shape can do, the other kept."""
    request, limits = problem.request, problem.limits
    shapes = [
        LShaped(1.0, 0.5 * (a / 0.75), None, 0.0, Rectangle(1e-3, 1e-2))
        for a in np.linspace(0.0, 1.5 * limits.k[1] + math.tan(limits.beta_rad[1]), 80)
    ]

    def free(alpha: float, mu: float) -> bool:
        return any(
            normal_forces_n(
                s, preload_mm=1.0, alpha_rad=np.array([alpha, -alpha]), mu=np.array([request.mu[0], mu])
            )[1].min()
            > limits.lift_share
            for s in shapes
        )

    steepest = _largest(lambda a: free(a, request.mu[1]), 0.0, request.alpha_rad[1])
    most = _largest(lambda m: free(request.alpha_rad[1], m), request.mu[0], request.mu[1])
    says = []
    if steepest is not None and steepest > request.alpha_rad[0]:
        says.append(f"walls up to {math.floor(math.degrees(steepest))} degrees at this friction")
    if most is not None:
        says.append(f"friction up to {math.floor(100.0 * most) / 100.0:g} on these walls")
    return f" ({' or '.join(says)} would not jam)" if says else ""


def _largest(holds: Callable[[float], bool], low: float, high: float) -> float | None:
    """The largest value that holds, by halving; None if not even the low end does."""
    if not holds(low):
        return None
    if holds(high):
        return high
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def fitness(request: Request) -> dict[str, Quantity]:
    """Figures by what they are called; NaN where the whisker jams on a wall of the request."""

    def figure(number: int) -> Quantity:
        def of(whisker: LShaped, touch: Touch) -> float:
            try:
                worst, (least, greatest) = worst_edge(whisker, request, preload_mm=touch.preload_mm)
            except DesignError:
                return math.nan
            return (worst.contrast, least, greatest)[number]

        return of

    names = ("worst edge contrast", "F over all walls, least", "F over all walls, greatest")
    return {name: figure(number) for number, name in enumerate(names)}
