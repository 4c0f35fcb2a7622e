"""Read, lock and write a part's row with its events and files."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from hashlib import sha256
from types import MappingProxyType
from typing import Any, TypeVar

import sqlalchemy as sa

from pipeline.common.names import folded
from pipeline.common.part_id import is_part_id
from pipeline.common.reading_records import from_json, to_json
from pipeline.common.records import EvidenceRecord, PartRecord, PartState, ReviewAction
from pipeline.store.database import AnyRow, Transaction, json_text
from pipeline.store.errors import MAX_TEXT, ConflictError, NotFoundError
from pipeline.store.outbox import put_in_outbox
from pipeline.store.tables import events, evidence, parts

T = TypeVar("T")
Event = tuple[str, Mapping[str, Any]]
_HEX = re.compile("[^0-9a-f]")
READ, REVIEWED, HALF_REVIEWED, AUDITED = "read", "reviewed", "read_by_person", "audited"


def part_by_id(tx: Transaction, part_id: str, *, lock: bool = False) -> PartRecord:
    """Read a part, and lock it against other writers if wanted."""
    query = sa.select(parts.c.record).where(parts.c.id == _checked(part_id))
    record = tx.execute(query.with_for_update() if lock else query).one_or_none()
    if record is None:
        raise _no_part(part_id)
    return from_json(PartRecord, record.record)


def select_parts(
    tx: Transaction, ids: sa.Select[Any], *, newest_first: bool = False
) -> tuple[PartRecord, ...]:
    """The parts whose ids a query returns, by id."""
    texts = tx.execute(sa.select(parts.c.record).where(parts.c.id.in_(ids))).scalars()
    records = (from_json(PartRecord, record) for record in texts)
    return tuple(sorted(records, key=lambda part: part.id, reverse=newest_first))


def search_columns(part: PartRecord) -> dict[str, Any]:
    """The columns of a part's row that follow from its record."""
    touch, shadow = part.touch, part.shadow
    return {
        "id": part.id,
        "state": part.state,
        "created_at": part.created_at,
        "changed_at": part.changed_at,
        "name_folded": folded(part.name),
        "text_folded": part.text.casefold(),
        "job": part.job,
        "line": part.line,
        "touch_by_stage": None if touch is None else touch.by_stage,
        "touch_until": None if touch is None else touch.until,
        "agreement": None if shadow is None else shadow.agreement,
        "would_be": None if shadow is None else shadow.would_be,
        "rejected": part.reading is not None and part.reading.decision == "reject",
        **_how_right(part),
    }


def _how_right(part: PartRecord) -> dict[str, Any]:
    answer = part.review if part.state is PartState.REVIEWED else None
    if answer is None:
        return {"was_right": None, "characters": None, "characters_right": None}
    if answer.action is ReviewAction.UNREADABLE:
        # the true characters are unknown, so none is counted
        return {"was_right": False, "characters": 0, "characters_right": 0}
    from pipeline.common.texts import align

    read = part.reading.text[: 2 * MAX_TEXT] if part.reading is not None else ""
    wrong = 0 if read == answer.after else sum(not pair.right for pair in align(answer.after, read))
    n = len(answer.after)
    return {"was_right": read == answer.after, "characters": n, "characters_right": max(0, n - wrong)}


def write_part(
    tx: Transaction,
    part: PartRecord,
    new_events: Sequence[Event] = (),
    *,
    targets: Sequence[str] = (),
    new: bool = False,
    figures: Mapping[str, Any] = MappingProxyType({}),
) -> PartRecord:
    """Write a part and its events, and queue it for its targets (not in shadow mode); return it as it is stored. The
    transaction has the part locked unless it is new (ConflictError: it is not); `figures` are further columns."""
    content = to_json(replace(part, changed_at=tx.now))
    record = json_text(content)
    part = from_json(PartRecord, record)
    row = {**search_columns(part), **figures, "record": record}
    if not new:
        tx.execute(sa.update(parts).where(parts.c.id == part.id).values(**row))
    elif not tx.insert_if_new(parts, row):
        raise ConflictError(f"there is a part {part.id} already", hint="take a new id")
    add_events(tx, part.id, new_events)
    payload = record
    if part.state is PartState.REVIEW and targets:
        # a text that awaits a person must not be taken for the serial
        payload = json_text({**content, "text": "", "candidate": part.text})
    put_in_outbox(tx, part.id, targets if part.shadow is None else (), payload)
    return part


