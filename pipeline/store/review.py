"""Review of parts: claims, opinions, agreement of two readers, undo and audits of accepted parts.

review --opened, claimed--> said by one --said the same by `readers`--> reviewed --undone--> review
                                        \\-otherwise-------------------> review, for the next person
accepted --drawn--> waiting --read the same--> right
                            \\-otherwise------> disputed, in review: a review says whether it was accepted wrong
                            \\-unreadable-----> not judged

A claim keeps a part from others for `CLAIM_S`; an open page renews it. If two must agree, neither sees the other's
opinion. An audited part stays accepted until a review says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import TypeVar

import sqlalchemy as sa

from pipeline.common.people_records import AuditFigures, ClaimRecord, Person
from pipeline.common.reading_records import ReadingRecord, from_json, to_json
from pipeline.common.records import EventRecord, PartRecord, PartState, PartStory, ReviewAction, ReviewRecord
from pipeline.common.shares import share
from pipeline.store.database import AnyRow, Transaction
from pipeline.store.errors import MAX_NOTE, MAX_ROWS, MAX_TEXT, ClaimedError, ConflictError, UnfitError, fit
from pipeline.store.parts import AUDIT_WAITS
from pipeline.store.rows import (
    AUDITED,
    HALF_REVIEWED,
    READ,
    REVIEWED,
    events_of,
    evidence_of,
    part_by_id,
    signature,
    write_part,
)
from pipeline.store.tables import events, parts

CLAIM_S = 300.0
_NOT_CLAIMED = {"claim_holder": None, "claim_who": None, "claim_until": None}
# an event of these kinds keeps a whole record; the history shows these fields of it
_TOLD = {
    READ: ("source", "text", "decision", "confidence"),
    REVIEWED: ("action", "before", "after", "who"),
    HALF_REVIEWED: ("who",),  # not the text: the next person must not see it
    AUDITED: ("who", "before", "after", "note"),
}
T = TypeVar("T")
_RIGHT, _WRONG, _DISPUTED, _NOT_JUDGED = "right", "wrong", "disputed", "not judged"


# ---- claims


def claim_part(tx: Transaction, part_id: str, person: Person, *, take_over: bool = False) -> ClaimRecord:
    """Claim a part, or renew a claim; return the present claim, which may be another's unless it is taken over."""
    part_by_id(tx, part_id, lock=True)
    values = {
        "claim_holder": fit(person.holder, "the holder of a claim", limit=300),
        "claim_who": fit(person.name, "the person's name"),
        "claim_until": tx.now + timedelta(seconds=CLAIM_S),
    }
    may = sa.or_(_free(tx), parts.c.claim_holder == person.holder, sa.literal(take_over))
    tx.execute(sa.update(parts).where(parts.c.id == part_id, may).values(**values))
    return _claims(tx, parts.c.id == part_id)[part_id]


def release_part(tx: Transaction, part_id: str, person: Person, *, until: datetime) -> None:
    """Release the claim that lasts until a time; nothing happens if it is another's, or was renewed since."""
    claim = sa.and_(
        parts.c.id == part_id, parts.c.claim_holder == person.holder, parts.c.claim_until <= until
    )
    tx.execute(sa.update(parts).where(claim).values(**_NOT_CLAIMED))


def claims(tx: Transaction) -> Mapping[str, ClaimRecord]:
    """The present claims, by part."""
    return _claims(tx, ~_free(tx))


def claimed_by_another(tx: Transaction, person: Person) -> sa.ColumnElement[bool]:
    """Whether another person has claimed a part."""
    return sa.and_(~_free(tx), parts.c.claim_holder != person.holder)


def _free(tx: Transaction) -> sa.ColumnElement[bool]:
    """Whether a part is unclaimed; a claim that ends too far ahead is void, because the clock was set back."""
    until = parts.c.claim_until
    return sa.or_(until.is_(None), until <= tx.now, until > tx.now + timedelta(seconds=2.0 * CLAIM_S))


def _claims(tx: Transaction, which: sa.ColumnElement[bool]) -> dict[str, ClaimRecord]:
    query = sa.select(parts.c.id, parts.c.claim_holder, parts.c.claim_who, parts.c.claim_until).where(which)
    rows = tx.execute(query.order_by(parts.c.id).limit(MAX_ROWS))
    return {row[0]: ClaimRecord(*row) for row in rows}


