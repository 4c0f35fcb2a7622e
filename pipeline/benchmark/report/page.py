"""The pages of a benchmark: templates filled, with nothing beside the page needed to show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.benchmark.analysis.factors import FactorEffect, LevelEffect, factor_name
from pipeline.benchmark.analysis.shares import Estimate
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.report.charts import severity_name
from pipeline.common.shares import Share


def rendered(template: str, **values: Any) -> str:
    """A page of `pipeline.benchmark.report.templates`."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pipeline.benchmark.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters.update(
        percent=percent, severity=severity_name, span=span, ms=_ms, p=_p, factor=factor_name, level=level_name,
        points=points, points_span=_points_span,
    )  # fmt: skip
    return environment.get_template(template).render(**values)


@dataclass(frozen=True)
class Bar:
    """Where a value and its interval stand on a scale, in percent of its length.

    Attributes:
        low: left end of the interval.
        wide: its length.
        value: the mark.
    """

    low: float
    wide: float
    value: float


def bars(effect: FactorEffect) -> tuple[float, list[tuple[LevelEffect, Bar]]]:
    """(share at the left end of the scale, every level with its bar); the right end is 100 % of characters."""
    foot = min(0.9, int(10.0 * min(e.characters.low for e in effect.levels)) / 10.0)

    def place(share: float) -> float:
        return round(100.0 * (share - foot) / (1.0 - foot), 2)

    return foot, [
        (e, Bar(place(e.characters.low), place(e.characters.high) - place(e.characters.low), place(e.characters.value)))
        for e in effect.levels
    ]  # fmt: skip


def percent(share: Share | Estimate) -> str:
    """A share: "97.25 %"."""
    return f"{100 * share.value:.2f} %"


def span(ends: Share | Estimate | tuple[float, float]) -> str:
    """The ends of an interval of a share, percent."""
    low, high = ends if isinstance(ends, tuple) else (ends.low, ends.high)
    return f"{100 * low:.1f} – {100 * high:.1f}"


def points(value: float) -> str:
    """A difference of shares, in percentage points with its sign."""
    return f"{100 * value:+.1f}".replace("-", "−")


def _points_span(ends: Estimate | Sequence[float]) -> str:
    low, high = (ends.low, ends.high) if isinstance(ends, Estimate) else ends
    return f"{points(low)} to {points(high)}"


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.0f}" if seconds >= 0.01 else f"{1000 * seconds:.1f}"


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else f"{value:.3f}"
