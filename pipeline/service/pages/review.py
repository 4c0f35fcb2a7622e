"""Pages of the person at the line: the queue, and one part to be confirmed or corrected.

queue -> part --Enter--> part --Enter--> part ... -> queue, empty
"""

from __future__ import annotations

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState, ReviewAction, Scope
from pipeline.service.pages.audit import audited_words
from pipeline.service.pages.blind import blind_page
from pipeline.service.pages.felt import felt_view
from pipeline.service.pages.frame import A_YEAR_S, MOST_COUNTED, WHO_COOKIE, Frame, PageError, see
from pipeline.service.pages.people import person_at, taken_by_another
from pipeline.service.pages.pictures import picture_pair
from pipeline.service.pages.places import cells_of, expected_cells, places_of
from pipeline.service.pages.said import MOST, Said
from pipeline.store.errors import ClaimedError, ConflictError, StoreError

QUEUE_SHOWN = 50
_WHY_BLIND = (
    "Somebody has read this part. Say what you read; it is reviewed when two people have read the same."
)
_SIZES = (12, 20, 30, 40)


def add_review_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of queue and review."""

    @router.get("/")
    def home(request: Request) -> Response:
        return see(request, "/review")

    @router.get("/review")
    def queue(request: Request, done: str = "", audited: str = "") -> Response:
        caller = frame.reader(request)
        person = person_at(request, caller)
        parts, held = frame.store.queue(limit=QUEUE_SHOWN), frame.store.claimed()
        audits = len(frame.store.queue(audits=True, limit=MOST_COUNTED + 1))
        return frame.page(
            request,
            "queue.html.j2",
            caller=caller,
            parts=parts,
            others={part: claim.who for part, claim in held.items() if claim.holder != person.holder},
            halves=frame.store.half_reviewed() if frame.second_reader else {},
            free=frame.store.next_in_queue(person=person) is not None,
            audits=f"{MOST_COUNTED}+" if audits > MOST_COUNTED else str(audits) if audits else "",
            may_review=Scope.REVIEW in caller.scopes,
            done=_done(frame, done),
            remark=audited_words(frame, audited),
        )

    @router.get("/review/next")
    def next_part(request: Request, after: str = "") -> Response:
        person = person_at(request, frame.reader(request))
        found = frame.store.next_in_queue(after or None, person=person)
        if found is None:
            return see(request, "/review")
        return see(request, f"/review/{found.id}" + ("?alone=1" if found.id == after else ""))

    @router.get("/review/{part_id}")
    def review(request: Request, part_id: str, done: str = "", alone: str = "", undone: str = "") -> Response:
        remark = "No other part is waiting." if alone else ""
        remark = "Your review is undone: the part waits for review again." if undone else remark
        part, person = frame.store.part(part_id), person_at(request, frame.reader(request))
        return _review_page(frame, request, part, person, done=_done(frame, done), remark=remark)

    @router.post("/review/{part_id}")
    def say(
        request: Request,
        part_id: str,
        action: Annotated[str, Form()] = "save",
        text: Annotated[str, Form()] = "",
        before: Annotated[str, Form()] = "",
        who: Annotated[str, Form()] = "",
        note: Annotated[str, Form()] = "",
        blind: Annotated[str, Form()] = "",
        outside: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        part = frame.store.part(part_id)
        said = Said.of(text, caller.token or who, note)
        person = person_at(request, caller, said.who)
        if fault := said.fault(action):
            return _review_page(frame, request, part, person, said=said, fault=fault, status=422)
        against = frame.outside_format(said.text, part.job) if action == "save" else ""
        if against and said.text != outside:
            fault = f"{said.text}: {against}. Nothing was saved yet: correct it, or save it again if the part bears it."
            return _review_page(
                frame, request, part, person, said=said, fault=fault, outside=said.text, status=422
            )
        stood = part.text if blind else before
        asked = _action(action, said.text, stood)
        try:
            frame.review(
                part_id,
                action=asked,
                text=said.text if asked is ReviewAction.CORRECT else "",
                who=person.name,
                token=person.token,
                seat=person.seat,
                note=said.note,
                before=stood,
            )
        except ClaimedError as error:
            fault = f"{error.what}. Nothing of yours was saved; take the next one, or wait."
            return _review_page(frame, request, part, person, said=said, fault=fault, status=409)
        except ConflictError:
            now = frame.store.part(part_id)
            return _review_page(frame, request, now, person, said=said, fault=_quicker(now), status=409)
        found = frame.store.next_in_queue(part_id, person=person)
        answer = see(request, f"/review/{found.id}?done={part_id}" if found else f"/review?done={part_id}")
        frame.set_cookie(request, answer, WHO_COOKIE, quote(said.who), max_age_s=A_YEAR_S)
        return answer

    @router.post("/review/{part_id}/undo")
    def undo(request: Request, part_id: str, form_value: Annotated[str, Form()] = "") -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        try:
            frame.undo(part_id, person_at(request, caller))
        except ConflictError as error:
            raise PageError(409, str(error)) from error
        return see(request, f"/review/{part_id}?undone=1")


def _action(action: str, text: str, before: str) -> ReviewAction:
    if action == "unreadable":
        return ReviewAction.UNREADABLE
    return ReviewAction.CONFIRM if text == before.strip() else ReviewAction.CORRECT


def _quicker(part: PartRecord) -> str:
    stands = f"the serial is now {part.text}" if part.text else "the part now has no serial"
    quicker = "The part was read again meanwhile" if part.review is None else f"{part.review.who} was quicker"
    return (
        f"{quicker}: {stands}. Nothing of yours was saved; compare it with what you typed, and decide again."
    )


def _done(frame: Frame, part_id: str) -> PartRecord | None:
    """The part just dealt with; None where the address names none."""
    if not part_id:
        return None
    try:
        part = frame.store.part(part_id)
        return part if part.review is not None or frame.store.opinions(part_id) else None
    except StoreError:
        return None


def _reads_blind(frame: Frame, part: PartRecord, person: Person) -> bool:
    """Whether others have read the part, and this person is to say what stands there without seeing it."""
    if not frame.second_reader or part.state is not PartState.REVIEW:
        return False
    said = frame.store.opinions(part.id)
    return bool(said) and not any(person.said(one) for one in said)


def _review_page(
    frame: Frame,
    request: Request,
    part: PartRecord,
    person: Person,
    *,
    said: Said | None = None,
    done: PartRecord | None = None,
    remark: str = "",
    fault: str = "",
    outside: str = "",
    status: int = 200,
) -> Response:
    caller = frame.reader(request)
    may_review = Scope.REVIEW in caller.scopes
    waits = may_review and part.state is PartState.REVIEW
    taken = taken_by_another(frame, part.id, person) if waits and said is None else ""
    if _reads_blind(frame, part, person):
        return blind_page(
            frame, request, part, caller=caller, person=person, address=f"/review/{part.id}", why=_WHY_BLIND,
            most=MOST, typed="" if said is None else said.text, note="" if said is None else said.note,
            fault=fault, taken=taken, outside=outside, remark=remark, status=status,
        )  # fmt: skip
    places = places_of(part.reading, low_margin=frame.low_margin)
    readings, evidence = frame.store.readings(part.id), frame.store.evidence(part.id)
    pictures = picture_pair(part, readings, evidence, frame.evidence, low_margin=frame.low_margin)
    text = part.text if said is None else said.text
    return frame.page(
        request,
        "review.html.j2",
        status=status,
        caller=caller,
        part=part,
        places=places,
        cells=cells_of(text, places),
        text=text,
        size=next((s for s in _SIZES if len(text) <= s), 0),
        pictures=pictures,
        felt=felt_view(readings, pictures[::-1]),
        expected=expected_cells(part),
        upper=not any(c.char.islower() for p in places for c in p.candidates),
        who=person.name if said is None else said.who,
        signed=bool(person.token),
        note="" if said is None else said.note,
        may_review=may_review,
        most=MOST,
        done=done,
        remark=remark or _why_again(frame, part),
        taken=taken,
        fault=fault,
        outside=outside,
    )


def _why_again(frame: Frame, part: PartRecord) -> str:
    """Why a part that was accepted waits for review."""
    audit = frame.store.audit(part.id) if part.state is PartState.REVIEW else None
    if audit is None or audit.after == audit.before:
        return ""
    return f"This part was accepted; {audit.who} read {audit.after} in an audit. Say which is right."