def add_events(tx: Transaction, part_id: str, new_events: Sequence[Event]) -> None:
    """Write events of a part, in order."""
    rows = [
        {
            "part_id": part_id,
            "at": tx.now,
            "kind": kind,
            "actor": data["source"] if kind == READ else signature(**data) if kind == HALF_REVIEWED else None,
            "seconds": data["seconds"] if kind == READ else None,
            "data": dict(data),
        }
        for kind, data in new_events
    ]
    if rows:
        tx.execute(sa.insert(events), rows)


def signature(*, who: str, token: str, **_: Any) -> str:
    """Identity of a person: the token, or else the name, however it is spelled."""
    return f"token {folded(token)}" if token else f"name {folded(who)}"


def events_of(tx: Transaction, part_id: str) -> Sequence[AnyRow]:
    """A part's events, in order."""
    query = sa.select(events).where(events.c.part_id == _checked(part_id)).order_by(events.c.id)
    rows = tx.execute(query).all()
    if not rows:  # every part was received
        raise _no_part(part_id)
    return rows


def evidence_of(tx: Transaction, part_id: str) -> tuple[EvidenceRecord, ...]:
    """A part's files in order, also deleted ones."""
    query = sa.select(evidence).where(evidence.c.part_id == _checked(part_id)).order_by(evidence.c.id)
    rows = tx.execute(query).all()
    if not rows:
        part_by_id(tx, part_id)
    return tuple(record_of(EvidenceRecord, row) for row in rows)


def evidence_before(tx: Transaction, when: datetime, limit: int = 200) -> tuple[tuple[str, str], ...]:
    """(part id, hash) of files from before a time that are still kept, oldest first."""
    query = sa.select(evidence.c.part_id, evidence.c.sha256).where(evidence.c.gone.is_(False))
    rows = tx.execute(query.where(evidence.c.at < when).order_by(evidence.c.at, evidence.c.id).limit(limit))
    return tuple((row.part_id, row.sha256) for row in rows)


def evidence_gone(tx: Transaction, part_id: str, sha256: str) -> None:
    """Record that a part's file is no longer kept; nothing happens if it was recorded before."""
    part = part_by_id(tx, part_id, lock=True)
    present_file = sa.and_(
        evidence.c.part_id == part_id, evidence.c.sha256 == sha256, evidence.c.gone.is_(False)
    )
    if kinds := sorted(set(tx.execute(sa.select(evidence.c.kind).where(present_file)).scalars())):
        tx.execute(sa.update(evidence).where(present_file).values(gone=True))
        write_part(tx, part, [("evidence_expired", {"sha256": sha256, "kinds": kinds})])


def needed_hashes(tx: Transaction, hashes: Collection[str]) -> frozenset[str]:
    """Find the hashes whose files are still needed."""
    present = evidence.c.gone.is_(False)
    query = sa.select(evidence.c.sha256).where(evidence.c.sha256.in_(list(hashes)), present)
    return frozenset(tx.execute(query.distinct()).scalars())


def needed_after(tx: Transaction, after: str = "", *, limit: int = 500) -> tuple[str, ...]:
    """Hashes of files that are still needed, in order, from one on."""
    query = sa.select(evidence.c.sha256).where(evidence.c.sha256 > after, evidence.c.gone.is_(False))
    return tuple(tx.execute(query.distinct().order_by(evidence.c.sha256).limit(limit)).scalars())


def claim_evidence_folder(tx: Transaction, identity: str) -> str:
    """Identity of the evidence folder of all services that share a store in PostgreSQL; the first claim sets it."""
    if not tx.postgresql:
        return identity
    tx.execute(sa.text("LOCK TABLE evidence IN SHARE UPDATE EXCLUSIVE MODE"))
    claimed: str | None = tx.execute(sa.text("SELECT obj_description('evidence'::regclass)")).scalar_one()
    if claimed is None:
        tx.execute(sa.text(f"COMMENT ON TABLE evidence IS '{_HEX.sub('', identity)}'"))
    return claimed or identity


def hash_of(text: str) -> str:
    """SHA-256 of a key, or of a token's secret: 256 random bits, which cannot be guessed and need no salt."""
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def record_of(kind: type[T], row: AnyRow) -> T:
    """The record whose fields are columns of a row."""
    return from_json(kind, dict(row._mapping))


def _checked(part_id: str) -> str:
    """The id, if it has the form of one; any other text names no part, and a database may not even hold it."""
    if not is_part_id(part_id):
        raise _no_part(part_id)
    return part_id


def _no_part(part_id: str) -> NotFoundError:
    return NotFoundError(f"there is no part {part_id[:40]!r}", hint="check the id")
