"""What has happened to a part, sealed: hashes in a chain, a link for every transaction that wrote of the part.

    readings, reviews, evidence, events of a part, as they were written
      row row | row | row row row         |
      seal 1  <- seal 2 <- seal 3         a seal: hash of the part, its number, the seal before, and the rows since

A row that is changed, removed or put in later no longer fits its seal. Whoever may write to the database, and knows
how, can also make the seals anew, or leave out a part or the end of its chain: that shows against the seals of a backup
kept elsewhere. What a part's own row holds is no part of the chain, for it follows from the rows that are.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Row

from pipeline.store.database import Transaction
from pipeline.store.tables import events, evidence, readings, reviews, seals

SEALED = (readings, reviews, evidence, events)
"""Tables whose rows are sealed, in this order."""
_LATER = {"gone"}
"""Columns that may change after the seal."""


def seal_written(tx: Transaction) -> None:
    """Seal what the transaction has written of parts; the parts are locked, so their chains do not fork."""
    for part_id in sorted(tx.written):
        mine = sa.select(seals).where(seals.c.part_id == part_id)
        before = tx.execute(mine.order_by(seals.c.number.desc()).limit(1)).one_or_none()
        rows = {
            t.name: _rows_after(tx, t, part_id, getattr(before, f"last_{t.name}", 0))
            if t.name in tx.filled
            else ()
            for t in SEALED
        }
        tx.execute(sa.insert(seals).values(**_next_seal(part_id, before, rows)))


def broken_at(part_id: str, chain: Sequence[Row[Any]], rows: Mapping[str, Sequence[Row[Any]]]) -> str:
    """What does not fit in a part's chain; empty where all does.

    Args:
        part_id: of the part.
        chain: its seals, in order.
        rows: all of its rows by table, in order.
    """
    before: Row[Any] | None = None
    for number, seal in enumerate(chain, start=1):
        if seal.number != number:
            return f"its seal {number} is gone"
        covered = {name: _between(found, name, before, seal) for name, found in rows.items()}
        if _next_seal(part_id, before, covered)["digest"] != seal.digest:
            return f"what its seal {number} covers is not as it was written"
        before = seal
    if before is None:
        return "it has no seal"
    left = [name for name, found in rows.items() if found and found[-1].id > getattr(before, f"last_{name}")]
    return f"its last {' and '.join(left)} bear no seal" if left else ""


def _next_seal(
    part_id: str, before: Row[Any] | None, rows: Mapping[str, Sequence[Row[Any]]]
) -> dict[str, Any]:
    number = 1 if before is None else before.number + 1
    heading = json.dumps([part_id, number, "" if before is None else before.digest])
    lines = (_line(table.name, row) for table in SEALED for row in rows[table.name])
    return {
        "part_id": part_id,
        "number": number,
        "digest": hashlib.sha256("\n".join((heading, *lines)).encode()).hexdigest(),
        **{
            f"last_{t.name}": rows[t.name][-1].id if rows[t.name] else getattr(before, f"last_{t.name}", 0)
            for t in SEALED
        },
    }


def _line(name: str, row: Row[Any]) -> str:
    # what is null is left out, so that a column of a later version changes no seal of before
    values = {c: _plain(v) for c, v in row._mapping.items() if v is not None and c not in _LATER}
    return json.dumps([name, values], sort_keys=True)


def _plain(value: Any) -> Any:
    return value.astimezone(UTC).isoformat() if isinstance(value, datetime) else value


def _rows_after(tx: Transaction, table: sa.Table, part_id: str, last: int) -> Sequence[Row[Any]]:
    mine = sa.select(table).where(table.c.part_id == part_id, table.c.id > last)
    return tx.execute(mine.order_by(table.c.id)).all()


def _between(
    rows: Iterable[Row[Any]], name: str, before: Row[Any] | None, seal: Row[Any]
) -> Sequence[Row[Any]]:
    first = getattr(before, f"last_{name}", 0)
    return [row for row in rows if first < row.id <= getattr(seal, f"last_{name}")]
