"""Rows of the store's tables as records."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Row

from pipeline.common.part_id import is_part_id
from pipeline.common.reading_records import ReadingRecord, ScanPlanRecord, from_json
from pipeline.common.records import (
    Agreement,
    EventRecord,
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ReviewAction,
    ReviewRecord,
    ShadowRecord,
    TouchWait,
)
from pipeline.store.database import Transaction
from pipeline.store.errors import NotFoundError
from pipeline.store.tables import events, evidence, parts, readings, reviews


def select_parts() -> sa.Select[Any]:
    """Parts with their last reading and review, as `part_of` wants them."""
    read = parts.outerjoin(readings, parts.c.reading_id == readings.c.id)
    return sa.select(
        parts,
        readings.c.record.label("read_record"),
        readings.c.at.label("read_at"),
        *(reviews.c[name].label(f"review_{name}") for name in _REVIEW),
    ).select_from(read.outerjoin(reviews, parts.c.review_id == reviews.c.id))


_REVIEW = ("action", "before", "after", "who", "token", "note", "at")


def part_of(row: Row[Any]) -> PartRecord:
    """The part of a row of `select_parts`."""
    return PartRecord(
        id=row.id,
        name=row.name,
        state=PartState(row.state),
        text=row.text,
        created_at=row.created_at,
        changed_at=row.changed_at,
        reading=None if row.read_record is None else _reading(row.read_record, row.read_at),
        expected=row.expected,
        database=row.database,
        job=row.job or "",
        line=row.line or "",
        plan=None if row.plan is None else from_json(ScanPlanRecord, row.plan),
        touch=TouchWait(bool(row.touch_by_stage), row.touch_until)
        if row.state == PartState.TOUCH_NEEDED
        else None,
        review=None if row.review_id is None else review_of(row, "review_"),
        shadow=None
        if row.agreement is None
        else ShadowRecord(Agreement(row.agreement), PartState(row.would_be)),
    )


def part_by_id(tx: Transaction, part_id: str) -> PartRecord:
    """A part as it stands.

    Raises:
        NotFoundError: there is none of that id.
    """
    check_id(part_id)
    row = tx.execute(select_parts().where(parts.c.id == part_id)).one_or_none()
    if row is None:
        raise no_part(part_id)
    return part_of(row)


def check_id(part_id: str) -> None:
    """Check that a part may have that id.

    Raises:
        NotFoundError: it has not the form of one.
    """
    if not is_part_id(part_id):
        raise no_part(part_id)


def no_part(part_id: str) -> NotFoundError:
    """What to raise where a part is asked for that is not there."""
    return NotFoundError(f"there is no part {part_id[:40]!r}", hint="check the id")


def readings_of(tx: Transaction, part_id: str) -> tuple[ReadingRecord, ...]:
    """A part's readings, the first one first."""
    return tuple(_reading(row.record, row.at) for row in _rows_of(tx, part_id, readings))


def evidence_of(tx: Transaction, part_id: str) -> tuple[EvidenceRecord, ...]:
    """A part's files, the first one first, also those that are gone."""
    return tuple(evidence_record(row) for row in _rows_of(tx, part_id, evidence))


def reviews_of(tx: Transaction, part_id: str) -> tuple[ReviewRecord, ...]:
    """What people said of a part, the first one first."""
    return tuple(review_of(row) for row in _rows_of(tx, part_id, reviews))


def events_of(tx: Transaction, part_id: str) -> tuple[EventRecord, ...]:
    """What happened to a part, in order."""
    return tuple(EventRecord(row.at, row.kind, row.data) for row in _rows_of(tx, part_id, events))


def _rows_of(tx: Transaction, part_id: str, table: sa.Table) -> list[Row[Any]]:
    """A part's rows in a table, in the order they were written.

    Raises:
        NotFoundError: there is no such part.
    """
    check_id(part_id)
    if tx.execute(sa.select(parts.c.id).where(parts.c.id == part_id)).one_or_none() is None:
        raise no_part(part_id)
    return list(tx.execute(sa.select(table).where(table.c.part_id == part_id).order_by(table.c.id)))


def _reading(record: Any, at: Any) -> ReadingRecord:
    return replace(from_json(ReadingRecord, record), at=at)


def review_of(row: Row[Any], prefix: str = "") -> ReviewRecord:
    """The review of a row whose columns bear that prefix."""
    values = {name: getattr(row, prefix + name) for name in _REVIEW}
    return ReviewRecord(**{**values, "action": ReviewAction(values["action"])})


def evidence_record(row: Row[Any]) -> EvidenceRecord:
    """The file of a row of its table."""
    values = {field.name: getattr(row, field.name) for field in fields(EvidenceRecord)}
    return EvidenceRecord(**{**values, "kind": EvidenceKind(row.kind)})
