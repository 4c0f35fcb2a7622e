"""Pages of all parts: the list to search in, and everything kept of one."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from urllib.parse import urlencode

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.records import EvidenceKind, PartState, Scope
from pipeline.service.pages.felt import felt_view
from pipeline.service.pages.frame import Frame, PageError
from pipeline.service.pages.pictures import picture_pair
from pipeline.service.pages.places import cells_of, expected_cells, places_of

PARTS_SHOWN = 50
_MOST_SEARCHED = 200
KIND_NAMES = {
    EvidenceKind.PHOTO: "photograph as sent",
    EvidenceKind.SCAN: "scan",
    EvidenceKind.HEIGHT_MAP: "height map",
    EvidenceKind.VISION: "what the camera’s reader believed",
    EvidenceKind.PHOTO_PICTURE: "photograph for this page",
    EvidenceKind.EDGES_PICTURE: "tactile edge map",
    EvidenceKind.VISION_EDGES_PICTURE: "camera’s edge map",
}


def add_part_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of the list and of one part."""

    @router.get("/parts")
    def parts(
        request: Request,
        text: str = "",
        name: str = "",
        state: str = "",
        job: str = "",
        line: str = "",
        first: str = "",
        last: str = "",
        before: str = "",
    ) -> Response:
        caller = frame.reader(request)
        if state and state not in set(PartState):
            raise PageError(422, f"There is no state {state!r}; choose one of the list.")
        since, until = _day(first), _day(last, after=1)
        if max(len(text), len(name), len(job), len(line)) > _MOST_SEARCHED:
            raise PageError(422, f"Search for at most {_MOST_SEARCHED} characters.")
        found = frame.store.parts(
            state=PartState(state) if state else None,
            text=text.strip(),
            name=name.strip(),
            job=job.strip(),
            line=line.strip(),
            since=since,
            until=until,
            before=before or None,
            limit=PARTS_SHOWN + 1,
        )
        shown = found[:PARTS_SHOWN]
        sought = {"text": text, "name": name, "state": state, "job": job, "line": line}
        asked = {**sought, "first": first, "last": last}
        days = {"since": since and f"{since:%Y-%m-%d}", "until": until and f"{until:%Y-%m-%d}"}
        table = {name: value.strip() for name, value in sought.items()} | days
        older = {**asked, "before": shown[-1].id} if len(found) > PARTS_SHOWN else {}
        return frame.page(
            request,
            "parts.html.j2",
            caller=caller,
            parts=shown,
            asked=asked,
            searched=any(asked.values()),
            older=_query(older),
            newest=_query(asked) if before else "",
            table="/v1/parts.csv?" + urlencode({name: value for name, value in table.items() if value}),
            states=tuple(PartState),
        )

    @router.get("/parts/{part_id}")
    def part(request: Request, part_id: str) -> Response:
        caller = frame.reader(request)
        found = frame.store.part(part_id)
        readings, evidence = frame.store.readings(part_id), frame.store.evidence(part_id)
        pictures = picture_pair(found, readings, evidence, frame.evidence, low_margin=frame.low_margin)
        places = [places_of(r, low_margin=frame.low_margin) for r in readings]
        return frame.page(
            request,
            "part.html.j2",
            caller=caller,
            part=found,
            readings=[(r, p, cells_of(r.text, p)) for r, p in zip(readings, places, strict=True)],
            pictures=pictures,
            felt=felt_view(readings, pictures[::-1]),
            expected=expected_cells(found),
            reviews=frame.store.reviews(part_id),
            events=frame.store.history(part_id),
            evidence=evidence,
            kind_names=KIND_NAMES,
            may_review=Scope.REVIEW in caller.scopes,
        )


def _day(written: str, *, after: int = 0) -> datetime | None:
    """The beginning of a day by UTC, or of one after it; None where none is given.

    Raises:
        PageError: no day.
    """
    if not written:
        return None
    try:
        day = date.fromisoformat(written) + timedelta(days=after)
    except (ValueError, OverflowError) as error:
        raise PageError(422, f"{written[:40]!r} is no day; write 2026-11-21.") from error
    return datetime(day.year, day.month, day.day, tzinfo=UTC)


def _query(values: dict[str, str]) -> str:
    """Address of the list with these values; empty without any."""
    given = {name: value for name, value in values.items() if value}
    return f"/parts?{urlencode(given)}" if given else "/parts" if values else ""
