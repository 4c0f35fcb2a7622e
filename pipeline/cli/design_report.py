"""Report a design in words and tables for the engineer who builds it, or why no whisker meets all limits."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from pipeline.cli.shared import print_table
from pipeline.reading.predictions import Quantity
from whisker_array.design.array_design import ArrayChoice, ArrayRequest
from whisker_array.design.checks import check
from whisker_array.design.design import Design, NoWhiskerError, worst_edge
from whisker_array.design.limits import Bound, Constraint, DesignError, Request
from whisker_array.design.plan_accuracy import describe_directions
from whisker_array.design.search import sides_mm
from whisker_array.design.trade import TradeOff
from whisker_array.design.tuned import Kind, Tuned
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

_SIZES = (Bound.LENGTH, Bound.K, Bound.BETA, Bound.THICKNESS, Bound.ASPECT)
"""Limits of sizes that can be made; reported only if they bind."""


class BoundWords(NamedTuple):
    """Name of a limit in tables, and the change that helps to keep it."""

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
    Bound.AXIS: BoundWords(
        "sensor axis over the free tip, mm",
        "allow a larger setting angle or a larger k, or a smaller --axis-clearance-mm",
    ),
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
    """Name the limits that cannot be met together, how far the nearest whisker misses them, and what would help."""
    problem, nearest = error.problem, error.nearest
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
    """Figures of a whisker for a request, by name; NaN if it jams on a wall of the request."""

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


def print_report(design: Design, *, trades: Sequence[TradeOff] = (), tuned: Tuned | None = None) -> None:
    """Print the request, the whisker to build, its edge contrast, and the limits that bind."""
    print("\n".join(_describe(design)))
    if tuned is not None:
        _print_tuned(tuned)
    else:
        print("\n".join(_contrast(design)))
    print_limits(design.constraints)
    for trade in trades:
        _print_trade(trade)


def _describe(design: Design) -> list[str]:
    r, w = design.request, design.whisker
    low, high = (math.degrees(a) for a in r.alpha_rad)
    where = "below" if w.lowered_mm >= 0.0 else "above"
    return [
        f"asked: walls {low:g} to {high:g} deg falling and rising, friction {r.mu[0]:g} to {r.mu[1]:g}, marks "
        f"{r.depth_mm:g} mm deep, characters {r.character_height_mm:g} mm, {r.least_speed_mm_s:g} mm/s\n",
        f"build  {_describe_section(w)}",
        f"       l1 {w.l1_mm:.2f} mm set at beta {math.degrees(w.beta_rad):.2f} deg, tip arm l2 {w.l2_mm:.2f} mm "
        f"(k = {w.k:.3f}), ground down to a ball of radius {design.request.tip_radius_mm:.3f} mm",
        f"       sensor axis {abs(w.lowered_mm):.2f} mm {where} the clamp (l3 {w.lowered_mm:.2f} mm), "
        f"{design.axis_over_land_mm:.2f} mm above the land",
        f"use    preload {design.preload_mm:.3f} mm, lines {design.request.line_pitch_mm:.3f} mm, samples "
        f"{design.request.sample_pitch_mm:.4f} mm, up to {design.speed_mm_s:.0f} mm/s",
        f"       force on the land up to {design.land_force_n:.3f} N, first frequency with the tip held "
        f"{design.frequency_hz:.0f} Hz\n",
    ]


def _contrast(design: Design) -> list[str]:
    worst, low, high = design.worst, *design.factor_range
    way = "falling" if worst.alpha_rad > 0.0 else "rising"
    exact = f"{design.contrast_exact:.3f}" if math.isfinite(design.contrast_exact) else "no answer"
    lines = [
        f"worst edge contrast {worst.contrast:.3f} of the land moment: {worst.lip.value} of a {way} wall of "
        f"{abs(math.degrees(worst.alpha_rad)):.0f} deg at friction {worst.mu:.2g} (exact beam: {exact})",
        f"F from {low:.2f} to {high:.2f} over all walls and frictions; linear beam wrong by "
        f"{100.0 * design.linear_error:.1f} % on the land",
    ]
    height_mm = design.request.character_height_mm
    with contextlib.suppress(DesignError):  # the default whisker jams
        other, _ = worst_edge(
            default_whisker(height_mm), design.request, preload_mm=default_preload_mm(height_mm)
        )
        lines.append(f"for comparison, the default whisker for this height: {other.contrast:.3f}")
    return lines


def print_limits(constraints: Iterable[Constraint]) -> None:
    """Print a table of the limits: value, allowed, and room left."""
    rows = (
        (
            BOUND_WORDS[c.bound].label,
            f"{c.value:.4g}",
            "<=" if c.at_most else ">=",
            f"{c.limit:.4g}",
            _room(c),
        )
        for c in constraints
        if c.binding or c.bound not in (*_SIZES, Bound.LOWERED)
    )
    print()
    print_table(("limit", "here", "", "allowed", "room"), rows, ("limit",))


def _room(constraint: Constraint, *, rounding: float = 5e-3) -> str:
    if constraint.slack < -rounding:
        return "broken"
    if constraint.binding:
        return "binds"
    return f"{100.0 * constraint.slack:.0f} %" if constraint.slack < 10.0 else "ample"


def _print_trade(trade: TradeOff) -> None:
    rows = (
        (
            f"{angle:.3g}",
            "none" if contrast is None else f"{contrast:.3f}",
            "as designed" if angle == trade.at else "",
        )
        for angle, contrast in zip(trade.allowed, trade.contrast, strict=True)
    )
    print()
    print_table((f"{trade.name}, {trade.unit}", "worst edge contrast", ""), rows, ("",))


def _print_tuned(tuned: Tuned) -> None:
    low, middle, high = tuned.table_mu
    places = ", ".join(f"{math.degrees(p):.1f}" for p in tuned.place_rad)
    angle = f"{math.degrees(tuned.alpha_rad):g} deg"
    if tuned.kind is Kind.NULL:
        print(
            f"null at {angle}: the moment vanishes there and changes sign, "
            "gentler walls one way, steeper ones the other"
        )
    else:
        print(
            f"threshold at {angle}: no other whisker grows faster there; steeper walls than {angle} may jam it"
        )
    print(
        f"{'the moment vanishes' if tuned.kind is Kind.NULL else 'it would jam'} at {places} deg at friction "
        f"{low:.2g}, {middle:.2g}, {high:.2g}: friction shifts the place of every whisker by its friction angle\n"
        f"ten degrees off change F by at least {tuned.selectivity:.3f} at any friction of the range\n"
    )
    lines = zip(tuned.table_deg, tuned.table, strict=True)
    rows = ((f"{degrees:g}", *map(_factor, row)) for degrees, row in lines)
    print_table(("alpha, deg", *(f"F, mu = {mu:.2g}" for mu in tuned.table_mu)), rows)


def _factor(value: float) -> str:
    return "jams" if np.isnan(value) else f"{round(float(value), 2) + 0.0:.2f}"


def print_arrays(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> None:
    """Print the choices as a table and the quickest one in words; no line is wider than 80 characters."""
    x0, y0, x1, y1 = request.region_mm
    print(
        f"Characters {request.character_height_mm:g} mm high, {x1 - x0:.1f} x {y1 - y0:.1f} mm scanned,\n"
        f"{100 * request.accuracy:g} % of characters right at dirt {request.severity:g} (as measured):\n"
    )
    headings = ("whiskers", "rows", "stagger mm", "pitch mm", "ribbon mm", "beta deg", "lines", "ways", "passes",
                "mm/s", "stage s")  # fmt: skip
    rows = (
        (a.n_whiskers, a.rows, f"{a.stagger_mm:.2f}", f"{a.pitch_mm:.2f}", f"{sides_mm(c.whisker)[1]:.2f}",
         f"{math.degrees(c.whisker.beta_rad):.0f}", c.measured.lines, len(c.measured.directions), c.plan.n_passes,
         f"{c.plan.speed_mm_s:.0f}", f"{c.stage_s:.1f}")
        for c in choices
        for a in [c.plan.array]
    )  # fmt: skip
    print_table(headings, rows)
    best = min(choices, key=lambda c: c.stage_s)
    read = best.measured
    print(
        f"\nQuickest: {best.plan.array.n_whiskers} whiskers, {best.stage_s:.1f} s a serial, "
        f"{describe_directions(read.directions)}; on {read.parts} parts scanned\n"
        f"so, {100 * read.accuracy:.1f} % (+-{100 * read.spread:.1f}) of characters were right, "
        f"{read.accepted} accepted, {read.accepted_wrong} of these wrong.\n"
        "Accuracy was measured with the default whisker, slow: python\n"
        f"tests/benchmarks/plan_accuracy.py. Speed makes the edge map wrong by {100 * request.speed_error:g} %."
    )


def _describe_section(whisker: LShaped) -> str:
    section, material = whisker.section, whisker.material.name
    if isinstance(section, Rectangle):
        return f"{material} ribbon {section.thickness_mm:.3f} mm thick, {section.width_mm:.2f} mm wide"
    if isinstance(section, Round):
        return f"round {material} {section.diameter_mm:.3f} mm"
    return f"{material}, {section}"
