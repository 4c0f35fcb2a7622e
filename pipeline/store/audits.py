"""Accepted parts that were drawn to be read by a person as well, who does not see what was accepted.

accepted --drawn--> waiting --same--------> right
                           \\--otherwise---> review: a person who sees everything says whether it was accepted wrong
                           \\--unreadable--> not judged

The line does not wait: the part stays accepted, and what was sent of it stands, until a review says otherwise.
"""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa

from pipeline.common.people_records import AuditFigures, AuditRecord, Person
from pipeline.common.records import PartRecord, PartState, ReviewAction
from pipeline.common.shares import share
from pipeline.store.claims import end_claim, held_by_another
from pipeline.store.database import Transaction
from pipeline.store.errors import MAX_NOTE, ConflictError, UnfitError, fit, fit_limit
from pipeline.store.lists import listed, page_end
from pipeline.store.parts import add_events, lock_part
from pipeline.store.rows import part_by_id, select_parts
from pipeline.store.tables import audits, parts, reviews


def audit_of(tx: Transaction, part_id: str) -> AuditRecord | None:
    """What came of a part's audit; None where it was not drawn."""
    row = tx.execute(sa.select(audits).where(audits.c.part_id == part_id)).one_or_none()
    if row is None:
        return None
    action = None if row.action is None else ReviewAction(row.action)
    return AuditRecord(row.at, row.done_at, row.who or "", row.token or "", action, row.text or "", row.same)


def audit_queue(tx: Transaction, *, limit: int = 50) -> tuple[PartRecord, ...]:
    """Parts to be audited, oldest first."""
    return listed(tx, _awaiting().limit(fit_limit(limit)))


def next_audit(tx: Transaction, person: Person, after: str | None = None) -> PartRecord | None:
    """The oldest part to audit after that one that nobody else is at, else the oldest, else None."""
    free = _awaiting().where(~held_by_another(tx, parts.c.id, person)).limit(1)
    later = () if after is None else listed(tx, free.where(parts.c.id > page_end(after)))
    return next(iter(later or listed(tx, free)), None)


def _awaiting() -> sa.Select[tuple[object, ...]]:
    drawn = select_parts().join(audits, audits.c.part_id == parts.c.id)
    return drawn.where(audits.c.done_at.is_(None), parts.c.state == PartState.ACCEPTED).order_by(parts.c.id)


def add_audit(
    tx: Transaction, part_id: str, *, action: ReviewAction, text: str, person: Person, note: str = ""
) -> AuditRecord:
    """Write down what a person has read of an accepted part without seeing what was accepted.

    Where it is something else, the part goes to review, for one of the two is wrong.

    Raises:
        ConflictError: the part does not wait for an audit.
        ClaimedError: another person is at it.
    """
    lock_part(tx, part_id)
    part, drawn = part_by_id(tx, part_id), audit_of(tx, part_id)
    if drawn is None or drawn.done_at is not None or part.state is not PartState.ACCEPTED:
        raise ConflictError(f"part {part_id} does not wait for an audit", hint="take the next one")
    end_claim(tx, part_id, person)
    if not person.name.strip():
        raise UnfitError("no name is given", hint="say who audits the part")
    if action is not ReviewAction.UNREADABLE and not text:
        raise UnfitError("there is no text", hint="give it, or say that the part is unreadable")
    read = "" if action is ReviewAction.UNREADABLE else fit(text, "the text")
    same = read == part.text
    tx.execute(
        sa.update(audits)
        .where(audits.c.part_id == part_id)
        .values(
            done_at=tx.now,
            who=fit(person.name, "the person's name"),
            token=fit(person.token, "the token's name"),
            action=action,
            text=read,
            same=same,
        )
    )
    happened = {"who": person.name, "read": read, "same": same, "note": fit(note, "the note", limit=MAX_NOTE)}
    add_events(tx, part_id, [("audited", happened)])
    changes: dict[str, object] = {"changed_at": tx.now}
    if not same and action is not ReviewAction.UNREADABLE:
        changes |= {"state": PartState.REVIEW}
    tx.execute(sa.update(parts).where(parts.c.id == part_id).values(**changes))
    made = audit_of(tx, part_id)
    assert made is not None
    return made


def audit_figures(tx: Transaction, since: datetime) -> AuditFigures:
    """Of the accepted parts that were drawn since a time; a part reviewed before its audit counts by that review."""
    unread = audits.c.done_at.is_(None)
    reviewed = parts.c.state == PartState.REVIEWED
    unreadable = sa.func.coalesce(sa.case((reviewed, reviews.c.action), else_=audits.c.action), "")
    kinds = sa.case(
        (unread & (parts.c.state == PartState.ACCEPTED), "waiting"),
        (unread & ~reviewed, "dropped"),  # read again meanwhile, and no longer accepted
        (unreadable == ReviewAction.UNREADABLE, "not_judged"),
        (~unread & audits.c.same, "right"),
        (~reviewed, "disputed"),
        (parts.c.was_right, "right"),
        else_="wrong",
    ).label("kind")
    table = audits.join(parts, parts.c.id == audits.c.part_id).outerjoin(
        reviews, reviews.c.id == parts.c.review_id
    )
    asked = sa.select(kinds, sa.func.count().label("n")).select_from(table).where(audits.c.at >= since)
    counted = {row.kind: row.n for row in tx.execute(asked.group_by(sa.text("1")))}
    right, wrong = counted.get("right", 0), counted.get("wrong", 0)
    return AuditFigures(
        drawn=sum(counted.values()) - counted.get("dropped", 0),
        waiting=counted.get("waiting", 0),
        disputed=counted.get("disputed", 0),
        not_judged=counted.get("not_judged", 0),
        accepted_wrong=share(wrong, right + wrong, exact=True),
    )
