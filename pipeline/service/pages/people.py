"""Who sits at a page, and which part that person is at."""

from __future__ import annotations

import hashlib
from typing import Annotated
from urllib.parse import unquote

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from pipeline.common.people_records import ClaimRecord, Person
from pipeline.common.records import Scope
from pipeline.service.pages.frame import FORM_COOKIE, WHO_COOKIE, Frame, see
from pipeline.service.web.access import Caller

MOST_WHO = 80


def person_at(request: Request, caller: Caller, typed: str | None = None) -> Person:
    """Who sits there: by the token, else by the name typed, now or before, and by the browser."""
    if caller.token:
        return Person(caller.token, token=caller.token)
    kept = request.cookies.get(FORM_COOKIE, "")
    # the form's value is a secret; what is kept of it is none
    seat = hashlib.sha256(kept.encode()).hexdigest()[:32] if kept else ""
    name = unquote(request.cookies.get(WHO_COOKIE, ""))[:MOST_WHO] if typed is None else typed
    return Person(name, seat=seat)


def taken_by_another(frame: Frame, part_id: str, person: Person) -> str:
    """Take a part for a person; who has it, in words, where another is at it."""
    return _words(frame.store.claim_part(part_id, person), person) if person.holder else ""


def _words(claim: ClaimRecord, person: Person) -> str:
    if claim.holder == person.holder:
        return ""
    return f"{claim.who or 'Somebody else'} is at this part now. Look at it if you like; take the next one to review."


def add_claims(router: APIRouter, frame: Frame) -> None:
    """The routes by which an open page keeps its part and lets it go, and by which another takes it over."""

    @router.post("/review/{part_id}/takeover")
    def take_over(
        request: Request,
        part_id: str,
        to: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        frame.store.claim_part(part_id, person_at(request, caller), take_over=True)
        return see(request, f"/audit/{part_id}" if to == "audit" else f"/review/{part_id}")

    @router.post("/review/{part_id}/claim")
    def claim(
        request: Request,
        part_id: str,
        who: Annotated[str, Form()] = "",
        release: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        name = " ".join(who.split())[:MOST_WHO]
        person = person_at(request, caller, name if name.isprintable() else "")
        if release:
            frame.store.release_part(part_id, person)
            return PlainTextResponse("")
        return PlainTextResponse(taken_by_another(frame, part_id, person))
