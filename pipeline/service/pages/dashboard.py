"""The dashboard: how much was read, how often touch was needed, how often a person found the reading right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.records import PartState, Statistics
from pipeline.service.pages.frame import Frame, PageError

SPANS = {"hour": timedelta(hours=1), "day": timedelta(days=1), "week": timedelta(weeks=1)}
CHART_WIDTH, CHART_HEIGHT = 1000.0, 150.0
_Z = 1.959963984540054  # of the normal distribution, 95 % of which lies within
_SOURCES = ("vision", "tactile", "fused")
_MOST_LABELS = 8
_MOST_TICKS = 4


@dataclass(frozen=True)
class ShareView:
    """k of n and its interval.

    Attributes:
        count, total: how many of how many.
        value, low, high: the share and Wilson's 95 % interval, 0 to 1.
    """

    count: int
    total: int
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Bar:
    """An hour of the chart.

    Attributes:
        at: its start.
        parts: in it.
        x, y, width, height: of the chart.
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
class Chart:
    """Parts per hour.

    Attributes:
        bars: an hour each.
        ticks: (parts, y) of the lines across.
        width, height: of the field with the bars.
    """

    bars: tuple[Bar, ...]
    ticks: tuple[tuple[int, float], ...]
    width: float = CHART_WIDTH
    height: float = CHART_HEIGHT


def wilson(count: int, total: int) -> ShareView:
    """A share with Wilson's 95 % interval; in closed form, for a page has no time to load a statistics library.

    Raises:
        ValueError: more than all, or fewer than none.
    """
    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total} is not a share")
    if total == 0:
        return ShareView(0, 0, 0.0, 0.0, 1.0)
    p, zz = count / total, _Z * _Z / total
    middle = (p + 0.5 * zz) / (1.0 + zz)
    half = _Z * math.sqrt(p * (1.0 - p) / total + 0.25 * zz / total) / (1.0 + zz)
    low = 0.0 if count == 0 else middle - half
    high = 1.0 if count == total else middle + half
    return ShareView(count, total, p, low, high)


def chart_of(per_hour: Sequence[tuple[datetime, int]]) -> Chart | None:
    """Bars of parts per hour; None where there are fewer than two hours to compare."""
    if len(per_hour) < 2:
        return None
    step = _tick_step(max(n for _, n in per_hour))
    most = step * max(1, -(-max(n for _, n in per_hour) // step))
    pitch = CHART_WIDTH / len(per_hour)
    every = -(-len(per_hour) // _MOST_LABELS)
    bars = []
    for k, (at, n) in enumerate(per_hour):
        height = CHART_HEIGHT * n / most
        bars.append(
            Bar(
                at,
                n,
                x=round((k + 0.1) * pitch, 2),
                y=round(CHART_HEIGHT - height, 2),
                width=round(0.8 * pitch, 2),
                height=round(height, 2),
                labelled=k % every == 0,
            )
        )
    ticks = tuple((n, round(CHART_HEIGHT * (1.0 - n / most), 2)) for n in range(0, most + 1, step))
    return Chart(tuple(bars), ticks)


def _tick_step(most: int) -> int:
    """1, 2 or 5 times a power of ten, so that there are few lines."""
    power = 1
    while True:
        for factor in (1, 2, 5):
            if most <= _MOST_TICKS * factor * power:
                return factor * power
        power *= 10


def add_dashboard(router: APIRouter, frame: Frame) -> None:
    """The route of the dashboard."""

    @router.get("/dashboard")
    def dashboard(request: Request, span: str = "day") -> Response:
        caller = frame.reader(request)
        if span not in SPANS:
            raise PageError(422, f"There is no span {span!r}; choose hour, day or week.")
        counts = frame.store.statistics(datetime.now(UTC) - SPANS[span])
        return frame.page(
            request,
            "dashboard.html.j2",
            caller=caller,
            span=span,
            spans=tuple(SPANS),
            counts=counts,
            camera=wilson(min(counts.by_camera, counts.parts), counts.parts),
            fallback=wilson(min(counts.fell_back, counts.parts), counts.parts),
            rejects=wilson(min(counts.rejects, counts.parts), counts.parts),
            right=wilson(counts.right_before_review, counts.reviewed),
            characters=wilson(counts.characters_right, counts.characters_reviewed),
            seconds=[(s, counts.seconds[s]) for s in _SOURCES if s in counts.seconds],
            states=_states(counts),
            chart=chart_of(counts.per_hour),
        )


def _states(counts: Statistics) -> list[tuple[PartState, int]]:
    return [(state, counts.by_state.get(state, 0)) for state in PartState]
