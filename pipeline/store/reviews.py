"""What a person says of a part, and how right the readers were by that."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sqlalchemy as sa

from pipeline.common.records import PartRecord, PartState, ReviewAction
from pipeline.store.database import Transaction
from pipeline.store.errors import MAX_NOTE, MAX_TEXT, ConflictError, UnfitError, fit
from pipeline.store.outbox import put_in_outbox
from pipeline.store.parts import add_events, lock_part
from pipeline.store.rows import part_by_id
from pipeline.store.tables import parts, reviews


def add_review(
    tx: Transaction,
    part_id: str,
    *,
    action: ReviewAction,
    text: str,
    who: str,
    token: str = "",
    note: str = "",
    before: str | None = None,
    targets: Sequence[str] = (),
) -> PartRecord:
    """Write down what a person says of a part; it may be said anew, and what was said before stays.

    Args:
        tx: the transaction.
        part_id: of which part.
        action: what the person did; an unreadable part has no text, whatever is given.
        text: right one; to confirm, the text as it stands or none.
        who: the person.
        token: name of the token used.
        note: anything.
        before: the text that the person looked at.
        targets: where the part is published.

    Raises:
        ConflictError: the text is no longer what the person looked at.
    """
    lock_part(tx, part_id)
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
    key = tx.execute(sa.insert(reviews).values(**row)).inserted_primary_key
    assert key is not None
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
    from pipeline.common.alignment import align

    return max(0, len(true) - sum(not pair.right for pair in align(true, read)))
