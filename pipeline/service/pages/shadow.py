"""Shadow mode: how the readings agree with the line's own reader, day by day, and where they do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from urllib.parse import urlencode

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.records import Agreement, AgreementDay, PartRecord
from pipeline.common.shares import Share, share
from pipeline.common.texts import same_text
from pipeline.service.pages.frame import Frame, PageError
from pipeline.service.pages.places import Cell, expected_cells

SPANS = {"week": timedelta(weeks=1), "month": timedelta(days=30), "year": timedelta(days=365)}
SHOWN = {"other": Agreement.OTHER, "nothing": Agreement.NOTHING}
PARTS_SHOWN = 50


@dataclass(frozen=True)
class Counts:
    """Parts of a stretch of time.

    Attributes:
        day: of a row of the table; None of all of them.
        parts: read.
        compared: with what the line's own reader has said.
        same, other, nothing: of these; nothing was read of the last.
        accepted: of the compared ones, those that would have been accepted.
        accepted_same: of these, those that say the same.
    """

    day: date | None
    parts: int
    compared: int
    same: int
    other: int
    nothing: int
    accepted: int
    accepted_same: int

    @property
    def agreement(self) -> Share:
        """Of the compared parts, those that say the same."""
        return share(self.same, self.compared)

    @property
    def acceptance(self) -> Share:
        """Of the compared parts, those that would have been accepted."""
        return share(self.accepted, self.compared)

    @property
    def accepted_agreement(self) -> Share:
        """Of those that would have been accepted, those that say the same."""
        return share(self.accepted_same, self.accepted)

    @property
    def accepted_other(self) -> int:
        """Parts that would have been accepted with another serial than the line's own reader has."""
        return self.accepted - self.accepted_same


def counts_of(days: Sequence[AgreementDay], day: date | None = None) -> Counts:
    """Days counted together."""

    def total(kind: Agreement) -> int:
        return sum(one.all_parts.get(kind, 0) for one in days)

    def accepted(kind: Agreement) -> int:
        return sum(one.accepted.get(kind, 0) for one in days)

    same, other, nothing = (total(kind) for kind in (Agreement.SAME, Agreement.OTHER, Agreement.NOTHING))
    compared = same + other + nothing
    return Counts(
        day,
        parts=compared + total(Agreement.ALONE),
        compared=compared,
        same=same,
        other=other,
        nothing=nothing,
        accepted=sum(accepted(kind) for kind in (Agreement.SAME, Agreement.OTHER, Agreement.NOTHING)),
        accepted_same=accepted(Agreement.SAME),
    )


def who_was_right(part: PartRecord) -> str:
    """What a person's review says of a disagreement; empty before one."""
    if part.review is None:
        return ""
    ours = part.reading is not None and same_text(part.reading.text, part.text)
    theirs = same_text(part.expected, part.text)
    if not part.text:
        return "unreadable"
    return "this reader" if ours and not theirs else "the line’s" if theirs and not ours else "neither"


def _said(part: PartRecord) -> tuple[Cell, ...]:
    """What the line's own reader has said, marked where something else was read here, whatever a person has said."""
    return expected_cells(replace(part, text=part.reading.text if part.reading is not None else ""))


def add_shadow_page(router: APIRouter, frame: Frame) -> None:
    """The route of the page.

    Args:
        router: to add it to.
        frame: of all pages.
    """

    @router.get("/shadow")
    def shadow(request: Request, span: str = "month", show: str = "other", before: str = "") -> Response:
        caller = frame.reader(request)
        if span not in SPANS:
            raise PageError(422, f"There is no span {span!r}; choose week, month or year.")
        if show not in SHOWN:
            raise PageError(422, f"There is no list {show!r}; choose other or nothing.")
        since = datetime.now(UTC) - SPANS[span]
        days = frame.store.agreement_by_day(since)
        found = frame.store.parts(agreement=SHOWN[show], before=before or None, limit=PARTS_SHOWN + 1)
        shown = found[:PARTS_SHOWN]
        asked = {"span": span, "show": show}
        older = {**asked, "before": shown[-1].id} if len(found) > PARTS_SHOWN else {}
        return frame.page(
            request,
            "shadow.html.j2",
            caller=caller,
            span=span,
            spans=tuple(SPANS),
            show=show,
            since=since,
            all=counts_of(days),
            days=[counts_of([one], one.day) for one in reversed(days)],
            parts=[(part, _said(part), who_was_right(part)) for part in shown],
            older=f"/shadow?{urlencode(older)}" if older else "",
            newest=f"/shadow?{urlencode(asked)}" if before else "",
        )
