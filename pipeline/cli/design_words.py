"""Words about designs: their limits, why no whisker meets all of them, and figures of a whisker that is built."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from pipeline.reading.predictions import Quantity
from whisker_array.design.checks import check
from whisker_array.design.design import NoWhiskerError, worst_edge
from whisker_array.design.limits import Bound, DesignError, Request
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch


class BoundWords(NamedTuple):
    """What a limit compares, for tables, and what to change where it cannot be kept."""

    label: str
    hint: str


BOUND_WORDS: Final[Mapping[Bound, BoundWords]] = {
    Bound.JAMMING: BoundWords(
        "lift on the steepest wall / on the land", "take walls less steep or a narrower range of friction"
    ),
    Bound.STRESS: BoundWords(
        "bending stress, steepest wall, MPa", "allow more stress, a slower scan or a longer whisker"
    ),
    Bound.FORCE: BoundWords(
        "normal force, steepest wall, N", "allow more force, a slower scan or a weaker signal"
    ),
    Bound.GROOVE_FLOOR: BoundWords("preload, mm", "take shallower marks"),
    Bound.DEFLECTION: BoundWords("tip deflection / l1", "allow a longer whisker or a slower scan"),
    Bound.LINEAR_BEAM: BoundWords(
        "linear-beam error on the land", "allow a longer whisker, a slower scan or a larger error"
    ),
    Bound.SLIDE: BoundWords(
        "sideways slide into a groove, mm", "take a ribbon, larger characters or shallower marks"
    ),
    Bound.SPEED: BoundWords("finest detail / first frequency", "scan slower"),
    Bound.SIGNAL: BoundWords("strain at the base, land, 1e-6", "allow a weaker signal or more force"),
    Bound.ELBOW: BoundWords("elbow's underside over the tip, mm", "allow a larger k or shallower marks"),
    Bound.CLAMP: BoundWords(
        "clamp's underside over the land, mm", "allow a larger setting angle or a larger k"
    ),
    Bound.AXIS: BoundWords("sensor axis over the free tip, mm", "allow a larger setting angle or a larger k"),
    Bound.LOWERED: BoundWords(
        "sensor axis over the free tip, mm", "let the sensor's axis stand above the clamp"
    ),
    Bound.WIDTH: BoundWords("width, mm", "allow a wider ribbon (whiskers further apart)"),
    Bound.LENGTH: BoundWords("l1, mm", "allow other lengths of l1"),
    Bound.K: BoundWords("k = l2 / l1", "allow another k"),
    Bound.BETA: BoundWords("beta, deg", "allow other setting angles"),
    Bound.THICKNESS: BoundWords("thickness or diameter, mm", "allow other thicknesses"),
    Bound.ASPECT: BoundWords("width / thickness", "allow other ribbons"),
}


def explain_failure(error: NoWhiskerError) -> str:
    """Name the limits that cannot be met together, by how much the nearest whisker misses them, and what would help."""
    problem, nearest = error.problem, error.nearest
    if problem is None or nearest is None:
        return error.what
    scale, preload = problem.error_scale, nearest.preload_mm
    checked = check(nearest.whisker, problem.request, problem.limits, preload_mm=preload, error_scale=scale)
    rows = {row.bound: row for row in checked.rows()}
    missed = "; ".join(
        f"{BOUND_WORDS[bound].label} comes to {rows[bound].value:.3g} where "
        f"{'at most' if rows[bound].at_most else 'at least'} {rows[bound].limit:.3g} is allowed"
        for bound in error.bounds
    )
    kind = "round wire" if problem.section == "round" else "ribbon"
    mend = ", or ".join(dict.fromkeys(BOUND_WORDS[bound].hint for bound in error.bounds))
    return f"no whisker of {kind} meets all limits together; the nearest one: {missed}. Mend: {mend}"


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
