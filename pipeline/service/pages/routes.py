"""The operator's pages, made on the server; they work without internet, and all but /docs without script."""

from __future__ import annotations

from datetime import UTC, date, datetime, time, timedelta
from typing import Annotated, Any, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Form, Query
from pydantic import BaseModel, Field
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.records import PartState
from pipeline.service.pages.dashboard import add_dashboard
from pipeline.service.pages.frame import PARTS_SHOWN, Frame, View, page_of, redirect, set_cookie
from pipeline.service.pages.jobs import add_job_pages
from pipeline.service.pages.pictures import last_felt, picture_pair
from pipeline.service.pages.places import cells_of, expected_cells, places_of
from pipeline.service.pages.review import add_review_pages
from pipeline.service.touch_queue import RETRY_S
from pipeline.service.web.access import COOKIE
from pipeline.store.access import SIGNED_IN_S

Wanted = Annotated[str, Field(max_length=200)]
Day = Annotated[date, Field(lt=date(9999, 1, 1))] | Literal[""]


def pages_router(frame: Frame) -> APIRouter:
    """The routes of all pages of a service."""
    router = APIRouter(include_in_schema=False)
    for add in (
        add_review_pages,
        _add_part_pages,
        add_job_pages,
        add_dashboard,
        _add_login,
    ):
        add(router, frame)

    @router.get("/docs")
    def interface(request: Request) -> Response:
        return frame.render(request, "interface.html.j2", tokens=frame.service.access.required)

    @router.get("/static/{name}")
    async def static(request: Request, name: str) -> Response:
        answer = await frame.assets.get_response(name, request.scope)
        # asked for again each time, and sent where it has changed
        answer.headers["Cache-Control"] = "no-cache"
        return answer

    return router


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


def _add_part_pages(router: APIRouter, frame: Frame) -> None:
    looks, reviews, store = Depends(frame.reader_view), Depends(frame.reviewer_view), frame.store

    @router.post("/parts/{part_id}/touch")
    async def touch(part_id: str, view: View = reviews) -> Response:
        await frame.service.intake.touch(part_id)
        return view.redirect(f"/parts/{part_id}")

    @router.get("/parts")
    def parts(search: Annotated[Search, Query()], view: View = looks) -> Response:
        query = search.model_dump(mode="json", exclude={"before"}, exclude_defaults=True)
        sought: dict[str, Any] = {
            **{name: getattr(search, name).strip() for name in ("text", "name", "job", "line")},
            "state": search.state,
            "since": datetime.combine(search.first, time(), UTC) if search.first else None,
            "until": datetime.combine(search.last, time(), UTC) + timedelta(days=1) if search.last else None,
        }
        sought = {name: value for name, value in sought.items() if value}
        parts = store.parts(**sought, before=search.before or None, limit=PARTS_SHOWN + 1)
        return view.page(
            "parts.html.j2",
            search=search,
            searched=bool(query),
            table="/v1/parts.csv?" + urlencode(sought),
            states=tuple(PartState),
            **page_of(parts, "/parts", query, search.before),
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


def _add_login(router: APIRouter, frame: Frame) -> None:
    access = frame.access

    @router.get("/login")
    def login(request: Request, to: str = "/review") -> Response:
        if not access.needs_token(request):
            return redirect(request, own_address(to))
        return frame.render(request, "login.html.j2", to=own_address(to), fault="")

    @router.post("/login")
    def log_in(
        request: Request, secret: Annotated[str, Form()] = "", to: Annotated[str, Form()] = "/review"
    ) -> Response:
        value = frame.store.open_session(secret.strip())
        if value is None:
            fault = "This token is not known, has expired or was revoked. Type it again or ask for another."
            return frame.render(request, "login.html.j2", status=403, to=own_address(to), fault=fault)
        answer = redirect(request, own_address(to))
        set_cookie(request, answer, COOKIE, value, max_age_s=SIGNED_IN_S)
        return answer

    @router.post("/logout")
    def log_out(request: Request) -> Response:
        frame.store.close_session(request.cookies.get(COOKIE, ""))  # wherever else the cookie is
        answer = redirect(request, "/login")
        answer.delete_cookie(COOKIE, path="/")
        return answer


def own_address(to: str) -> str:
    """An address of this service to open, otherwise that of the queue: never another host."""
    on_this_host = to.startswith("/") and not to.startswith("//") and "\\" not in to and to.isprintable()
    return to if on_this_host else "/review"
