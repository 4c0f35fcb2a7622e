"""Pages of audits: accepted parts, drawn at random, read by a person who does not see what was accepted.

/audit -> part --Enter--> part ... -> the queue
"""

from __future__ import annotations

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, ReviewAction, Scope
from pipeline.service.pages.blind import blind_page
from pipeline.service.pages.frame import A_YEAR_S, WHO_COOKIE, Frame, PageError, see
from pipeline.service.pages.people import person_at, taken_by_another
from pipeline.service.pages.said import MOST, Said
from pipeline.store.errors import ClaimedError, ConflictError

_WHY = "An audit: this part was accepted, and drawn at random. Say what you read; what was accepted is not shown."


def add_audit_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of audits."""

    @router.get("/audit")
    @router.get("/audit/next")
    def next_part(request: Request, after: str = "") -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        found = frame.store.next_in_queue(after or None, person=person_at(request, caller), audits=True)
        return see(request, "/review" if found is None else f"/audit/{found.id}")

    @router.get("/audit/{part_id}")
    def audit(request: Request, part_id: str, done: str = "") -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        person = person_at(request, caller)
        part = _waiting(frame, part_id)
        return _page(
            frame,
            request,
            part,
            person,
            taken=taken_by_another(frame, part_id, person),
            remark=audited_words(frame, done),
        )

    @router.post("/audit/{part_id}")
    def say(
        request: Request,
        part_id: str,
        action: Annotated[str, Form()] = "save",
        text: Annotated[str, Form()] = "",
        who: Annotated[str, Form()] = "",
        note: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        part = _waiting(frame, part_id)
        said = Said.of(text, caller.token or who, note)
        person = person_at(request, caller, said.who)
        if fault := said.fault(action):
            return _page(frame, request, part, person, said=said, fault=fault, status=422)
        asked = ReviewAction.UNREADABLE if action == "unreadable" else ReviewAction.CORRECT
        try:
            frame.store.review(
                part_id,
                action=asked,
                text=said.text,
                who=person.name,
                token=person.token,
                seat=person.seat,
                note=said.note,
                audit=True,
            )
        except ClaimedError as error:
            return _page(frame, request, part, person, said=said, fault=f"{error.what}.", status=409)
        except ConflictError as error:
            raise PageError(409, str(error)) from error
        found = frame.store.next_in_queue(part_id, person=person, audits=True)
        answer = see(request, f"/audit/{found.id}?done={part_id}" if found else f"/review?audited={part_id}")
        frame.set_cookie(request, answer, WHO_COOKIE, quote(said.who), max_age_s=A_YEAR_S)
        return answer


def audited_words(frame: Frame, part_id: str) -> str:
    """What came of the audit just done; empty where the address names none."""
    found = frame.store.audit(part_id) if part_id else None
    if found is None:
        return ""
    if found.action is ReviewAction.UNREADABLE:
        return "Noted as unreadable; the part stays accepted, and is not counted."
    part = frame.store.part(part_id)
    if found.after == found.before:
        return f"{found.after} is what was accepted."
    return f"{found.after} is not what was accepted, so the part {part.name} went to review.".replace(
        "  ", " "
    )


def _waiting(frame: Frame, part_id: str) -> PartRecord:
    part = frame.store.part(part_id)
    if not frame.store.awaits_audit(part_id):
        raise PageError(409, "This part does not wait for an audit; somebody may have been quicker.")
    return part


def _page(
    frame: Frame,
    request: Request,
    part: PartRecord,
    person: Person,
    *,
    said: Said | None = None,
    fault: str = "",
    taken: str = "",
    remark: str = "",
    status: int = 200,
) -> Response:
    return blind_page(
        frame,
        request,
        part,
        caller=frame.access.caller(request, Scope.REVIEW),
        person=person,
        address=f"/audit/{part.id}",
        why=_WHY,
        most=MOST,
        typed="" if said is None else said.text,
        note="" if said is None else said.note,
        fault=fault,
        taken=taken,
        remark=remark,
        status=status,
    )