# ---- reviews and audits


def review(
    tx: Transaction,
    part_id: str,
    *,
    person: Person,
    action: ReviewAction,
    text: str = "",  # the correct one; to confirm, the present one or an empty one
    note: str = "",
    before: str | None = None,  # text that the person saw
    targets: Sequence[str] = (),
    readers: int = 1,
    audit: bool = False,  # the accepted text was not shown; only if the texts differ, the part goes to review
) -> PartRecord:
    """Store a person's review of a part; a later review does not delete earlier ones.

    With two readers a part is reviewed when two people agree; until then it waits for review. Raises ConflictError: the
    text has changed since the person saw it, or no audit is due. ClaimedError: another person has claimed the part.
    """
    part = part_by_id(tx, part_id, lock=True)
    if audit and not _awaits_audit(tx, part_id):
        raise ConflictError(f"part {part_id} does not wait for an audit", hint="take the next one")
    _refuse_if_held(tx, part_id, person)
    if before is not None and before != part.text:
        quicker = part.review.who if part.review is not None else "a reader"
        what = f"part {part_id} was {part.text!r} by {quicker} meanwhile, no longer {before!r}"
        raise ConflictError(what, hint="look at it again")
    after = _text_after(part, action, text)
    if not person.name.strip():
        raise UnfitError("no name is given", hint="say who reviews the part")
    who, token = fit(person.name, "the person's name"), fit(person.token, "the token's name")
    answer = ReviewRecord(action, part.text, after, who, token, fit(note, "the note", limit=MAX_NOTE), tx.now)
    unreadable = action is ReviewAction.UNREADABLE
    if audit:
        verdict = _NOT_JUDGED if unreadable else _RIGHT if after == part.text else _DISPUTED
        part = replace(part, state=PartState.REVIEW if verdict == _DISPUTED else part.state)
        return write_part(tx, part, [(AUDITED, to_json(answer))], figures={"audit": verdict, **_NOT_CLAIMED})
    agrees = readers == 1 or (part.state is PartState.REVIEWED and after == part.text)
    if not agrees and after not in {
        opinion.after for opinion in _opinions(events_of(tx, part_id)) if not person.wrote(opinion)
    }:
        part = replace(part, state=PartState.REVIEW, touch=None)
        return write_part(tx, part, [(HALF_REVIEWED, to_json(answer))], figures=_NOT_CLAIMED)
    right = part.reading is not None and part.reading.text == after
    judged = _NOT_JUDGED if unreadable else _RIGHT if right else _WRONG
    figures = {"audit": sa.case((parts.c.audit.is_not(None), judged)), **_NOT_CLAIMED}
    part = replace(part, state=PartState.REVIEWED, text=after, plan=None, touch=None, review=answer)
    return write_part(tx, part, [(REVIEWED, to_json(answer))], targets=targets, figures=figures)


def undo_review(tx: Transaction, part_id: str, *, person: Person, targets: Sequence[str] = ()) -> PartRecord:
    """Undo a person's own review, which stays in the history: the part waits for review with its earlier text. Raises
    ConflictError: the part is not reviewed, or was reviewed by another person."""
    part = part_by_id(tx, part_id, lock=True)
    answer = part.review
    if part.state is not PartState.REVIEWED or answer is None:
        raise ConflictError(f"part {part_id} is not reviewed", hint="there is nothing to undo")
    if not person.wrote(answer):
        hint = "who reviewed it can undo it; or review it anew"
        raise ConflictError(f"part {part_id} was reviewed by {answer.who}", hint=hint)
    figures = {"audit": sa.case((parts.c.audit.is_not(None), _DISPUTED))}
    undone = ("review_undone", {"who": person.name, "text": answer.before})
    part = replace(part, state=PartState.REVIEW, text=answer.before)
    return write_part(tx, part, [undone], targets=targets, figures=figures)


def story(tx: Transaction, part_id: str) -> PartStory:
    """A part and all its events."""
    rows = events_of(tx, part_id)
    audits = _records(ReviewRecord, rows, AUDITED)
    return PartStory(
        events=tuple(
            EventRecord(row.at, row.kind, {name: row.data[name] for name in _TOLD.get(row.kind, row.data)})
            for row in rows
        ),
        readings=_records(ReadingRecord, rows, READ),
        reviews=_records(ReviewRecord, rows, REVIEWED, HALF_REVIEWED),
        evidence=evidence_of(tx, part_id),
        part=part_by_id(tx, part_id),
        opinions=_opinions(rows),
        audit=audits[-1] if audits else None,
        awaits_audit=_awaits_audit(tx, part_id),
    )


