"""The dashboard's charts: parts per hour or day as bars, shares of them as lines; the template draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pipeline.common.records import TrendStep

_MOST_TICKS, _MOST_LABELS, _MOST_HOURS = 4, 8, 48


@dataclass(frozen=True)
class Chart:
    """Bars or lines over the steps of a trend.

    Attributes:
        title: what it shows.
        tick: distance of the lines across, in parts or per cent.
        top: value at the top, a multiple of `tick`.
        every: of so many steps one is labelled.
        bars: a value each step.
        lines: values by name; None at a step without parts.
    """

    title: str
    tick: int
    top: int
    every: int
    bars: Sequence[int] = ()
    lines: Mapping[str, Sequence[float | None]] = field(default_factory=dict)


def charts_of(trend: Sequence[TrendStep], *, each: str) -> tuple[Chart, ...]:
    """Parts, those accepted, and those that were trouble; none where there are fewer than two steps to compare.

    Args:
        trend: hours or days, in order.
        each: hour or day.
    """
    if len(trend) < 2:
        return ()
    every = -(-len(trend) // _MOST_LABELS)
    if len(trend) > _MOST_HOURS:  # labelled by their dates, each once
        every = 24 * -(-every // 24)

    def chart(title: str, *, bars: Sequence[int] = (), least: float = 1.0, **counts: list[int]) -> Chart:
        lines = {
            name.replace("_", " "): [
                100.0 * n / s.parts if s.parts else None for n, s in zip(values, trend, strict=True)
            ]
            for name, values in counts.items()
        }
        most = max([least, *bars, *(v for values in lines.values() for v in values if v is not None)])
        tick = next(f * 10**p for p in range(20) for f in (1, 2, 5) if most <= _MOST_TICKS * f * 10**p)
        return Chart(title, tick, tick * max(1, -int(-most // tick)), every, bars, lines)

    return (
        chart(f"Parts per {each}", bars=[s.parts for s in trend], least=0.0),
        chart(f"Accepted per {each}", least=100.0, accepted=[s.accepted for s in trend]),
        chart(
            f"To a person, and rejected, per {each}",
            to_a_person=[s.review for s in trend],
            rejected=[s.rejects for s in trend],
        ),
    )
