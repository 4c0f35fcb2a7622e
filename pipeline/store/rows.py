"""Rows of the store's tables as records."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from pipeline.common.part_id import is_part_id
from pipeline.common.record_json import from_json
from pipeline.common.records import (
    EventRecord,
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ReadingRecord,
    ReviewAction,
    ReviewRecord,
    ScanPlanRecord,
)
from pipeline.store.errors import NotFoundError
from pipeline.store.tables import events, evidence, parts, readings, reviews


def select_parts() -> sa.Select[Any]:
    """Parts with their last reading and review, as `part_of` wants them."""
    read = parts.outerjoin(readings, parts.c.reading_id == readings.c.id)
    return sa.select(
        parts,
        readings.c.record.label("read_record"),
        readings.c.at.label("read_at"),
        reviews.c.at.label("review_at"),
        *(reviews.c[name].label(f"review_{name}") for name in _REVIEW),
    ).select_from(read.outerjoin(reviews, parts.c.review_id == reviews.c.id))


_REVIEW = ("action", "before", "after", "who", "token", "note")


def part_of(row: Row[Any]) -> PartRecord:
    """The part of a row of `select_parts`."""
    review = None
    if row.review_id is not None:
        review = ReviewRecord(
            action=ReviewAction(row.review_action),
            **{name: getattr(row, f"review_{name}") for name in _REVIEW[1:]},
            at=row.review_at,
        )
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
        plan=None if row.plan is None else from_json(ScanPlanRecord, row.plan),
        review=review,
    )


def part_by_id(connection: Connection, part_id: str) -> PartRecord:
    """A part.

    Raises:
        NotFoundError: there is none of that id.
    """
    check_id(part_id)
    row = connection.execute(select_parts().where(parts.c.id == part_id)).one_or_none()
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
    return NotFoundError(f"there is no part {part_id[:40]!r}; check the id")


def check_part(connection: Connection, part_id: str) -> None:
    """Check that there is a part.

    Raises:
        NotFoundError: there is none.
    """
    check_id(part_id)
    if connection.execute(sa.select(parts.c.id).where(parts.c.id == part_id)).one_or_none() is None:
        raise no_part(part_id)


def readings_of(connection: Connection, part_id: str) -> tuple[ReadingRecord, ...]:
    """A part's readings, the first one first."""
    rows = connection.execute(
        sa.select(readings.c.record, readings.c.at)
        .where(readings.c.part_id == part_id)
        .order_by(readings.c.id)
    )
    return tuple(_reading(row.record, row.at) for row in rows)


def _reading(record: Any, at: Any) -> ReadingRecord:
    return replace(from_json(ReadingRecord, record), at=at)


def evidence_of(row: Row[Any]) -> EvidenceRecord:
    """The evidence of a row of its table."""
    return EvidenceRecord(
        kind=EvidenceKind(row.kind),
        sha256=row.sha256,
        n_bytes=row.n_bytes,
        name=row.name,
        media_type=row.media_type,
        meta=row.meta,
        at=row.at,
        gone=row.gone,
    )


def evidence_of_part(connection: Connection, part_id: str) -> tuple[EvidenceRecord, ...]:
    """A part's evidence, the first one first."""
    rows = connection.execute(
        sa.select(evidence).where(evidence.c.part_id == part_id).order_by(evidence.c.id)
    )
    return tuple(evidence_of(row) for row in rows)


def reviews_of(connection: Connection, part_id: str) -> tuple[ReviewRecord, ...]:
    """What people said of a part, the first one first."""
    rows = connection.execute(sa.select(reviews).where(reviews.c.part_id == part_id).order_by(reviews.c.id))
    return tuple(
        ReviewRecord(
            action=ReviewAction(row.action),
            before=row.before,
            after=row.after,
            who=row.who,
            token=row.token,
            note=row.note,
            at=row.at,
        )
        for row in rows
    )


def events_of(connection: Connection, part_id: str) -> tuple[EventRecord, ...]:
    """What happened to a part, in order."""
    rows = connection.execute(sa.select(events).where(events.c.part_id == part_id).order_by(events.c.id))
    return tuple(EventRecord(at=row.at, kind=row.kind, data=row.data) for row in rows)
