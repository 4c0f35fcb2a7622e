"""Sentences about designs: why no whisker meets all limits, and figures of a whisker that is built."""

from __future__ import annotations

import math

from pipeline.reading.predictions import Quantity
from whisker_array.design.checks import check
from whisker_array.design.design import NoWhiskerError, worst_edge
from whisker_array.design.limits import DesignError, Request
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
    return f"no whisker of {kind} meets all limits together; the nearest one: {missed}. Mend: {error.hint}"


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
