"""Scans of golden parts, in their order."""

from __future__ import annotations

from collections.abc import Mapping

import sqlalchemy as sa

from pipeline.common.golden_record import GoldenMeasure, GoldenRecord, Measured
from pipeline.store.database import Transaction
from pipeline.store.errors import fit_limit
from pipeline.store.tables import golden

MOST = 500


def add_golden(
    tx: Transaction, measures: Mapping[GoldenMeasure, Measured], *, line: str, reference: bool
) -> GoldenRecord:
    """Keep what a scan has shown; the first of a line is its reference."""
    first = tx.execute(sa.select(golden.c.id).where(golden.c.line == line).limit(1)).first() is None
    record = GoldenRecord(tx.now, line, reference or first, dict(measures))
    written = {name.value: [one.value, one.sd] for name, one in measures.items()}
    tx.execute(
        sa.insert(golden).values(at=record.at, line=line, reference=record.reference, measures=written)
    )
    return record


def golden_scans(tx: Transaction, line: str, *, limit: int = MOST) -> tuple[GoldenRecord, ...]:
    """The latest of a line, the newest first, and behind them the reference that they are compared with."""
    of_line = sa.select(golden).where(golden.c.line == line).order_by(golden.c.id.desc())
    rows = tx.execute(of_line.limit(fit_limit(limit))).all()
    if rows and not any(row.reference for row in rows):
        rows = [*rows, *tx.execute(of_line.where(golden.c.reference).limit(1))]
    return tuple(
        GoldenRecord(
            row.at,
            row.line,
            row.reference,
            {GoldenMeasure(name): Measured(*pair) for name, pair in row.measures.items()},
        )
        for row in rows
    )
