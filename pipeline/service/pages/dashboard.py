"""The dashboard: how much was read, how often touch was needed, how often a person found the reading right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.records import PartState, Statistics
from pipeline.common.shares import share
from pipeline.service.pages.frame import Frame, PageError

SPANS = {"hour": timedelta(hours=1), "day": timedelta(days=1), "week": timedelta(weeks=1)}
CHART_WIDTH, CHART_HEIGHT = 1000.0, 150.0
_SOURCES = ("vision", "tactile", "fused")
_MOST_LABELS = 8
_MOST_TICKS = 4


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


def add_dashboard(router: APIRouter, frame: Frame, drift: Callable[[], str]) -> None:
    """The route of the dashboard.

    Args:
        router: to add it to.
        frame: of all pages.
        drift: says how the latest parts differ from the certified ones; empty where they do not.
    """

    @router.get("/dashboard")
    def dashboard(request: Request, span: str = "day") -> Response:
        caller = frame.reader(request)
        if span not in SPANS:
            raise PageError(422, f"There is no span {span!r}; choose hour, day or week.")
        numbers = frame.store.statistics(datetime.now(UTC) - SPANS[span])
        return frame.page(
            request,
            "dashboard.html.j2",
            caller=caller,
            span=span,
            drift=drift(),
            spans=tuple(SPANS),
            numbers=numbers,
            camera=share(min(numbers.by_camera, numbers.parts), numbers.parts),
            fallback=share(min(numbers.fell_back, numbers.parts), numbers.parts),
            rejects=share(min(numbers.rejects, numbers.parts), numbers.parts),
            right=share(numbers.right_before_review, numbers.reviewed),
            characters=share(numbers.characters_right, numbers.characters_reviewed),
            seconds=[(s, numbers.seconds[s]) for s in _SOURCES if s in numbers.seconds],
            states=_states(numbers),
            chart=chart_of(numbers.per_hour),
        )


def _states(numbers: Statistics) -> list[tuple[PartState, int]]:
    return [(state, numbers.by_state.get(state, 0)) for state in PartState]
