"""Every row of a store into another, empty one, whatever databases the two are in."""

from __future__ import annotations

import sqlalchemy as sa

from pipeline.store.database import Transaction
from pipeline.store.tables import METADATA, outbox, sessions

_CHUNK = 500


def is_empty(tx: Transaction) -> bool:
    """Whether a store holds no row at all."""
    return all(tx.execute(sa.select(table).limit(1)).first() is None for table in METADATA.sorted_tables)


def copy_rows(source: Transaction, target: Transaction) -> None:
    """Copy all rows but sessions; row numbers stay, and the target goes on counting behind them."""
    for table in METADATA.sorted_tables:
        if table is sessions:
            continue  # who has signed out since is not signed in again by a backup
        rows = source.connection.execution_options(yield_per=_CHUNK).execute(sa.select(table))
        for chunk in rows.mappings().partitions():
            target.execute(sa.insert(table), [dict(row) for row in chunk])
        if target.postgresql and "id" in table.c and table.c.id.autoincrement is True:
            _count_on(target, table.name, _highest(target, table))
    _count_on(target, outbox.name, last_delivery(source))


def last_delivery(tx: Transaction) -> int:
    """The highest number that any delivery has had, also one that is gone."""
    counted = (
        "SELECT last_value FROM pg_sequences WHERE schemaname = current_schema()"
        " AND format('%I.%I', schemaname, sequencename) = pg_get_serial_sequence('outbox', 'id')"
        if tx.postgresql
        else "SELECT seq FROM sqlite_sequence WHERE name = 'outbox'"
    )
    return max(int(tx.execute(sa.text(counted)).scalar() or 0), _highest(tx, outbox))


def skip_deliveries(tx: Transaction, n: int) -> None:
    """Give no delivery any of the next numbers."""
    _count_on(tx, outbox.name, last_delivery(tx) + n)


def _highest(tx: Transaction, table: sa.Table) -> int:
    return int(tx.execute(sa.select(sa.func.max(table.c.id))).scalar() or 0)


def _count_on(tx: Transaction, name: str, number: int) -> None:
    if number == 0:
        return
    if tx.postgresql:
        tx.execute(sa.select(sa.func.setval(sa.func.pg_get_serial_sequence(name, "id"), number)))
        return
    tx.execute(sa.text("DELETE FROM sqlite_sequence WHERE name = :name"), {"name": name})  # type: ignore[arg-type]
    tx.execute(
        sa.text("INSERT INTO sqlite_sequence (name, seq) VALUES (:name, :seq)"),
        {"name": name, "seq": number},  # type: ignore[arg-type]
    )
