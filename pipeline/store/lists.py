"""Lists of parts: searched, to be reviewed, reviewed."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import sqlalchemy as sa

from pipeline.common.part_id import is_part_id
from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord, PartState
from pipeline.store.claims import held_by_another
from pipeline.store.database import Transaction
from pipeline.store.errors import UnfitError, fit, fit_limit
from pipeline.store.rows import part_of, select_parts
from pipeline.store.tables import parts, reviews


def find_parts(
    tx: Transaction,
    *,
    state: PartState | None = None,
    text: str = "",
    name: str = "",
    job: str = "",
    line: str = "",
    since: datetime | None = None,
    until: datetime | None = None,
    before: str | None = None,
    limit: int = 50,
) -> tuple[PartRecord, ...]:
    """Parts, newest first.

    Args:
        tx: the transaction.
        state: they are in.
        text: that theirs holds, in upper or lower case.
        name: that theirs holds, likewise.
        job: that they were read by.
        line: that they come from.
        since: earliest time at which they were received.
        until: from when on they are not wanted.
        before: id of the last part of the page before.
        limit: most of them.
    """
    query = select_parts()
    if state is not None:
        query = query.where(parts.c.state == state)
    for column, wanted in ((parts.c.job, job), (parts.c.line, line)):
        if wanted:
            query = query.where(column == fit(wanted, "what is sought"))
    # not by the index of times, which would sort all of them for every page: through the ids, once for all pages
    received = sa.func.coalesce(parts.c.created_at, parts.c.changed_at)
    if since is not None:
        query = query.where(received >= since)
    if until is not None:
        query = query.where(received < until)
    if before is not None:
        query = query.where(parts.c.id < page_end(before))
    for column, wanted in ((parts.c.text_folded, text), (parts.c.name_folded, name)):
        if wanted:
            query = query.where(_holds(tx, column, fit(wanted, "what is sought").casefold()))
    return listed(tx, query.order_by(parts.c.id.desc()).limit(fit_limit(limit)))


def _holds(tx: Transaction, column: sa.Column[str], wanted: str) -> sa.ColumnElement[bool]:
    # not LIKE: nothing in what is sought has a meaning of its own
    find = sa.func.strpos if tx.postgresql else sa.func.instr
    return find(column, wanted) > 0


def queue(tx: Transaction, *, limit: int = 50) -> tuple[PartRecord, ...]:
    """Parts that a person is to look at, oldest first."""
    return listed(tx, _awaiting().limit(fit_limit(limit)))


def next_in_queue(
    tx: Transaction, after: str | None = None, *, person: Person | None = None
) -> PartRecord | None:
    """The oldest part to look at after that one, else the oldest, else None.

    Args:
        tx: the transaction.
        after: id of the part before.
        person: who wants it: no part that another is at, nor one that waits for another's reading.
    """
    free = _awaiting().limit(1)
    if person is not None:
        mine = reviews.c.token == person.token
        if not person.token:
            mine &= reviews.c.who == person.name
        said = sa.exists().where(
            reviews.c.part_id == parts.c.id, reviews.c.id > sa.func.coalesce(parts.c.review_id, 0), mine
        )
        free = free.where(~held_by_another(tx, parts.c.id, person), ~said.correlate(parts))
    later = () if after is None else listed(tx, free.where(parts.c.id > page_end(after)))
    return next(iter(later or listed(tx, free)), None)


def reviewed(
    tx: Transaction, *, since: datetime | None = None, after: str | None = None, limit: int = 1000
) -> tuple[PartRecord, ...]:
    """Parts that a person has looked at, by their ids, oldest first.

    Args:
        tx: the transaction.
        since: earliest time of their last review.
        after: id of the last part of the page before.
        limit: most of them.
    """
    query = select_parts().where(parts.c.state == PartState.REVIEWED)
    if since is not None:
        query = query.where(reviews.c.at >= since)
    if after is not None:
        query = query.where(parts.c.id > page_end(after))
    return listed(tx, query.order_by(parts.c.id).limit(fit_limit(limit)))


def page_end(part_id: str) -> str:
    """The id that a page of a list ended with.

    Raises:
        UnfitError: no part's id.
    """
    if not is_part_id(part_id):
        raise UnfitError(
            f"{part_id[:40]!r} is not a part's id", hint="give the one the page before ended with"
        )
    return part_id


def _awaiting() -> sa.Select[Any]:
    return select_parts().where(parts.c.state == PartState.REVIEW).order_by(parts.c.id)


def listed(tx: Transaction, query: sa.Select[Any]) -> tuple[PartRecord, ...]:
    """The parts of a query of `select_parts`."""
    return tuple(part_of(row) for row in tx.execute(query))
