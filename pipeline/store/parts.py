"""What is written of a part, each in one transaction: received, read, reviewed, noted."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import sqlalchemy as sa

from pipeline.common.part_id import is_part_id
from pipeline.common.reading_records import ReadingRecord, ScanPlanRecord, to_json
from pipeline.common.records import EvidenceRecord, PartRecord, PartState, ShadowRecord, TouchWait
from pipeline.common.serial_rules import SerialRules
from pipeline.store import tables
from pipeline.store.database import Transaction
from pipeline.store.errors import ConflictError, UnfitError, cleaned, fit
from pipeline.store.idempotency import IdempotencyKey, claim, refuse_if_done
from pipeline.store.outbox import put_in_outbox
from pipeline.store.rows import check_id, no_part, part_by_id
from pipeline.store.serials import ask_alone, objections, with_objections
from pipeline.store.tables import events, parts

_SHA256 = re.compile("[0-9a-f]{64}")
Event = tuple[str, Mapping[str, Any]]
ANY_SERIAL = SerialRules()


def add_part(
    tx: Transaction,
    *,
    part_id: str,
    name: str,
    state: PartState,
    readings: Sequence[ReadingRecord] = (),
    evidence: Sequence[EvidenceRecord] = (),
    expected: str = "",
    database: str = "",
    job: str = "",
    line: str = "",
    plan: ScanPlanRecord | None = None,
    touch: TouchWait | None = None,
    not_felt: str = "",
    targets: Sequence[str] = (),
    idempotency: IdempotencyKey | None = None,
    shadow: ShadowRecord | None = None,
    audit: bool = False,
    rules: SerialRules = ANY_SERIAL,
) -> PartRecord:
    """Receive a part with what was read of it.

    Args:
        tx: the transaction.
        part_id: from `pipeline.common.part_id.new_part_id`.
        name: what the line calls it.
        state: how far it has come.
        readings: the first one first; the last one counts.
        evidence: files that are kept already.
        expected: text it should read.
        database: glyph database asked for.
        job: that it was read by.
        line: that it comes from.
        plan: what to scan; with a reading by touch it says that the part was scanned because of it.
        touch: with TOUCH_NEEDED, how it waits.
        not_felt: why a part of which the camera is unsure is not felt.
        targets: where the result is published, also that touch is needed.
        idempotency: of the request.
        shadow: what came of it in shadow mode.
        audit: have a person read it as well, if it is accepted.
        rules: what is asked of its serial, if it is accepted; where something speaks against that, a person gets it.

    Raises:
        AlreadyDoneError: the key is taken.
        ConflictError: the id is taken.
    """
    if not is_part_id(part_id):
        raise UnfitError(f"{part_id[:40]!r} is not a part's id", hint="take one of new_part_id")
    if rules.any:
        ask_alone(tx)
    refuse_if_done(tx, idempotency)
    row = {
        "id": part_id,
        "name": fit(name, "the name"),
        "name_folded": name.casefold(),
        "text": "",
        "text_folded": "",
        "expected": fit(expected, "the text expected"),
        "database": fit(database, "the name of the database"),
        "job": fit(job, "the name of the job"),
        "line": fit(line, "the name of the line"),
        "state": state,
        "created_at": tx.now,
        "changed_at": tx.now,
        "fell_back": False,
        "by_camera": False,
        "rejected": False,
    }
    if not tx.insert_if_new(parts, row):
        raise ConflictError(f"there is a part {part_id} already", hint="take a new id")
    claim(tx, idempotency, part_id)
    given = {"name": name, "expected": expected, "database": database, "job": job, "line": line}
    add_events(tx, part_id, [("received", given)])
    if state is PartState.TOUCH_NEEDED and touch is not None:
        waits = {"touch_by_stage": touch.by_stage, "touch_until": touch.until}
        tx.execute(sa.update(parts).where(parts.c.id == part_id).values(**waits))
    after = (("not_felt", {"why": not_felt}),) if not_felt else ()
    asked = plan is not None
    return _add(
        tx,
        part_id,
        state,
        readings,
        evidence,
        plan,
        targets,
        shadow,
        asked=asked,
        after=after,
        audit=audit,
        rules=rules,
    )


def add_readings(
    tx: Transaction,
    part_id: str,
    *,
    readings: Sequence[ReadingRecord],
    state: PartState,
    plan: ScanPlanRecord | None = None,
    evidence: Sequence[EvidenceRecord] = (),
    targets: Sequence[str] = (),
    idempotency: IdempotencyKey | None = None,
    shadow: ShadowRecord | None = None,
    audit: bool = False,
    rules: SerialRules = ANY_SERIAL,
) -> PartRecord:
    """Add what was read of a part later; arguments as `add_part`.

    Raises:
        AlreadyDoneError: the key is taken.
        ConflictError: the part was reviewed meanwhile.
    """
    if rules.any:
        ask_alone(tx)
    lock_part(tx, part_id)
    refuse_if_done(tx, idempotency)
    part = part_by_id(tx, part_id)
    if part.state is PartState.REVIEWED:
        who = part.review.who if part.review is not None else "somebody"
        raise ConflictError(
            f"part {part_id} was reviewed by {who} meanwhile", hint="correct the review if it is wrong"
        )
    claim(tx, idempotency, part_id)
    asked = plan is not None or part.plan is not None
    return _add(
        tx, part_id, state, readings, evidence, plan, targets, shadow, asked=asked, audit=audit, rules=rules
    )


def note_event(tx: Transaction, part_id: str, kind: str, data: Mapping[str, Any]) -> None:
    """Note that something happened to a part."""
    lock_part(tx, part_id)
    add_events(tx, part_id, [(fit(kind, "the kind of the event", limit=32), data)])
    tx.execute(sa.update(parts).where(parts.c.id == part_id).values(changed_at=tx.now))


def lock_part(tx: Transaction, part_id: str) -> None:
    """Keep every other writer from a part until the transaction ends.

    A statement of its own: PostgreSQL would join the row that it waited for with readings of before the wait.

    Raises:
        NotFoundError: there is no such part.
    """
    check_id(part_id)
    locked = sa.select(parts.c.id).where(parts.c.id == part_id).with_for_update()
    if tx.execute(locked).one_or_none() is None:
        raise no_part(part_id)


def add_events(tx: Transaction, part_id: str, happened: Sequence[Event]) -> None:
    """Write down what happened, in order; with it, all that the transaction writes of the part is sealed."""
    tx.written.add(part_id)
    rows = [{"part_id": part_id, "at": tx.now, "kind": kind, "data": dict(data)} for kind, data in happened]
    if rows:
        tx.execute(sa.insert(events), rows)


def _add(
    tx: Transaction,
    part_id: str,
    state: PartState,
    readings: Sequence[ReadingRecord],
    evidence: Sequence[EvidenceRecord],
    plan: ScanPlanRecord | None,
    targets: Sequence[str],
    shadow: ShadowRecord | None,
    *,
    asked: bool,
    audit: bool,
    rules: SerialRules,
    after: Sequence[Event] = (),
) -> PartRecord:
    if state is PartState.ACCEPTED and readings and rules.any:
        state, readings, alarms = _among_serials(tx, part_id, readings, rules)
        after = (*after, *alarms)
    touch_needed = state is PartState.TOUCH_NEEDED
    felt = any(reading.source != "vision" for reading in readings)
    changes: dict[str, Any] = {"state": state, "changed_at": tx.now, "plan": None}
    if plan is not None and not felt:
        changes["plan"] = to_json(plan)
    if touch_needed or (asked and felt):
        changes["fell_back"] = True
    for reading in readings:
        changes["reading_id"] = _insert_reading(tx, part_id, reading)
    if readings:
        last = readings[-1]
        changes |= text_columns("" if touch_needed else last.text)
        changes["by_camera"] = state is PartState.ACCEPTED and last.source == "vision"
        changes["rejected"] = last.decision == "reject"
    if shadow is not None:
        changes |= {"agreement": shadow.agreement, "would_be": shadow.would_be}
    tx.execute(sa.update(parts).where(parts.c.id == part_id).values(**changes))
    for file in evidence:
        tx.execute(sa.insert(tables.evidence).values(part_id=part_id, at=tx.now, **_evidence_row(file)))
    add_events(tx, part_id, [*_events(state, readings, plan, shadow), *after])
    if audit and state is PartState.ACCEPTED:
        # nothing is said of it in the history, which whoever audits it may look at
        tx.insert_if_new(tables.audits, {"part_id": part_id, "at": tx.now})
    part = part_by_id(tx, part_id)
    put_in_outbox(tx, part, targets)
    return part


def _among_serials(
    tx: Transaction, part_id: str, readings: Sequence[ReadingRecord], rules: SerialRules
) -> tuple[PartState, Sequence[ReadingRecord], list[Event]]:
    """Where a part goes that is read surely, by its serial among the others; and what happened."""
    *before, last = readings
    part = part_by_id(tx, part_id)
    against = objections(tx, rules, part_id, cleaned(last.text), name=part.name, line=part.line, job=part.job)
    if not against:
        return PartState.ACCEPTED, readings, []
    for one in against:
        if one.of:  # of two that bear one serial either may be the wrong one
            lock_part(tx, one.of)
            add_events(tx, one.of, [("serial_again", {"part": part_id, "text": last.text})])
    alarms: list[Event] = [("serial_alarm", {"alarm": one.alarm, "why": one.why}) for one in against]
    return PartState.REVIEW, (*before, with_objections(last, against)), alarms


def text_columns(text: str) -> dict[str, str]:
    """The serial as it stands, and as it is searched."""
    text = cleaned(text)
    return {"text": text, "text_folded": text.casefold()}


def _events(
    state: PartState,
    readings: Sequence[ReadingRecord],
    plan: ScanPlanRecord | None,
    shadow: ShadowRecord | None,
) -> list[Event]:
    happened: list[Event] = [
        ("read", {"source": r.source, "text": r.text, "decision": r.decision, "confidence": r.confidence})
        for r in readings
    ]
    if plan is not None:
        # what came after the camera's reading was scanned because of it
        by_touch = [k for k, r in enumerate(readings) if r.source != "vision"]
        place = by_touch[0] if by_touch else len(happened)
        happened.insert(place, ("touch_needed", {"reason": plan.reason, "seconds": plan.seconds}))
    elif state is PartState.TOUCH_NEEDED:
        happened.append(("touch_needed", {}))
    if shadow is not None:
        happened.append(("compared", {"agreement": shadow.agreement, "would_be": shadow.would_be}))
    return happened


def _insert_reading(tx: Transaction, part_id: str, reading: ReadingRecord) -> int:
    made = tx.execute(
        sa.insert(tables.readings).values(
            part_id=part_id,
            at=tx.now,
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


def _evidence_row(file: EvidenceRecord) -> dict[str, Any]:
    if _SHA256.fullmatch(file.sha256) is None:
        raise UnfitError(
            f"{file.sha256[:80]!r} is not an SHA-256", hint="give 64 hexadecimal digits in lower case"
        )
    return {
        "kind": file.kind,
        "sha256": file.sha256,
        "n_bytes": file.n_bytes,
        "name": cleaned(file.name),
        "media_type": cleaned(file.media_type),
        "meta": dict(file.meta),
        "gone": file.gone,
    }
