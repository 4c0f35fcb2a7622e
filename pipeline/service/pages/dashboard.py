"""Pages of numbers: /dashboard, and /shadow, which compares the readings with those of the line's own reader."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime, timedelta
from typing import Literal

from fastapi import APIRouter, Depends
from starlette.responses import Response

from pipeline.common.line_decision import NO_READING
from pipeline.common.records import Agreement, AgreementDay, PartRecord, PartState, TrendStep
from pipeline.common.texts import same_text
from pipeline.service.pages.frame import PARTS_SHOWN, Frame, View, page_of
from pipeline.service.pages.places import Cell, expected_cells
from pipeline.store.alerts import DRIFT
from pipeline.store.lists import DAY, HOUR

Span = Literal["hour", "day", "week", "month", "year"]
SPANS = {
    "hour": timedelta(hours=1),
    "day": timedelta(days=1),
    "week": timedelta(weeks=1),
    "month": timedelta(days=30),
    "year": timedelta(days=365),
}
Shown = Literal["accepted", Agreement.OTHER, Agreement.NOTHING]
_COUNTS = [field.name for field in fields(AgreementDay) if field.name != "day"]
_GOLDEN_SHOWN = 10
_MOST_TICKS, _MOST_LABELS, _MOST_HOURS = 4, 8, 48
# accepted parts that the estimate of those accepted wrong is of: few are audited, so no shorter span says much
_AUDITED = timedelta(days=90)


def add_dashboard(router: APIRouter, frame: Frame) -> None:
    """The routes of both pages."""
    looks, service = Depends(frame.reader_view), frame.service

    @router.get("/dashboard")
    def dashboard(span: Span = "day", view: View = looks) -> Response:
        now, each = datetime.now(UTC), "day" if span in ("month", "year") else "hour"
        numbers = frame.store.statistics(now - SPANS[span], step=DAY if each == "day" else HOUR)
        return view.page(
            "dashboard.html.j2",
            span=span,
            spans=tuple(SPANS)[:4],
            drift=service.jobs.drift,
            alerts=[alert for alert in frame.store.alerts() if not alert.name.startswith(DRIFT)],
            numbers=numbers,
            states=tuple(PartState),
            charts=charts_of(numbers.trend, each=each),
            golden=service.golden.scans(limit=_GOLDEN_SHOWN),
            connections=service.ports.connections(),
            audits=frame.store.audit_figures(now - _AUDITED),
        )

    @router.get("/shadow")
    def shadow(
        span: Span = "month", show: Shown | None = None, before: str = "", view: View = looks
    ) -> Response:
        since = datetime.now(UTC) - SPANS[span]
        days = frame.store.agreement_by_day(since)
        total = {name: sum(getattr(day, name) for day in days) for name in _COUNTS}
        if show is None:
            show = "accepted" if total["accepted_other"] else Agreement.OTHER
        parts = frame.store.parts(
            agreement=Agreement.OTHER if show == "accepted" else show,
            would_be=PartState.ACCEPTED if show == "accepted" else None,
            before=before or None,
            limit=PARTS_SHOWN + 1,
        )
        page = page_of(parts, "/shadow", {"span": span, "show": show}, before)
        surest = sorted(page["parts"], key=lambda part: (part.reading or NO_READING).confidence, reverse=True)
        page["parts"] = [(part, _read_cells(part), _who_was_right(part)) for part in surest]
        return view.page(
            "shadow.html.j2",
            span=span,
            spans=tuple(SPANS)[2:],
            show=show,
            since=since,
            all=total,
            days=days[::-1],
            **page,
        )


@dataclass(frozen=True)
class Chart:
    """Bars or lines over the steps of a trend; the template draws them."""

    title: str
    tick: int  # distance of the lines across, in parts or per cent; `top` is a multiple of it
    top: int
    every: int  # number of steps from one label to the next
    bars: Sequence[int] = ()
    # values by name; None at a step without parts
    lines: Mapping[str, Sequence[float | None]] = field(default_factory=dict)


def charts_of(trend: Sequence[TrendStep], *, each: str) -> tuple[Chart, ...]:
    """Charts of parts, accepted ones and problems over hours or days; none with fewer than two steps."""
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


def _who_was_right(part: PartRecord) -> str:
    if part.review is None:
        return ""
    ours = part.reading is not None and same_text(part.reading.text, part.text)
    theirs = same_text(part.expected, part.text)
    if not part.text:
        return "unreadable"
    return "this reader" if ours and not theirs else "the line’s" if theirs and not ours else "neither"


def _read_cells(part: PartRecord) -> tuple[Cell, ...]:
    return expected_cells(replace(part, text=(part.reading or NO_READING).text))
