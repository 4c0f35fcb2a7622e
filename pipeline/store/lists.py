"""Lists of parts: searched, to be reviewed, reviewed."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from pipeline.common.part_id import is_part_id
from pipeline.common.records import PartRecord, PartState
from pipeline.store.errors import UnfitError, fit, fit_limit
from pipeline.store.rows import part_of, select_parts
from pipeline.store.tables import parts, reviews


def find_parts(
    connection: Connection,
    *,
    state: PartState | None,
    text: str,
    name: str,
    before: str | None,
    limit: int,
) -> tuple[PartRecord, ...]:
    """Parts, newest first."""
    query = select_parts()
    if state is not None:
        query = query.where(parts.c.state == state)
    if before is not None:
        query = query.where(parts.c.id < _id(before))
    for column, wanted in ((parts.c.text_folded, text), (parts.c.name_folded, name)):
        if wanted:
            query = query.where(_holds(connection, column, fit(wanted, "what is sought").casefold()))
    return _listed(connection, query.order_by(parts.c.id.desc()).limit(fit_limit(limit)))


def _holds(connection: Connection, column: sa.Column[str], wanted: str) -> sa.ColumnElement[bool]:
    # not LIKE: nothing in what is sought has a meaning of its own
    find = sa.func.strpos if connection.dialect.name == "postgresql" else sa.func.instr
    return find(column, wanted) > 0


def queue(connection: Connection, *, limit: int) -> tuple[PartRecord, ...]:
    """Parts to be reviewed, oldest first."""
    return _listed(connection, _awaiting().limit(fit_limit(limit)))


def next_in_queue(connection: Connection, after: str | None) -> PartRecord | None:
    """The oldest part to be reviewed that is younger than another; the oldest of all where none is."""
    found = () if after is None else _listed(connection, _awaiting().where(parts.c.id > _id(after)).limit(1))
    return next(iter(found or queue(connection, limit=1)), None)


def reviewed(
    connection: Connection, *, since: datetime | None, after: str | None, limit: int
) -> tuple[PartRecord, ...]:
    """Parts whose last review is not older than a time, the part received first first."""
    query = select_parts().where(parts.c.state == PartState.REVIEWED)
    if since is not None:
        query = query.where(reviews.c.at >= since)
    if after is not None:
        query = query.where(parts.c.id > _id(after))
    return _listed(connection, query.order_by(parts.c.id).limit(fit_limit(limit)))


def _id(part_id: str) -> str:
    if not is_part_id(part_id):
        raise UnfitError(f"{part_id[:40]!r} is no id of a part; give the one the page before ended with")
    return part_id


def _awaiting() -> sa.Select[Any]:
    return select_parts().where(parts.c.state == PartState.REVIEW).order_by(parts.c.id)


def _listed(connection: Connection, query: sa.Select[Any]) -> tuple[PartRecord, ...]:
    return tuple(part_of(row) for row in connection.execute(query))