def _records(of: type[T], rows: Sequence[AnyRow], *kinds: str) -> tuple[T, ...]:
    return tuple(from_json(of, row.data) for row in rows if row.kind in kinds)


def _opinions(rows: Sequence[AnyRow]) -> tuple[ReviewRecord, ...]:
    last: dict[str, ReviewRecord] = {}
    for row in rows:
        if row.kind == REVIEWED:
            last.clear()
        elif row.kind == HALF_REVIEWED:
            last.pop(row.actor, None)
            last[row.actor] = from_json(ReviewRecord, row.data)
    return tuple(last.values())


def half_reviewed(tx: Transaction) -> Mapping[str, int]:
    """Parts that wait for another person's reading, and how many people have read them."""
    people = sa.func.count(sa.distinct(events.c.actor))
    query = sa.select(parts.c.id, people).join(events, events.c.part_id == parts.c.id)
    query = query.where(parts.c.state == PartState.REVIEW, is_open_opinion()).group_by(parts.c.id)
    return {row[0]: row[1] for row in tx.execute(query)}


def has_opinion_of(person: Person) -> sa.ColumnElement[bool]:
    """Whether a person has read a part that waits for another's reading."""
    by_person = events.c.actor == signature(who=person.name, token=person.token)
    return sa.exists().where(events.c.part_id == parts.c.id, by_person, is_open_opinion()).correlate(parts)


def is_open_opinion() -> sa.ColumnElement[bool]:
    """Whether an event is a person's reading since the part was last reviewed."""
    later = events.alias()
    reviewed = sa.exists().where(
        later.c.part_id == events.c.part_id, later.c.id > events.c.id, later.c.kind == REVIEWED
    )
    return sa.and_(events.c.kind == HALF_REVIEWED, ~reviewed.correlate(events))


def _awaits_audit(tx: Transaction, part_id: str) -> bool:
    return tx.count(parts, parts.c.id == part_id, IS_AUDITED) > 0


IS_AUDITED = sa.and_(parts.c.audit == AUDIT_WAITS, parts.c.state == PartState.ACCEPTED)


def audit_figures(tx: Transaction, since: datetime) -> AuditFigures:
    """Figures of the audited parts received since a time; a review before the audit counts as the audit."""
    drawn = sa.select(parts.c.audit, sa.func.count()).where(parts.c.audit.is_not(None))
    counted = tx.execute(drawn.where(parts.c.created_at >= since).group_by(parts.c.audit))
    n: dict[str, int] = {row[0]: row[1] for row in counted}
    return AuditFigures(
        drawn=sum(n.values()),
        waiting=n.get(AUDIT_WAITS, 0),
        disputed=n.get(_DISPUTED, 0),
        not_judged=n.get(_NOT_JUDGED, 0),
        accepted_wrong=share(n.get(_WRONG, 0), n.get(_RIGHT, 0) + n.get(_WRONG, 0), exact=True),
    )


def _refuse_if_held(tx: Transaction, part_id: str, person: Person) -> None:
    held = _claims(tx, sa.and_(parts.c.id == part_id, claimed_by_another(tx, person))).get(part_id)
    if held is not None and person.holder:
        who = held.who or "somebody else"
        what = f"{who} is at part {part_id} until {held.until:%H:%M:%S} UTC"
        raise ClaimedError(what, hint="take another, or wait")


def _text_after(part: PartRecord, action: ReviewAction, text: str) -> str:
    if action is ReviewAction.UNREADABLE:
        return ""
    if action is ReviewAction.CORRECT:
        if not text:
            raise UnfitError("the correction has no text", hint="give it, or say that the part is unreadable")
        return fit(text, "the text")
    if not part.text:
        raise UnfitError("there is no text to confirm", hint="correct it, or say that the part is unreadable")
    if text not in ("", part.text):
        what = f"{text[:MAX_TEXT]!r} cannot be confirmed, for the text is {part.text!r}"
        raise ConflictError(what, hint="correct it instead")
    return part.text
