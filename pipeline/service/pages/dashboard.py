"""The dashboard: how much was read, how often touch was needed, how often a person found the reading right."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Literal

from fastapi import APIRouter, Depends
from starlette.responses import Response

from pipeline.common.records import PartState
from pipeline.service.pages.charts import charts_of
from pipeline.service.pages.frame import Frame, View
from pipeline.store.alerts import DRIFT
from pipeline.store.figures import DAY, HOUR

Span = Literal["hour", "day", "week", "month"]
SPANS = {
    "hour": timedelta(hours=1),
    "day": timedelta(days=1),
    "week": timedelta(weeks=1),
    "month": timedelta(days=30),
}
_GOLDEN_SHOWN = 10
# accepted parts that the estimate of those accepted wrong is of: few are audited, so no shorter span says much
_AUDITED = timedelta(days=90)


def add_dashboard(router: APIRouter, frame: Frame) -> None:
    """The route of the dashboard."""
    looks, service = Depends(frame.reader_view), frame.service

    @router.get("/dashboard")
    def dashboard(span: Span = "day", view: View = looks) -> Response:
        now, each = datetime.now(UTC), "day" if span == "month" else "hour"
        numbers = frame.store.statistics(now - SPANS[span], step=DAY if each == "day" else HOUR)
        return view.page(
            "dashboard.html.j2",
            span=span,
            spans=tuple(SPANS),
            drift=service.jobs.drift,
            alerts=[one for one in frame.store.alerts() if not one.name.startswith(DRIFT)],
            numbers=numbers,
            states=tuple(PartState),
            charts=charts_of(numbers.trend, each=each),
            golden=service.golden.scans(limit=_GOLDEN_SHOWN),
            connections=service.ports.connections(),
            audits=frame.store.audit_figures(now - _AUDITED),
        )
