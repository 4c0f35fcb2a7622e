"""Pages of the person at the line: the queue, and one part to be confirmed or corrected.

queue -> part --Enter--> part --Enter--> part ... -> queue, empty
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated
from urllib.parse import quote, unquote

from fastapi import APIRouter, Form
from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.records import PartRecord, ReviewAction, Scope
from pipeline.service.pages.felt import felt_view
from pipeline.service.pages.frame import A_YEAR_S, WHO_COOKIE, Frame, see
from pipeline.service.pages.pictures import picture_pair
from pipeline.service.pages.places import cells_of, expected_cells, places_of
from pipeline.store.errors import ConflictError, StoreError

QUEUE_SHOWN = 50
MOST_TEXT, MOST_WHO, MOST_NOTE = 200, 80, 1000
_SIZES = (12, 20, 30, 40)


@dataclass(frozen=True)
class Said:
    """What a person has typed.

    Attributes:
        text: serial.
        who: name.
        note: anything else.
    """

    text: str
    who: str
    note: str

    def fault(self, action: str) -> str:
        """Why it cannot be taken, in words; empty if it can."""
        if action not in ("save", "unreadable"):
            return "Say what is to be done: confirm, or unreadable."
        if not self.who:
            return "Type your name first: it is kept with every review."
        if action == "save" and not self.text:
            return "Type the serial, or say that it cannot be read (Alt+U)."
        for name, value, most in (
            ("serial", self.text, MOST_TEXT), ("name", self.who, MOST_WHO), ("note", self.note, MOST_NOTE),
        ):  # fmt: skip
            if len(value) > most:
                return f"The {name} has {len(value)} characters; at most {most} are kept. Shorten it."
            if not value.isprintable():
                return f"The {name} holds characters that cannot be printed. Type it again."
        return ""


def add_review_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of queue and review."""

    @router.get("/")
    def home() -> Response:
        return see("/review")

    @router.get("/review")
    def queue(request: Request, done: str = "") -> Response:
        caller = frame.reader(request)
        parts = frame.store.queue(limit=QUEUE_SHOWN)
        return frame.page(request, "queue.html.j2", caller=caller, parts=parts, done=_done(frame, done))

    @router.get("/review/next")
    def next_part(request: Request, after: str = "") -> Response:
        frame.reader(request)
        found = frame.store.next_in_queue(after or None)
        if found is None:
            return see("/review")
        return see(f"/review/{found.id}" + ("?alone=1" if found.id == after else ""))

    @router.get("/review/{part_id}")
    def review(request: Request, part_id: str, done: str = "", alone: str = "") -> Response:
        remark = "No other part is waiting." if alone else ""
        return _review_page(frame, request, frame.store.part(part_id), done=_done(frame, done), remark=remark)

    @router.post("/review/{part_id}")
    def say(
        request: Request,
        part_id: str,
        action: Annotated[str, Form()] = "save",
        text: Annotated[str, Form()] = "",
        before: Annotated[str, Form()] = "",
        who: Annotated[str, Form()] = "",
        note: Annotated[str, Form()] = "",
        form_value: Annotated[str, Form()] = "",
    ) -> Response:
        caller = frame.access.caller(request, Scope.REVIEW)
        frame.check_form(request, form_value)
        part = frame.store.part(part_id)
        said = Said(text.strip(), " ".join(who.split()), " ".join(note.split()))
        if fault := said.fault(action):
            return _review_page(frame, request, part, said=said, fault=fault, status=422)
        asked = _action(action, said.text, before)
        try:
            frame.review(
                part_id,
                action=asked,
                text=said.text if asked is ReviewAction.CORRECT else "",
                who=said.who,
                token=caller.name if frame.access.required else "",
                note=said.note,
                before=before,
            )
        except ConflictError:
            now = frame.store.part(part_id)
            return _review_page(frame, request, now, said=said, fault=_quicker(now), status=409)
        found = frame.store.next_in_queue(part_id)
        answer = see(f"/review/{found.id}?done={part_id}" if found else f"/review?done={part_id}")
        frame.set_cookie(request, answer, WHO_COOKIE, quote(said.who), max_age_s=A_YEAR_S)
        return answer


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
    except StoreError:
        return None
    return part if part.review is not None else None


def _review_page(
    frame: Frame,
    request: Request,
    part: PartRecord,
    *,
    said: Said | None = None,
    done: PartRecord | None = None,
    remark: str = "",
    fault: str = "",
    status: int = 200,
) -> Response:
    caller = frame.reader(request)
    places = places_of(part.reading, low_margin=frame.low_margin)
    readings, evidence = frame.store.readings(part.id), frame.store.evidence(part.id)
    pictures = picture_pair(part, readings, evidence, frame.evidence, low_margin=frame.low_margin)
    text = part.text if said is None else said.text
    kept = unquote(request.cookies.get(WHO_COOKIE, ""))[:MOST_WHO]
    who = kept or (caller.name if frame.access.required else "")
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
        who=who if said is None else said.who,
        note="" if said is None else said.note,
        may_review=Scope.REVIEW in caller.scopes,
        most=(MOST_TEXT, MOST_WHO, MOST_NOTE),
        done=done,
        remark=remark,
        fault=fault,
    )
