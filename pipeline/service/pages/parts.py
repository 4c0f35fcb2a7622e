"""Pages of all parts: the searchable list, and everything stored about one part."""

from __future__ import annotations

from datetime import UTC, date, datetime, time, timedelta
from typing import Annotated, Any, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query
from pydantic import BaseModel, Field
from starlette.responses import Response

from pipeline.common.records import PartState
from pipeline.service.pages.frame import PARTS_SHOWN, Frame, View, page_of
from pipeline.service.pages.pictures import last_felt, picture_pair
from pipeline.service.pages.places import cells_of, expected_cells, places_of
from pipeline.service.touch_queue import RETRY_S

Wanted = Annotated[str, Field(max_length=200)]
Day = Annotated[date, Field(lt=date(9999, 1, 1))] | Literal[""]


class Search(BaseModel):
    """Search terms of the list; days by UTC."""

    text: Wanted = ""
    name: Wanted = ""
    state: PartState | Literal[""] = ""
    job: Wanted = ""
    line: Wanted = ""
    first: Day = ""
    last: Day = ""
    before: str = ""


def add_part_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of the list and of one part."""
    looks, store = Depends(frame.reader_view), frame.store

    @router.get("/parts")
    def parts(search: Annotated[Search, Query()], view: View = looks) -> Response:
        asked = search.model_dump(mode="json", exclude={"before"}, exclude_defaults=True)
        sought: dict[str, Any] = {
            **{name: getattr(search, name).strip() for name in ("text", "name", "job", "line")},
            "state": search.state,
            "since": datetime.combine(search.first, time(), UTC) if search.first else None,
            "until": datetime.combine(search.last, time(), UTC) + timedelta(days=1) if search.last else None,
        }
        sought = {name: value for name, value in sought.items() if value}
        found = store.parts(**sought, before=search.before or None, limit=PARTS_SHOWN + 1)
        return view.page(
            "parts.html.j2",
            asked=search,
            searched=bool(asked),
            table="/v1/parts.csv?" + urlencode(sought),
            states=tuple(PartState),
            **page_of(found, "/parts", asked, search.before),
        )

    @router.get("/parts/{part_id}")
    def part(part_id: str, view: View = looks) -> Response:
        story = store.story(part_id)
        pictures = picture_pair(story, frame.service.evidence)
        places = [places_of(reading) for reading in story.readings]
        reviews = frame.service.intake.policy.shown(story, view.person)
        return view.page(
            "part.html.j2",
            part=story.part,
            readings=[(r, p, cells_of(r.text, p)) for r, p in zip(story.readings, places, strict=True)],
            pictures=pictures,
            felt=last_felt(story.readings),
            expected=expected_cells(story.part),
            reviews=reviews,
            hidden=len(story.reviews) - len(reviews),
            events=story.events,
            not_felt=next((e.data["why"] for e in reversed(story.events) if e.kind == "touch_failed"), ""),
            stage=frame.service.intake.stage.there,
            retry_s=RETRY_S,
            evidence=story.evidence,
        )
