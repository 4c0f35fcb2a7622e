"""Who is at which part: a claim keeps a part under review from others for a while.

free --claim--> held --released, reviewed, or its time is up--> free
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from pipeline.common.people_records import ClaimRecord, Person
from pipeline.store.database import Transaction
from pipeline.store.errors import MAX_ROWS, ClaimedError, fit
from pipeline.store.rows import check_id, no_part
from pipeline.store.tables import claims, parts

CLAIM_S = 300.0
"""A claim holds for so long; an open page renews it."""


def claim_part(tx: Transaction, part_id: str, person: Person) -> ClaimRecord:
    """Take a part, or renew what one has of it; where another has it, say who.

    Returns:
        Whose the part now is.
    """
    check_id(part_id)
    if tx.execute(sa.select(parts.c.id).where(parts.c.id == part_id)).one_or_none() is None:
        raise no_part(part_id)
    values = {
        "part_id": part_id,
        "holder": fit(person.holder, "the holder of a claim", limit=300),
        "who": fit(person.name, "the person's name"),
        "until": tx.now + timedelta(seconds=CLAIM_S),
    }
    insert = postgresql.insert if tx.postgresql else sqlite.insert
    asked = insert(claims).values(**values)
    free = sa.not_(_holds(tx)) | (claims.c.holder == asked.excluded.holder)
    # one statement: two who ask at once cannot both find it free
    taken = asked.on_conflict_do_update(
        index_elements=[claims.c.part_id],
        set_={
            name: sa.case((free, asked.excluded[name]), else_=claims.c[name])
            for name in ("holder", "who", "until")
        },
    )
    row = tx.execute(taken.returning(*claims.c)).one()
    return ClaimRecord(row.part_id, row.holder, row.who, row.until)


def take_over_part(tx: Transaction, part_id: str, person: Person) -> ClaimRecord:
    """Take a part from whoever is at it, for a person who has seen that nobody is.

    Returns:
        The person's claim.
    """
    check_id(part_id)
    tx.execute(sa.delete(claims).where(claims.c.part_id == part_id))
    return claim_part(tx, part_id, person)


def release_part(tx: Transaction, part_id: str, person: Person) -> None:
    """Let go of a part; nothing happens where it is not the person's."""
    tx.execute(sa.delete(claims).where(claims.c.part_id == part_id, claims.c.holder == person.holder))


def claimed(tx: Transaction) -> Mapping[str, ClaimRecord]:
    """The claims that hold now, by part."""
    held = sa.select(claims).where(_holds(tx)).order_by(claims.c.part_id).limit(MAX_ROWS)
    return {row.part_id: ClaimRecord(row.part_id, row.holder, row.who, row.until) for row in tx.execute(held)}


def held_by_another(
    tx: Transaction, part_id: sa.ColumnElement[str], person: Person
) -> sa.ColumnElement[bool]:
    """Whether somebody else is at a part."""
    return sa.exists().where(claims.c.part_id == part_id, _holds(tx), claims.c.holder != person.holder)


def _holds(tx: Transaction) -> sa.ColumnElement[bool]:
    """Whether a claim holds now; one beyond any claim's time was made by a clock that was set back since."""
    return sa.and_(claims.c.until > tx.now, claims.c.until <= tx.now + timedelta(seconds=2.0 * CLAIM_S))


def end_claim(tx: Transaction, part_id: str, person: Person) -> None:
    """Let a part go that a person has dealt with.

    Raises:
        ClaimedError: another person is at it.
    """
    asked = sa.select(claims).where(claims.c.part_id == part_id, _holds(tx))
    held = tx.execute(asked).one_or_none()
    if held is not None and person.holder and held.holder != person.holder:
        raise ClaimedError(
            f"{held.who or 'somebody else'} is at part {part_id} until {held.until:%H:%M:%S} UTC",
            hint="take another, or wait",
        )
    tx.execute(sa.delete(claims).where(claims.c.part_id == part_id))
