"""Trade-off curves: contrast against the allowed sideways slide and against the scan speed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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
    """Contrast as a function of one limit, None where no whisker is possible; designed anew for each value."""

    name: str
    unit: str
    allowed: tuple[float, ...]
    contrast: tuple[float | None, ...]
    at: float


def slide_trade_off(design: Design) -> TradeOff:
    """Compute the contrast against the allowed sideways slide; every point has its own whisker."""
    request, lines = design.request, design.limits.slide_lines
    uses = {f: (request, replace(design.limits, slide_lines=f * lines)) for f in SLIDE_FACTORS}
    return _trade_off(design, uses, "sideways slide allowed", "mm", lines * request.line_pitch_mm)


def speed_trade_off(design: Design, factors: Iterable[float] = SPEED_FACTORS) -> TradeOff:
    """Compute the contrast against the required scan speed; see `slide_trade_off`."""
    least_mm_s = design.request.least_speed_mm_s
    uses = {f: (replace(design.request, speed_mm_s=f * least_mm_s), design.limits) for f in factors}
    return _trade_off(design, uses, "scan speed", "mm/s", least_mm_s)


def _trade_off(
    design: Design, uses: Mapping[float, tuple[Request, Limits]], name: str, unit: str, at: float
) -> TradeOff:
    kind: SectionKind = "ribbon" if isinstance(design.whisker.section, Rectangle) else "round"
    first_order = check(design.whisker, design.request, design.limits, preload_mm=design.preload_mm)
    scale = design.linear_error / float(first_order.table[Bound.LINEAR_BEAM][0].max())
    here = Candidate(design.whisker, design.preload_mm, design.contrast, 0.0)
    ordered = sorted(uses)
    reached: dict[float, float] = {}
    for side in ([f for f in ordered if f >= 1.0], [f for f in ordered[::-1] if f < 1.0]):
        neighbour = here
        for factor in side:
            problem = Problem(*uses[factor], kind, error_scale=scale)
            polished = polish(problem, neighbour, rounds=2) or _from_inside(problem, neighbour)
            if polished is None:
                break  # an even tighter limit has no whisker either
            neighbour = polished
            reached[factor] = polished.worth
    return TradeOff(name, unit, tuple(f * at for f in ordered), tuple(reached.get(f) for f in ordered), at)


def _from_inside(problem: Problem, neighbour: Candidate) -> Candidate | None:
    inside = climb(problem, problem.encode(neighbour), only_reserve=True)
    return polish(problem, inside, rounds=2) if inside.reserve > 0.0 else None
