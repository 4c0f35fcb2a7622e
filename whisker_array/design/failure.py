"""Why no whisker does what is asked: the constraints that cannot be met together, and what would help."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from whisker_array.design.checks import check, normal_forces_n
from whisker_array.design.limits import Bound, Constraint
from whisker_array.design.search import Candidate, Problem, conflict, starts
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import LShaped


def why_not(problem: Problem, *, seed: int) -> str:
    """Name the constraints that cannot be met together, and what would help."""
    rng = np.random.default_rng(seed)
    nearest, bounds = conflict(problem, list(starts(problem, n=3, rng=rng)))
    rows = _rows(nearest, problem)
    limits_missed = "; ".join(
        f"{bound.label} comes to {rows[bound].value:.3g} where "
        f"{'at most' if rows[bound].at_most else 'at least'} {rows[bound].limit:.3g} is allowed"
        for bound in bounds
    )
    hints = list(dict.fromkeys(bound.hint for bound in bounds))
    kind = "round wire" if problem.section == "round" else "ribbon"
    return (
        f"no whisker of {kind} meets all limits together; the nearest one: {limits_missed}. Mend: {', or '.join(hints)}"
        + (_jam_hint(problem) if Bound.JAMMING in bounds else "")
    )


def _rows(candidate: Candidate, problem: Problem) -> dict[Bound, Constraint]:
    """The table of a candidate."""
    checked = check(
        candidate.whisker,
        problem.request,
        problem.limits,
        preload_mm=candidate.preload_mm,
        error_scale=problem.error_scale,
    )
    return {row.bound: row for row in checked.rows()}


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
