"""The dashboard's charts: parts per hour or day as bars, shares of them as lines, in the units of an SVG.

|            ___          one pitch a step, its bar in the middle of it;
|  _   _    /   .         a line breaks where no parts came
| | | | |  |  |
+----------------- width
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

from pipeline.common.records import TrendStep

WIDTH, HEIGHT = 1000.0, 150.0
_MOST_LABELS = 8
_MOST_TICKS = 4
_MOST_HOURS = 48


@dataclass(frozen=True)
class Bar:
    """A step of the chart.

    Attributes:
        at: its start.
        parts: in it.
        x, y, width, height: of the bar.
        labelled: whether there is room for its time.
    """

    at: datetime
    parts: int
    x: float
    y: float
    width: float
    height: float
    labelled: bool


@dataclass(frozen=True)
class Line:
    """A share over time.

    Attributes:
        name: what it is, and its class.
        path: as SVG has it; empty where there are no parts at all.
        latest: share of the last step with parts, for its legend.
    """

    name: str
    path: str
    latest: float


@dataclass(frozen=True)
class Chart:
    """Bars or lines over the same steps.

    Attributes:
        title: what it shows.
        unit: of the ticks, after the figure.
        bars: a step each; their heights are 0 where lines are drawn.
        lines: if there are any.
        ticks: (value, y) of the lines across.
        width, height: of the field.
    """

    title: str
    unit: str
    bars: tuple[Bar, ...]
    ticks: tuple[tuple[int, float], ...]
    lines: tuple[Line, ...] = ()
    width: float = WIDTH
    height: float = HEIGHT


def charts_of(trend: Sequence[TrendStep], *, each: str) -> tuple[Chart, ...]:
    """Parts, those accepted, and those that were trouble; none where there are fewer than two steps to compare.

    Args:
        trend: hours or days, in order.
        each: hour or day.
    """
    if len(trend) < 2:
        return ()
    bars, ticks = _bars(trend)
    shares: dict[str, Callable[[TrendStep], int]] = {
        "accepted": lambda step: step.accepted,
        "to a person": lambda step: step.review,
        "rejected": lambda step: step.rejects,
    }
    per_cent = {
        name: [None if not step.parts else 100.0 * of(step) / step.parts for step in trend]
        for name, of in shares.items()
    }
    return (
        Chart(f"Parts per {each}", "", bars, ticks),
        _shares(f"Accepted per {each}", trend, {"accepted": per_cent.pop("accepted")}, most=100.0),
        _shares(f"To a person, and rejected, per {each}", trend, per_cent),
    )


def _bars(trend: Sequence[TrendStep]) -> tuple[tuple[Bar, ...], tuple[tuple[int, float], ...]]:
    top, ticks = _scale(max(step.parts for step in trend))
    pitch = WIDTH / len(trend)
    every = -(-len(trend) // _MOST_LABELS)
    if len(trend) > _MOST_HOURS:  # labelled by their dates, each once
        every = 24 * math.ceil(every / 24)
    bars = []
    for k, step in enumerate(trend):
        height = HEIGHT * step.parts / top
        bars.append(
            Bar(
                step.at,
                step.parts,
                x=round((k + 0.1) * pitch, 2),
                y=round(HEIGHT - height, 2),
                width=round(0.8 * pitch, 2),
                height=round(height, 2),
                labelled=k % every == 0,
            )
        )
    return tuple(bars), ticks


def _shares(
    title: str, trend: Sequence[TrendStep], per_cent: dict[str, list[float | None]], *, most: float = 0.0
) -> Chart:
    known = [v for values in per_cent.values() for v in values if v is not None]
    top, ticks = _scale(max([most, *known, 1.0]))
    lines = tuple(
        Line(name, _path(values, top), next((v for v in reversed(values) if v is not None), 0.0))
        for name, values in per_cent.items()
    )
    bars, _ = _bars([TrendStep(step.at) for step in trend])
    return Chart(title, " %", bars, ticks, lines)


def _path(values: Sequence[float | None], top: float) -> str:
    """A line through the middles of the steps; a step alone is a dot, which round ends of a line of no length make."""
    pitch, path, drawing = WIDTH / len(values), [], False
    for k, value in enumerate(values):
        if value is not None:
            path.append(
                f"{'L' if drawing else 'M'}{(k + 0.5) * pitch:.1f} {HEIGHT * (1.0 - value / top):.1f}"
            )
            path += [] if drawing else ["h0"]
        drawing = value is not None
    return "".join(path)


def _scale(most: float) -> tuple[int, tuple[tuple[int, float], ...]]:
    """The value at the top, and (value, y) of the lines across."""
    step = _tick_step(most)
    top = step * max(1, math.ceil(most / step))
    return top, tuple((n, round(HEIGHT * (1.0 - n / top), 2)) for n in range(0, top + 1, step))


def _tick_step(most: float) -> int:
    """1, 2 or 5 times a power of ten, so that there are few lines."""
    power = 1
    while True:
        for factor in (1, 2, 5):
            if most <= _MOST_TICKS * factor * power:
                return factor * power
        power *= 10
