"""Report of a design in words and tables, for the engineer building it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pipeline.common.section_words import describe_section
from whisker_array.design.array_design import ArrayChoice, ArrayRequest, ribbon_mm
from whisker_array.design.design import Design, worst_edge
from whisker_array.design.limits import Bound, Constraint, DesignError
from whisker_array.design.plan_accuracy import ways_words
from whisker_array.design.trade import TradeOff
from whisker_array.design.tuned import NEIGHBOUR_RAD, Kind, Tuned, factors
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.shapes import LShaped

_SIZES = (Bound.LENGTH, Bound.K, Bound.BETA, Bound.THICKNESS, Bound.ASPECT)
"""Ranges of what can be made: named where they bind."""


def report(design: Design, *, trades: Sequence[TradeOff] = (), tuned: Tuned | None = None) -> list[str]:
    """The lines to print."""
    lines = [_asked(design), "", *_built(design), *_used(design), ""]
    lines += _tuned(tuned) if tuned is not None else _contrast(design)
    lines += ["", *_table(design.constraints)]
    for trade in trades:
        lines += ["", *_trade(trade)]
    return lines


def _asked(design: Design) -> str:
    r = design.request
    low, high = (math.degrees(a) for a in r.alpha_rad)
    return (
        f"asked: walls {low:g} to {high:g} deg falling and rising, friction {r.mu[0]:g} to {r.mu[1]:g}, marks "
        f"{r.depth_mm:g} mm deep, characters {r.character_height_mm:g} mm, {r.least_speed_mm_s:g} mm/s"
    )


def _built(design: Design) -> list[str]:
    w = design.whisker
    where = "below" if w.lowered_mm >= 0.0 else "above"
    return [
        f"build  {describe_section(w)}",
        f"       l1 {w.l1_mm:.2f} mm set at beta {math.degrees(w.beta_rad):.2f} deg, tip arm l2 {w.l2_mm:.2f} mm "
        f"(k = {w.k:.3f}), ground down to a ball of radius {design.tip_radius_mm:.3f} mm",
        f"       sensor axis {abs(w.lowered_mm):.2f} mm {where} the clamp (l3 {w.lowered_mm:.2f} mm), "
        f"{design.axis_over_land_mm:.2f} mm above the land",
    ]


def _used(design: Design) -> list[str]:
    return [
        f"use    preload {design.preload_mm:.3f} mm, lines {design.line_pitch_mm:.3f} mm, samples "
        f"{design.sample_pitch_mm:.4f} mm, up to {design.speed_mm_s:.0f} mm/s",
        f"       force on the land up to {design.land_force_n:.3f} N, first frequency with the tip held "
        f"{design.frequency_hz:.0f} Hz",
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
    h = design.request.character_height_mm
    others: tuple[tuple[str, LShaped, float], ...] = (
        ("the default whisker for this height", default_whisker(h), default_preload_mm(h)),
        ("this whisker with its gauge at the clamp (l3 = 0)", _at_clamp(design.whisker), design.preload_mm),
    )
    for name, whisker, preload in others:
        try:
            other, _ = worst_edge(whisker, design.request, preload_mm=preload)
            lines.append(f"for comparison, {name}: {other.contrast:.3f}")
        except DesignError:
            lines.append(f"for comparison, {name}: jams")
    return lines


def _at_clamp(w: LShaped) -> LShaped:
    return LShaped(w.l1_mm, w.l2_mm, 0.0, w.beta_rad, w.section, w.material)


def _table(constraints: Iterable[Constraint]) -> list[str]:
    lines = [f"{'limit':<42}{'here':>10}{'':>5}{'allowed':>9}{'room':>8}"]
    for c in constraints:
        if c.bound in _SIZES and not c.binding:
            continue
        if c.bound is Bound.LOWERED and not c.binding:
            continue
        sign = "<=" if c.at_most else ">="
        room = "binds" if c.binding else f"{100.0 * c.slack:.0f} %" if c.slack < 10.0 else "ample"
        lines.append(f"{c.bound.label:<42}{c.value:>10.4g}{sign:>5}{c.limit:>9.4g}{room:>8}")
    return lines


def _trade(trade: TradeOff) -> list[str]:
    cells = ["none" if c is None else f"{c:.3f}" for c in trade.contrast]
    allowed = [f"{a:.3g}" for a in trade.allowed]
    width = max(len(text) for text in (*cells, *allowed)) + 2
    head, under = f"{trade.name}, {trade.unit}", "worst edge contrast"
    first = max(len(head), len(under)) + 1
    mark = "".join(f"{'^' if a == trade.at else '':>{width}}" for a in trade.allowed).rstrip()
    return [
        f"{head:<{first}}" + "".join(f"{text:>{width}}" for text in allowed),
        f"{under:<{first}}" + "".join(f"{text:>{width}}" for text in cells),
        *([f"{'':<{first}}{mark} as designed"] if mark else []),
    ]


def _tuned(tuned: Tuned) -> list[str]:
    low, middle, high = tuned.table_mu
    places = [f"{math.degrees(p):.1f}" for p in tuned.place_rad]
    at = f"{math.degrees(tuned.alpha_rad):g} deg"
    what = (
        f"null at {at}: the moment vanishes there and changes sign, gentler walls one way, steeper ones the other"
        if tuned.kind is Kind.NULL
        else f"threshold at {at}: no other whisker grows faster there; steeper walls than {at} may jam it"
    )
    place = "the moment vanishes" if tuned.kind is Kind.NULL else "it would jam"
    lines = [
        what,
        f"{place} at {places[0]}, {places[1]}, {places[2]} deg at friction {low:.2g}, {middle:.2g}, {high:.2g}: "
        "friction shifts the place of every whisker by its friction angle",
        f"ten degrees off change F by at least {tuned.selectivity:.3f} at any friction of the range",
        _beside(tuned),
        "",
        f"{'alpha, deg':<14}" + "".join(f"{d:>7}" for d in tuned.table_deg),
    ]
    for column, mu in enumerate(tuned.table_mu):
        cells = ["jams" if np.isnan(f) else _two(f) for f in tuned.table[:, column]]
        lines.append(f"{f'F, mu = {mu:.2g}':<14}" + "".join(f"{text:>7}" for text in cells))
    return lines


def _beside(tuned: Tuned) -> str:
    """F at the inclination and ten degrees to either side, at middle friction."""
    at = tuned.alpha_rad + np.array([-NEIGHBOUR_RAD, 0.0, NEIGHBOUR_RAD])
    mu = tuned.table_mu[1]
    found = factors(tuned.design.whisker, alpha_rad=at, mu=np.array([mu]))[:, 0]
    pairs = (
        f"{'jams' if np.isnan(f) else _two(f)} at {math.degrees(a):g}" for f, a in zip(found, at, strict=True)
    )
    return f"at friction {mu:.2g} F is {', '.join(pairs)} deg"


def _two(value: float) -> str:
    """Two decimals, and no minus before nothing."""
    return f"{round(float(value), 2) + 0.0:.2f}"


def array_report(request: ArrayRequest, choices: Sequence[ArrayChoice]) -> list[str]:
    """List the choices as a table and the quickest one in words; no line is wider than 80 characters."""
    x0, y0, x1, y1 = request.region_mm
    out = [
        f"Characters {request.character_height_mm:g} mm high, {x1 - x0:.1f} x {y1 - y0:.1f} mm felt,",
        f"{100 * request.accuracy:g} % of characters right at dirt {request.severity:g} (as measured):",
        "",
        "whiskers  rows  stagger  pitch  ribbon  incl.  lines  ways  passes  mm/s  stage",
        "                     mm     mm      mm                                        s",
    ]
    for c in choices:
        a = c.plan.array
        out.append(
            f"{a.n_whiskers:8d}  {a.rows:4d}  {a.stagger_mm:7.2f}  {a.pitch_mm:5.2f}  {ribbon_mm(c.whisker):6.2f}"
            f"  {math.degrees(c.whisker.beta_rad):4.0f}°  {c.lines:5d}  {len(c.measured.directions):4d}"
            f"  {c.plan.n_passes:6d}  {c.plan.speed_mm_s:4.0f}  {c.stage_s:5.1f}"
        )
    best = min(choices, key=lambda c: c.stage_s)
    read = best.measured
    out += [
        "",
        f"Quickest: {best.plan.array.n_whiskers} whiskers, {best.stage_s:.1f} s a serial, "
        f"{ways_words(read.directions)}; of {read.parts} parts so",
        f"felt, {100 * read.accuracy:.1f} % (+-{100 * read.spread:.1f}) of characters were right, "
        f"{read.accepted} accepted, {read.accepted_wrong} of these wrong.",
        "Accuracy was measured with the default whisker, slow: python",
        "tests/benchmarks/plan_accuracy.py. Speed makes the edge map wrong by "
        f"{100 * request.speed_error:g} %.",
    ]
    return out
