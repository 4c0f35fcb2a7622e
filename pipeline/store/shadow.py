"""How readings agree with the line's own reader, of parts that were read in shadow mode."""

from __future__ import annotations

from datetime import date, datetime

import sqlalchemy as sa

from pipeline.common.records import Agreement, AgreementDay, PartRecord, PartState
from pipeline.store.database import Transaction
from pipeline.store.errors import UnfitError, fit_limit
from pipeline.store.lists import listed, page_end
from pipeline.store.rows import select_parts
from pipeline.store.tables import parts


def agreement_by_day(tx: Transaction, since: datetime) -> tuple[AgreementDay, ...]:
    """Of the parts received in shadow mode since a time; days without any are left out.

    Raises:
        UnfitError: the time has no zone.
    """
    if since.tzinfo is None:
        raise UnfitError("agreement cannot begin there", hint="give a time with its zone")
    day: sa.ColumnElement[str]
    if tx.postgresql:
        day = sa.func.to_char(sa.func.timezone("UTC", parts.c.created_at), "YYYY-MM-DD")
    else:
        day = sa.func.substr(sa.type_coerce(parts.c.created_at, sa.String), 1, len("2026-11-21"))
    named = (
        sa.select(day.label("day"), parts.c.agreement, parts.c.would_be)
        .where(parts.c.agreement.in_(list(Agreement)), parts.c.created_at >= since)
        .subquery()
    )
    columns = (named.c.day, named.c.agreement, named.c.would_be)
    all_parts: dict[str, dict[Agreement, int]] = {}
    accepted: dict[str, dict[Agreement, int]] = {}
    for row in tx.execute(sa.select(*columns, sa.func.count().label("n")).group_by(*columns)):
        kind = Agreement(row.agreement)
        of_day = all_parts.setdefault(row.day, {})
        of_day[kind] = of_day.get(kind, 0) + row.n
        if row.would_be == PartState.ACCEPTED:
            accepted.setdefault(row.day, {})[kind] = row.n
    return tuple(
        AgreementDay(date.fromisoformat(name), accepted.get(name, {}), all_parts[name])
        for name in sorted(all_parts)
    )


def compared_parts(
    tx: Transaction, agreement: Agreement, *, before: str | None = None, limit: int = 50
) -> tuple[PartRecord, ...]:
    """Parts of that agreement, newest first.

    Args:
        tx: the transaction.
        agreement: with the line's own reader.
        before: id of the last part of the page before.
        limit: most of them.
    """
    query = select_parts().where(parts.c.agreement == agreement)
    if before is not None:
        query = query.where(parts.c.id < page_end(before))
    return listed(tx, query.order_by(parts.c.id.desc()).limit(fit_limit(limit)))
