"""Lists of parts: search, review and audit queues, comparison with the line's own reader."""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa

from pipeline.common.part_id import is_part_id
from pipeline.common.people_records import Person
from pipeline.common.records import Agreement, PartRecord, PartState
from pipeline.store.database import Transaction
from pipeline.store.errors import UnfitError, fit
from pipeline.store.review import IS_AUDITED, claimed_by_another, has_opinion_of
from pipeline.store.rows import select_parts
from pipeline.store.tables import parts

_IDS = sa.select(parts.c.id)


def find_parts(
    tx: Transaction,
    *,
    state: PartState | None = None,
    agreement: Agreement | None = None,
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
        agreement: with the line's own reader, of parts read in shadow mode.
        text: text that theirs holds, in upper or lower case.
        name: name that theirs holds, likewise.
        job: job that they were read by.
        line: line that they come from.
        since: earliest time at which they were received.
        until: time from which on they are not wanted.
        before: id of the last part of the page before.
        limit: most of them.
    """
    same = {"state": state, "agreement": agreement, "job": job, "line": line}
    wanted = [parts.c[column] == fit(value, "what is sought") for column, value in same.items() if value]
    # not LIKE: nothing in what is sought has a meaning of its own
    find = sa.func.strpos if tx.postgresql else sa.func.instr
    wanted += [
        find(parts.c[f"{column}_folded"], fit(value, "what is sought").casefold()) > 0
        for column, value in (("text", text), ("name", name))
        if value
    ]
    # not by the index of times, which would sort all of them for every page: through the ids, once for all pages
    received = sa.func.coalesce(parts.c.created_at, parts.c.created_at)
    if since is not None:
        wanted.append(received >= since)
    if until is not None:
        wanted.append(received < until)
    if before is not None:
        wanted.append(parts.c.id < _page_end(before))
    ids = _IDS.where(*wanted).order_by(parts.c.id.desc()).limit(limit)
    return select_parts(tx, ids, newest_first=True)


def queue(tx: Transaction, *, audits: bool = False, limit: int = 50) -> tuple[PartRecord, ...]:
    """Parts that a person should review or audit, oldest first."""
    return select_parts(tx, _IDS.where(_awaits(audits)).order_by(parts.c.id).limit(limit))


def queue_length(tx: Transaction, *, audits: bool = False) -> int:
    """Number of parts that a person should review or audit."""
    return tx.count(parts, _awaits(audits))


def next_in_queue(
    tx: Transaction, after: str | None = None, *, person: Person | None = None, audits: bool = False
) -> PartRecord | None:
    """The oldest part to review after that one, otherwise the oldest, otherwise None.

    Args:
        tx: the transaction.
        after: id of the part before.
        person: the reader; parts that another person has open or that need another reader are skipped.
        audits: parts to be audited, not those to be reviewed.
    """
    free = _IDS.where(_awaits(audits)).order_by(parts.c.id).limit(1)
    if person is not None:
        free = free.where(
            ~sa.func.coalesce(claimed_by_another(tx, person), sa.false()), ~has_opinion_of(person)
        )
    later = () if after is None else select_parts(tx, free.where(parts.c.id > _page_end(after)))
    return next(iter(later or select_parts(tx, free)), None)


def _page_end(part_id: str) -> str:
    if not is_part_id(part_id):
        raise UnfitError(f"{part_id[:40]!r} is not a part's id", hint="give the last page's last one")
    return part_id


def _awaits(audits: bool) -> sa.ColumnElement[bool]:
    return IS_AUDITED if audits else parts.c.state == PartState.REVIEW
