"""Shadow mode: how the readings agree with the line's own reader, day by day, and where they do not."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from typing import Literal

from fastapi import APIRouter, Depends
from starlette.responses import Response

from pipeline.common.records import Agreement, AgreementDay, PartRecord
from pipeline.common.texts import same_text
from pipeline.service.pages.frame import PARTS_SHOWN, Frame, View, page_of
from pipeline.service.pages.places import Cell, expected_cells

Span = Literal["week", "month", "year"]
SPANS = {"week": timedelta(weeks=1), "month": timedelta(days=30), "year": timedelta(days=365)}
Shown = Literal[Agreement.OTHER, Agreement.NOTHING]
_COUNTS = [field.name for field in fields(AgreementDay) if field.name != "day"]


def add_shadow_page(router: APIRouter, frame: Frame) -> None:
    """The route of the page."""
    looks = Depends(frame.reader_view)

    @router.get("/shadow")
    def shadow(
        span: Span = "month", show: Shown = Agreement.OTHER, before: str = "", view: View = looks
    ) -> Response:
        since = datetime.now(UTC) - SPANS[span]
        days = frame.store.agreement_by_day(since)
        found = frame.store.parts(agreement=show, before=before or None, limit=PARTS_SHOWN + 1)
        total = {name: sum(getattr(one, name) for one in days) for name in _COUNTS}
        page = page_of(found, "/shadow", {"span": span, "show": show}, before)
        return view.page(
            "shadow.html.j2",
            span=span,
            spans=tuple(SPANS),
            show=show,
            since=since,
            all=total,
            days=days[::-1],
            **{**page, "parts": [(part, _said(part), who_was_right(part)) for part in page["parts"]]},
        )


def who_was_right(part: PartRecord) -> str:
    """Name of the reader that was right, by a person's review; empty before one."""
    if part.review is None:
        return ""
    ours = part.reading is not None and same_text(part.reading.text, part.text)
    theirs = same_text(part.expected, part.text)
    if not part.text:
        return "unreadable"
    return "this reader" if ours and not theirs else "the line’s" if theirs and not ours else "neither"


def _said(part: PartRecord) -> tuple[Cell, ...]:
    """The serial of the line's own reader, marked where something else was read here."""
    return expected_cells(replace(part, text=part.reading.text if part.reading is not None else ""))
