"""Pages of the person at the line: the queue, and one part to confirm, correct, or read blind (no reading is shown)."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Form
from pydantic import AwareDatetime, BaseModel
from starlette.responses import JSONResponse, PlainTextResponse, Response

from glyphs.plain_text import has_hidden
from pipeline.common.names import printable_name
from pipeline.common.people_records import ClaimRecord, Person
from pipeline.common.records import PartRecord, PartState, ReviewAction
from pipeline.service.pages.frame import MOST_WHO, Frame, View
from pipeline.service.pages.pictures import last_felt, picture_pair, without_reading
from pipeline.service.pages.places import cells_of, expected_cells, places_of
from pipeline.service.settings import ReviewMode
from pipeline.service.web.problem import Problem
from pipeline.store.errors import ClaimedError, ConflictError, StoreError

QUEUE_SHOWN = 50
# most characters of typed texts
MOST = {"text": 200, "who": MOST_WHO, "note": 1000}
_NAMES = {"text": "serial", "who": "name", "note": "note"}


class ReviewForm(BaseModel):
    """Text that a person has typed for a part; `mode` is the mode of the page."""

    action: str = "save"
    text: str = ""
    who: str = ""
    note: str = ""
    before: str = ""
    outside: str = ""
    mode: ReviewMode = ReviewMode.OPEN

    def clean(self, token: str) -> ReviewForm:
        who, note = (" ".join(value.split()) for value in (token or self.who, self.note))
        return self.model_copy(update={"text": self.text.strip(), "who": who, "note": note})

    def fault(self) -> str:
        if self.action not in ("save", "unreadable"):
            return "Choose what to do: confirm, or unreadable."
        if not self.who:
            return "Type your name first: it is kept with every review."
        if self.action == "save" and not self.text:
            return "Type the serial, or choose Unreadable (Alt+U)."
        for name, most in MOST.items():
            value = getattr(self, name)
            if len(value) > most:
                return f"The {_NAMES[name]} has {len(value)} characters; at most {most} are kept. Shorten it."
            if has_hidden(value):
                return f"The {_NAMES[name]} holds characters that cannot be printed. Type it again."
        return ""


def add_review_pages(router: APIRouter, frame: Frame) -> None:
    """The routes of queue, review and audit."""
    looks, reviews = Depends(frame.reader_view), Depends(frame.reviewer_view)
    store = frame.store

    @router.get("/")
    def home(view: View = looks) -> Response:
        return view.redirect("/review")

    @router.get("/review")
    def queue(done: str = "", view: View = looks) -> Response:
        person = view.person
        return view.page(
            "queue.html.j2",
            parts=store.queue(limit=QUEUE_SHOWN),
            others={part: c.who for part, c in store.claims().items() if c.holder != person.holder},
            halves=store.half_reviewed() if frame.service.intake.policy.readers > 1 else {},
            free=store.next_in_queue(person=person) is not None,
            audits=store.queue_length(audits=True),
            **_outcome(frame, done),
        )

    @router.get("/review/next")
    def next_part(after: str = "", view: View = looks) -> Response:
        return _redirect_to(view, store.next_in_queue(after or None, person=view.person), after)

    @router.get("/audit")
    def next_audit(after: str = "", view: View = reviews) -> Response:
        return _redirect_to(view, store.next_in_queue(after or None, person=view.person, audits=True), after)

    @router.get("/review/{part_id}")
    def review(part_id: str, done: str = "", undone: str = "", view: View = looks) -> Response:
        remark = "Your review is undone: the part waits for review again." if undone else ""
        return _page(view, part_id, done=done, remark=remark)

    @router.post("/review/{part_id}")
    def submit_review(part_id: str, form: Annotated[ReviewForm, Form()], view: View = reviews) -> Response:
        part, form = store.part(part_id), form.clean(view.caller.token)
        fault = form.fault()
        if not fault and form.action == "save" and form.mode is not ReviewMode.AUDIT:
            against = frame.service.intake.calls.outside_format(form.text, part.job)
            if against and form.text != form.outside:
                todo = "correct it, or save it again if the part reads so"
                fault = f"{form.text}: {against}. Nothing is saved yet: {todo}."
                form = form.model_copy(update={"outside": form.text})
        if fault:
            return _page(view, part_id, form=form, problem=Problem(422, fault))
        try:
            following = _keep(view, part, form)
        except ClaimedError as error:
            fault = f"{error.what}. Your input is not saved; take the next part, or wait."
            return _page(view, part_id, form=form, problem=Problem(409, fault))
        except ConflictError:
            fault = _describe_change(store.part(part_id))
            return _page(view, part_id, form=form, problem=Problem(409, fault))
        return view.redirect(
            f"/review/{following.id}?done={part_id}" if following else f"/review?done={part_id}", who=form.who
        )

    @router.post("/review/{part_id}/undo")
    def undo(part_id: str, view: View = reviews) -> Response:
        frame.service.intake.undo_review(part_id, view.person)
        return view.redirect(f"/review/{part_id}?undone=1")

    @router.post("/review/{part_id}/takeover")
    def take_over(part_id: str, view: View = reviews) -> Response:
        store.claim_part(part_id, view.person, take_over=True)
        return view.redirect(f"/review/{part_id}")

    @router.post("/review/{part_id}/claim")
    def claim(
        part_id: str,
        who: Annotated[str, Form()] = "",
        release: Annotated[AwareDatetime | None, Form()] = None,
        view: View = reviews,
    ) -> Response:
        if release is not None:
            store.release_part(part_id, view.person, until=release)
            return PlainTextResponse("")
        claim = _claim(view, part_id, view.named(printable_name(who)[:MOST_WHO]))
        return JSONResponse({"taken": _taken(claim, view.person), "until": _until(claim)})


def _redirect_to(view: View, part: PartRecord | None, after: str) -> Response:
    return view.redirect("/review" if part is None or part.id == after else f"/review/{part.id}")


def _keep(view: View, part: PartRecord, form: ReviewForm) -> PartRecord | None:
    person, audit = view.named(form.who), form.mode is ReviewMode.AUDIT
    text = "" if form.action == "unreadable" else form.text
    before = form.before if form.mode is ReviewMode.OPEN else None
    stands = text == (part.text if before is None else before.strip())
    action = ReviewAction.UNREADABLE if not text else ReviewAction.CONFIRM if stands else ReviewAction.CORRECT
    text = text if action is ReviewAction.CORRECT else ""
    answer = {"action": action, "text": text, "note": form.note, "before": before, "audit": audit}
    view.frame.service.intake.review(part.id, person, **answer)
    return view.frame.store.next_in_queue(part.id, person=person, audits=audit)


def _claim(view: View, part_id: str, person: Person) -> ClaimRecord | None:
    return view.frame.store.claim_part(part_id, person) if person.holder else None


def _taken(claim: ClaimRecord | None, person: Person) -> str:
    if claim is None or claim.holder == person.holder:
        return ""
    return f"{claim.who or 'Somebody else'} is at this part now. Look at it if you like; take the next one to review."


def _until(claim: ClaimRecord | None) -> str:
    return "" if claim is None else claim.until.isoformat()


def _describe_change(part: PartRecord) -> str:
    stands = f"the serial is now {part.text}" if part.text else "the part now has no serial"
    quicker = "The part was read again meanwhile" if part.review is None else f"{part.review.who} was quicker"
    return f"{quicker}: {stands}. Your input is not saved; compare it with what you typed, and decide again."


def _outcome(frame: Frame, part_id: str) -> dict[str, Any]:
    with contextlib.suppress(StoreError):
        story = frame.store.story(part_id)
        reviewed = story.part.review is not None or bool(story.opinions)
        done = story.part if reviewed or story.audit else None
        return {"done": done, "audited": None if reviewed else story.audit}
    return {"done": None, "audited": None}


def _page(
    view: View,
    part_id: str,
    *,
    form: ReviewForm | None = None,
    done: str = "",
    remark: str = "",
    problem: Problem | None = None,
) -> Response:
    frame, person, story = view.frame, view.person, view.frame.store.story(part_id)
    part, readings = story.part, story.readings
    mode = frame.service.intake.policy.mode(story, person)
    waits = view.may_review and (part.state is PartState.REVIEW or mode is ReviewMode.AUDIT)
    pictures = picture_pair(story, frame.service.evidence)
    # marks without small letters are typed in capitals
    upper = not any(c.char.islower() for r in readings for place in r.characters for c in place.candidates)
    if mode is not ReviewMode.OPEN:  # nothing that was read reaches the template
        part = replace(part, text="", reading=None, review=None, expected="", plan=None)
        readings, pictures = (), (without_reading(pictures[0]), without_reading(pictures[1]))
    places = places_of(part.reading)
    claim = _claim(view, part.id, person) if waits and form is None else None
    form = form or ReviewForm(text=part.text, who=person.name)
    return view.page(
        "review.html.j2",
        problem=problem,
        part=part,
        mode=mode.value,
        audit=story.audit,
        waits=waits,
        form=form,
        places=places,
        cells=cells_of(form.text, places),
        pictures=pictures,
        felt=last_felt(readings),
        expected=expected_cells(part),
        upper=upper,
        signed=bool(person.token),
        most=MOST,
        remark=remark,
        taken=_taken(claim, person),
        claimed_until=_until(claim),
        **_outcome(frame, done),
    )
