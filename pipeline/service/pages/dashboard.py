"""The dashboard: how much was read, how often touch was needed, how often a person found the reading right."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.golden_record import GoldenMeasure, GoldenRecord
from pipeline.common.records import PartState, Statistics
from pipeline.common.shares import share
from pipeline.service.connections import Connection
from pipeline.service.pages.charts import charts_of
from pipeline.service.pages.frame import Frame, PageError
from pipeline.store.alerts import DRIFT
from pipeline.store.figures import DAY, HOUR

SPANS = {
    "hour": timedelta(hours=1),
    "day": timedelta(days=1),
    "week": timedelta(weeks=1),
    "month": timedelta(days=30),
}
_GOLDEN_SHOWN = 10
_SOURCES = ("vision", "tactile", "fused")
_AUDITED = timedelta(days=90)
"""Accepted parts that the estimate of those accepted wrong is of: few are audited, so no shorter span says much."""


def add_dashboard(
    router: APIRouter,
    frame: Frame,
    drift: Callable[[], str],
    golden: Callable[[], tuple[GoldenRecord, ...]],
    connections: Callable[[], tuple[Connection, ...]],
) -> None:
    """The route of the dashboard.

    Args:
        router: to add it to.
        frame: of all pages.
        drift: says how the latest parts differ from the certified ones; empty where they do not.
        golden: scans of the golden part, the newest first.
        connections: to others: targets of results, ports.
    """

    @router.get("/dashboard")
    def dashboard(request: Request, span: str = "day") -> Response:
        caller = frame.reader(request)
        if span not in SPANS:
            raise PageError(422, f"There is no span {span!r}; choose {', '.join(SPANS)}.")
        now, each = datetime.now(UTC), "day" if span == "month" else "hour"
        numbers = frame.store.statistics(now - SPANS[span], step=DAY if each == "day" else HOUR)
        return frame.page(
            request,
            "dashboard.html.j2",
            caller=caller,
            span=span,
            drift=drift(),
            alerts=[one for one in frame.store.alerts() if not one.name.startswith(DRIFT)],
            spans=tuple(SPANS),
            numbers=numbers,
            camera=share(min(numbers.by_camera, numbers.parts), numbers.parts),
            fallback=share(min(numbers.fell_back, numbers.parts), numbers.parts),
            rejects=share(min(numbers.rejects, numbers.parts), numbers.parts),
            right=share(numbers.right_before_review, numbers.reviewed),
            characters=share(numbers.characters_right, numbers.characters_reviewed),
            seconds=[(s, numbers.seconds[s]) for s in _SOURCES if s in numbers.seconds],
            states=_states(numbers),
            charts=charts_of(numbers.trend, each=each),
            golden=_golden(golden()),
            connections=connections(),
            audits=frame.store.audit_figures(now - _AUDITED),
        )


def _golden(scans: tuple[GoldenRecord, ...]) -> list[dict[str, Any]]:
    """The latest scans of the golden part, and the reference below them."""
    shown = list(scans[:_GOLDEN_SHOWN])
    reference = next((scan for scan in scans if scan.reference), None)
    if reference is not None and reference not in shown:
        shown.append(reference)
    return [
        {
            "at": scan.at,
            "reference": scan.reference,
            **{measure.value: scan.measures.get(measure) for measure in GoldenMeasure},
        }
        for scan in shown
    ]


def _states(numbers: Statistics) -> list[tuple[PartState, int]]:
    return [(state, numbers.by_state.get(state, 0)) for state in PartState]
