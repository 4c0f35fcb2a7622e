"""What a person says of a part, and how right the readers were by that."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from pipeline.common.records import PartRecord, PartState, ReviewAction, ReviewRecord
from pipeline.store.errors import MAX_NOTE, MAX_TEXT, ConflictError, UnfitError, fit
from pipeline.store.outbox import put_in_outbox
from pipeline.store.parts import add_events, lock_part
from pipeline.store.rows import part_by_id
from pipeline.store.tables import parts, reviews


def add_review(
    connection: Connection,
    now: datetime,
    part_id: str,
    *,
    said: ReviewRecord,
    seen: str | None,
    targets: Sequence[str],
) -> PartRecord:
    """Write down a review; see `pipeline.store.store.Store.review`.

    Args:
        connection: in a transaction.
        now: time of it.
        part_id: of which part.
        said: with any `before`, for that is found here.
        seen: the text that the person saw; None if unknown.
        targets: where to publish.
    """
    lock_part(connection, part_id)
    part = part_by_id(connection, part_id)
    if seen is not None and seen != part.text:
        who = part.review.who if part.review is not None else "a reader"
        raise ConflictError(
            f"part {part_id} was {part.text!r} by {who} meanwhile, no longer {seen!r}; look at it again"
        )
    after = _text_after(part, said)
    row = {
        "part_id": part_id,
        "at": now,
        "action": said.action,
        "before": part.text,
        "after": after,
        "who": fit(said.who, "the person's name"),
        "token": fit(said.token, "the token's name"),
        "note": fit(said.note, "the note", limit=MAX_NOTE),
    }
    if not said.who.strip():
        raise UnfitError("nobody is named; say who reviews the part")
    key = connection.execute(sa.insert(reviews).values(**row)).inserted_primary_key
    assert key is not None
    connection.execute(
        sa.update(parts)
        .where(parts.c.id == part_id)
        .values(
            state=PartState.REVIEWED,
            text=after,
            text_folded=after.casefold(),
            plan=None,
            review_id=int(key[0]),
            changed_at=now,
            **_how_right(part, said.action, after),
        )
    )
    event = {"action": said.action.value, "before": part.text, "after": after, "who": said.who}
    add_events(connection, now, part_id, [("reviewed", event)])
    made = part_by_id(connection, part_id)
    put_in_outbox(connection, now, made, targets)
    return made


def _text_after(part: PartRecord, said: ReviewRecord) -> str:
    if said.action is ReviewAction.UNREADABLE:
        return ""
    if said.action is ReviewAction.CORRECT:
        if not said.after:
            raise UnfitError("the correction has no text; give it, or say that the part is unreadable")
        return fit(said.after, "the text")
    if not part.text:
        raise UnfitError("there is no text to confirm; correct it, or say that the part is unreadable")
    if said.after not in ("", part.text):
        raise ConflictError(
            f"{said.after[:MAX_TEXT]!r} cannot be confirmed, for the text is {part.text!r}; correct it instead"
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
