"""What a person says of a part, and how right the readers were by that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sqlalchemy as sa

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState, ReviewAction, ReviewRecord
from pipeline.store.claims import end_claim
from pipeline.store.database import Transaction
from pipeline.store.errors import MAX_NOTE, MAX_TEXT, ConflictError, UnfitError, fit
from pipeline.store.outbox import put_in_outbox
from pipeline.store.parts import add_events, lock_part
from pipeline.store.rows import part_by_id, review_of
from pipeline.store.tables import parts, reviews


def add_review(
    tx: Transaction,
    part_id: str,
    *,
    action: ReviewAction,
    text: str,
    who: str,
    token: str = "",
    seat: str = "",
    note: str = "",
    before: str | None = None,
    targets: Sequence[str] = (),
    readers: int = 1,
) -> PartRecord:
    """Write down what a person says of a part; it may be said anew, and what was said before stays.

    With two readers a part is reviewed when two people have said the same of it; until then it waits for review, its
    text as it was read.

    Args:
        tx: the transaction.
        part_id: of which part.
        action: what the person did; an unreadable part has no text, whatever is given.
        text: right one; to confirm, the text as it stands or none.
        who: the person.
        token: name of the token used.
        seat: where the person sits, as `Person.seat`.
        note: anything.
        before: the text that the person looked at.
        targets: where the part is published, once it is reviewed.
        readers: people who must agree, 1 or 2.

    Raises:
        ConflictError: the text is no longer what the person looked at.
        ClaimedError: another person is at the part.
    """
    person = Person(who, token, seat)
    lock_part(tx, part_id)
    end_claim(tx, part_id, person)
    part = part_by_id(tx, part_id)
    if before is not None and before != part.text:
        quicker = part.review.who if part.review is not None else "a reader"
        raise ConflictError(
            f"part {part_id} was {part.text!r} by {quicker} meanwhile, no longer {before!r}",
            hint="look at it again",
        )
    after = _text_after(part, action, text)
    row = {
        "part_id": part_id,
        "at": tx.now,
        "action": action,
        "before": part.text,
        "after": after,
        "who": fit(who, "the person's name"),
        "token": fit(token, "the token's name"),
        "note": fit(note, "the note", limit=MAX_NOTE),
    }
    if not who.strip():
        raise UnfitError("no name is given", hint="say who reviews the part")
    others = [said for said in opinions(tx, part_id) if not person.said(said)]
    key = tx.execute(sa.insert(reviews).values(**row)).inserted_primary_key
    assert key is not None
    stood = part.state is PartState.REVIEWED and after == part.text
    if readers > 1 and not stood and not any(other.after == after for other in others):
        tx.execute(
            sa.update(parts).where(parts.c.id == part_id).values(state=PartState.REVIEW, changed_at=tx.now)
        )
        # not what was said: the next person is not to know
        add_events(tx, part_id, [("read_by_person", {"who": who})])
        return part_by_id(tx, part_id)
    tx.execute(
        sa.update(parts)
        .where(parts.c.id == part_id)
        .values(
            state=PartState.REVIEWED,
            text=after,
            text_folded=after.casefold(),
            plan=None,
            review_id=int(key[0]),
            changed_at=tx.now,
            **_how_right(part, action, after),
        )
    )
    event = {"action": action.value, "before": part.text, "after": after, "who": who}
    add_events(tx, part_id, [("reviewed", event)])
    made = part_by_id(tx, part_id)
    put_in_outbox(tx, made, targets)
    return made


def undo_review(tx: Transaction, part_id: str, *, person: Person, targets: Sequence[str] = ()) -> PartRecord:
    """Take a person's own review back: the part waits for review again, with the text that it had before.

    The review stays in the part's history.

    Args:
        tx: the transaction.
        part_id: of which part.
        person: who has reviewed it.
        targets: where the part is published.

    Raises:
        ConflictError: the part is not reviewed, or by somebody else.
    """
    lock_part(tx, part_id)
    part = part_by_id(tx, part_id)
    said = part.review
    if part.state is not PartState.REVIEWED or said is None:
        raise ConflictError(f"part {part_id} is not reviewed", hint="there is nothing to undo")
    if not person.said(said):
        raise ConflictError(
            f"part {part_id} was reviewed by {said.who}",
            hint="who reviewed it can undo it; or review it anew",
        )
    tx.execute(
        sa.update(parts)
        .where(parts.c.id == part_id)
        .values(
            state=PartState.REVIEW,
            text=said.before,
            text_folded=said.before.casefold(),
            changed_at=tx.now,
            was_right=None,
            characters=None,
            characters_right=None,
        )
    )
    add_events(tx, part_id, [("review_undone", {"who": person.name, "text": said.before})])
    made = part_by_id(tx, part_id)
    put_in_outbox(tx, made, targets)
    return made


def opinions(tx: Transaction, part_id: str) -> tuple[ReviewRecord, ...]:
    """What people have said of a part since it was last reviewed, each person's last word, the first one first."""
    last: dict[tuple[str, str], ReviewRecord] = {}
    for row in tx.execute(_open_reviews().where(reviews.c.part_id == part_id).order_by(reviews.c.id)):
        said = review_of(row)
        key = (said.token, "" if said.token else said.who)
        last.pop(key, None)
        last[key] = said
    return tuple(last.values())


def half_reviewed(tx: Transaction) -> Mapping[str, int]:
    """Parts that wait for another person's reading, and how many people have read them."""
    people = sa.func.count(
        sa.distinct(reviews.c.token + "/" + sa.case((reviews.c.token == "", reviews.c.who), else_=""))
    )
    asked = (
        sa.select(parts.c.id, people.label("n"))
        .select_from(reviews.join(parts, reviews.c.part_id == parts.c.id))
        .where(parts.c.state == PartState.REVIEW, reviews.c.id > sa.func.coalesce(parts.c.review_id, 0))
        .group_by(parts.c.id)
    )
    return {row.id: row.n for row in tx.execute(asked)}


def _open_reviews() -> sa.Select[Any]:
    table = reviews.join(parts, reviews.c.part_id == parts.c.id)
    return sa.select(reviews).select_from(table).where(reviews.c.id > sa.func.coalesce(parts.c.review_id, 0))


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
        raise ConflictError(
            f"{text[:MAX_TEXT]!r} cannot be confirmed, for the text is {part.text!r}",
            hint="correct it instead",
        )
    return part.text


def _how_right(part: PartRecord, action: ReviewAction, after: str) -> dict[str, Any]:
    read = part.reading.text if part.reading is not None else ""
    if action is ReviewAction.UNREADABLE:
        # nobody knows the characters, so none is counted
        return {"was_right": False, "characters": 0, "characters_right": 0}
    return {
        "was_right": read == after,
        "characters": len(after),
        "characters_right": len(after) if read == after else _characters_right(after, read[: 2 * MAX_TEXT]),
    }


def _characters_right(true: str, read: str) -> int:
    from pipeline.common.texts import align

    return max(0, len(true) - sum(not pair.right for pair in align(true, read)))
