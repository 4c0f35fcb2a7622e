"""What is written of a part, each in one transaction: received, read, reviewed, noted."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from hashlib import sha256
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Connection

from pipeline.common.part_id import is_part_id
from pipeline.common.record_json import to_json
from pipeline.common.records import EvidenceRecord, PartRecord, PartState, ReadingRecord, ScanPlanRecord
from pipeline.store.errors import AlreadyDoneError, ConflictError, UnfitError, cleaned, fit
from pipeline.store.outbox import put_in_outbox
from pipeline.store.rows import check_id, no_part, part_by_id
from pipeline.store.tables import events, evidence, idempotency, parts, readings

_SHA256 = re.compile("[0-9a-f]{64}")
Event = tuple[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Idempotency:
    """How a request that is sent again is known.

    Attributes:
        key: of the request, with whose it is.
        fingerprint: of what it asks for: another one under the same key is another request.
    """

    key: str
    fingerprint: str


@dataclass(frozen=True)
class Reads:
    """What a part's readers and stage have to say at once.

    Attributes:
        state: how far the part has come with it.
        readings: the first one first.
        evidence: files that came or were made.
        plan: what is to be felt, or was felt since.
        targets: where the result is to be published.
    """

    state: PartState
    readings: Sequence[ReadingRecord] = ()
    evidence: Sequence[EvidenceRecord] = ()
    plan: ScanPlanRecord | None = None
    targets: Sequence[str] = ()


def add_part(
    connection: Connection,
    now: datetime,
    *,
    part_id: str,
    name: str,
    expected: str,
    database: str,
    reads: Reads,
    request: Idempotency | None,
) -> PartRecord:
    """Receive a part; see `pipeline.store.store.Store.add_part`."""
    if not is_part_id(part_id):
        raise UnfitError(f"{part_id[:40]!r} is no id of a part; take one of new_part_id")
    _refuse_if_done(connection, request)
    row = {
        "id": part_id,
        "name": fit(name, "the name"),
        "name_folded": name.casefold(),
        "text": "",
        "text_folded": "",
        "expected": fit(expected, "the text expected"),
        "database": fit(database, "the name of the database"),
        "state": reads.state,
        "created_at": now,
        "changed_at": now,
        "fell_back": False,
        "by_camera": False,
        "rejected": False,
    }
    if not _insert_if_new(connection, parts, row):
        raise ConflictError(f"there is a part {part_id} already; take a new id")
    _claim(connection, now, request, part_id)
    add_events(
        connection,
        now,
        part_id,
        [("received", {"name": name, "expected": expected, "database": database})],
    )
    return _add(connection, now, part_id, reads)


def add_readings(
    connection: Connection, now: datetime, part_id: str, *, reads: Reads, request: Idempotency | None
) -> PartRecord:
    """Add to a part; see `pipeline.store.store.Store.add_readings`."""
    lock_part(connection, part_id)
    _refuse_if_done(connection, request)
    part = part_by_id(connection, part_id)
    if part.state is PartState.REVIEWED:
        who = part.review.who if part.review is not None else "somebody"
        raise ConflictError(
            f"part {part_id} was reviewed by {who} meanwhile; correct the review if it is wrong"
        )
    _claim(connection, now, request, part_id)
    return _add(connection, now, part_id, reads)


def note_event(
    connection: Connection, now: datetime, part_id: str, kind: str, data: Mapping[str, Any]
) -> None:
    """Note that something happened to a part."""
    lock_part(connection, part_id)
    add_events(connection, now, part_id, [(fit(kind, "the kind of the event", limit=32), data)])
    connection.execute(sa.update(parts).where(parts.c.id == part_id).values(changed_at=now))


def lock_part(connection: Connection, part_id: str) -> None:
    """Keep every other writer from a part until the transaction ends.

    A statement of its own: PostgreSQL would join the row that it waited for with readings of before the wait.

    Raises:
        NotFoundError: there is no such part.
    """
    check_id(part_id)
    locked = sa.select(parts.c.id).where(parts.c.id == part_id).with_for_update()
    if connection.execute(locked).one_or_none() is None:
        raise no_part(part_id)


def add_events(connection: Connection, now: datetime, part_id: str, happened: Sequence[Event]) -> None:
    """Write down what happened, in order."""
    rows = [{"part_id": part_id, "at": now, "kind": kind, "data": dict(data)} for kind, data in happened]
    if rows:
        connection.execute(sa.insert(events), rows)


def remembered(connection: Connection, key: str) -> tuple[str, str] | None:
    """(fingerprint, part id) of what was done under a key."""
    row = connection.execute(
        sa.select(idempotency.c.fingerprint, idempotency.c.part_id).where(
            idempotency.c.key_hash == _hash(key)
        )
    ).one_or_none()
    return None if row is None else (row.fingerprint, row.part_id)


def forget_keys(connection: Connection, before: datetime) -> int:
    """Remove keys of before a time, and say how many."""
    return connection.execute(sa.delete(idempotency).where(idempotency.c.at < before)).rowcount


def _add(connection: Connection, now: datetime, part_id: str, reads: Reads) -> PartRecord:
    touch_needed = reads.state is PartState.TOUCH_NEEDED
    changes: dict[str, Any] = {"state": reads.state, "changed_at": now, "plan": None}
    if touch_needed and reads.plan is not None:
        changes["plan"] = to_json(reads.plan)
    if touch_needed or reads.plan is not None:
        changes["fell_back"] = True
    for reading in reads.readings:
        changes["reading_id"] = _insert_reading(connection, now, part_id, reading)
    if reads.readings:
        last = reads.readings[-1]
        changes["text"] = cleaned(last.text)
        changes["text_folded"] = changes["text"].casefold()
        changes["by_camera"] = reads.state is PartState.ACCEPTED and last.source == "vision"
        changes["rejected"] = last.decision == "reject"
    connection.execute(sa.update(parts).where(parts.c.id == part_id).values(**changes))
    for file in reads.evidence:
        connection.execute(sa.insert(evidence).values(part_id=part_id, **_evidence_row(now, file)))
    add_events(connection, now, part_id, _events(reads))
    part = part_by_id(connection, part_id)
    if not touch_needed:
        put_in_outbox(connection, now, part, reads.targets)
    return part


def _events(reads: Reads) -> list[Event]:
    happened: list[Event] = [
        ("read", {"source": r.source, "text": r.text, "decision": r.decision, "confidence": r.confidence})
        for r in reads.readings
    ]
    if reads.plan is not None:
        # what came after the camera's reading was felt because of it
        felt = [k for k, r in enumerate(reads.readings) if r.source != "vision"]
        place = felt[0] if felt else len(happened)
        happened.insert(place, ("touch_needed", {"reason": reads.plan.reason, "seconds": reads.plan.seconds}))
    elif reads.state is PartState.TOUCH_NEEDED:
        happened.append(("touch_needed", {}))
    return happened


def _insert_reading(connection: Connection, now: datetime, part_id: str, reading: ReadingRecord) -> int:
    made = connection.execute(
        sa.insert(readings).values(
            part_id=part_id,
            at=now,
            source=reading.source,
            text=cleaned(reading.text),
            decision=reading.decision,
            confidence=reading.confidence,
            seconds=reading.seconds,
            record=to_json(replace(reading, at=None)),
        )
    )
    key = made.inserted_primary_key
    assert key is not None
    return int(key[0])


def _evidence_row(now: datetime, file: EvidenceRecord) -> dict[str, Any]:
    if _SHA256.fullmatch(file.sha256) is None:
        raise UnfitError(f"{file.sha256[:80]!r} is no SHA-256; give 64 hexadecimal digits in lower case")
    return {
        "at": now,
        "kind": file.kind,
        "sha256": file.sha256,
        "n_bytes": file.n_bytes,
        "name": cleaned(file.name),
        "media_type": cleaned(file.media_type),
        "meta": dict(file.meta),
        "gone": file.gone,
    }


def _refuse_if_done(connection: Connection, request: Idempotency | None) -> None:
    done = None if request is None else remembered(connection, request.key)
    if done is not None:
        raise AlreadyDoneError(part_id=done[1], fingerprint=done[0])


def _claim(connection: Connection, now: datetime, request: Idempotency | None, part_id: str) -> None:
    if request is None:
        return
    row = {
        "key_hash": _hash(request.key),
        "fingerprint": fit(request.fingerprint, "the fingerprint"),
        "part_id": part_id,
        "at": now,
    }
    # waits for a racing request with that key until it is known whether it has been done
    if not _insert_if_new(connection, idempotency, row):
        _refuse_if_done(connection, request)


def _insert_if_new(connection: Connection, table: sa.Table, row: Mapping[str, Any]) -> bool:
    insert = postgresql.insert if connection.dialect.name == "postgresql" else sqlite.insert
    asked = insert(table).values(**row).on_conflict_do_nothing().returning(*table.primary_key)
    return connection.execute(asked).one_or_none() is not None


def _hash(key: str) -> str:
    return sha256(key.encode("utf-8", "surrogatepass")).hexdigest()
