"""Trade-offs: the contrast against the slide allowed and against the scan speed.

Each point is a whisker designed anew from its neighbour. The elastica's error is scaled as it is for the design.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from glyphs.surface.display import OneLine
from whisker_array.design.checks import check
from whisker_array.design.design import Design
from whisker_array.design.limits import Bound, Limits, Request
from whisker_array.design.search import Candidate, Problem, SectionKind, climb, polish
from whisker_array.whisker.sections import Rectangle

SLIDE_FACTORS = (0.125, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
SPEED_FACTORS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)


@dataclass(frozen=True, repr=False)
class TradeOff(OneLine):
    """Contrast at other values of one limit, the whisker designed anew for each.

    Attributes:
        name: the limit.
        unit: of `allowed`.
        allowed: the limit, ascending.
        contrast: worst-case contrast that is reached; None where no whisker can be made.
        at: the limit of the design itself.
    """

    name: str
    unit: str
    allowed: tuple[float, ...]
    contrast: tuple[float | None, ...]
    at: float


def slide_trade_off(design: Design, factors: Iterable[float] = SLIDE_FACTORS) -> TradeOff:
    """Contrast against the sideways slide allowed, each point a whisker of its own.

    Args:
        design: the design to start from.
        factors: times the slide allowed there.
    """
    at = design.limits.slide_lines * design.line_pitch_mm

    def change(factor: float) -> tuple[Request, Limits]:
        return design.request, replace(design.limits, slide_lines=factor * design.limits.slide_lines)

    return _trade_off(design, factors, change, name="sideways slide allowed", unit="mm", at=at)


def speed_trade_off(design: Design, factors: Iterable[float] = SPEED_FACTORS) -> TradeOff:
    """Contrast against the scan speed to be reached; see `slide_trade_off`."""
    at = design.request.least_speed_mm_s

    def change(factor: float) -> tuple[Request, Limits]:
        return replace(design.request, speed_mm_s=factor * at), design.limits

    return _trade_off(design, factors, change, name="scan speed", unit="mm/s", at=at)


def _trade_off(
    design: Design,
    factors: Iterable[float],
    change: Callable[[float], tuple[Request, Limits]],
    *,
    name: str,
    unit: str,
    at: float,
) -> TradeOff:
    """Each point starts from its neighbour nearer the design."""
    kind: SectionKind = "ribbon" if isinstance(design.whisker.section, Rectangle) else "round"
    first_order = check(design.whisker, design.request, design.limits, preload_mm=design.preload_mm)
    scale = design.linear_error / float(first_order.values[Bound.LINEAR_BEAM].max())
    here = Candidate(design.whisker, design.preload_mm, design.contrast, 0.0)
    ordered = sorted(set(factors))
    reached: dict[float, float] = {}
    for side in ([f for f in ordered if f >= 1.0], [f for f in ordered[::-1] if f < 1.0]):
        neighbour = here
        for factor in side:
            request, limits = change(factor)
            problem = Problem(request, limits, kind, error_scale=scale)
            found = polish(problem, neighbour, rounds=2) or _from_inside(problem, neighbour)
            if found is None:
                break  # a tighter limit still leaves no whisker either
            neighbour = found
            reached[factor] = found.worth
    return TradeOff(name, unit, tuple(f * at for f in ordered), tuple(reached.get(f) for f in ordered), at)


def _from_inside(problem: Problem, neighbour: Candidate) -> Candidate | None:
    """Once more, from the point near the neighbour that keeps the limits best."""
    inside = climb(problem, problem.encode(neighbour), only_reserve=True)
    return polish(problem, inside, rounds=2) if inside.reserve > 0.0 else None
