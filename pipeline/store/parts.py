"""Writes of a part, each in one transaction: received, read, waiting for touch, noted.

Idempotency keys: a request that is sent again, or a run that is given again, is carried out once.

* A key is written in the transaction that writes the part it made. Of requests with one key that race, the database
  lets one through; the others wait for it and raise AlreadyDoneError.
* A fingerprint of the request is kept with its key, and the caller compares.
* Keys of requests are kept until `forget_keys`, keys of files as long as `renew_keys` finds the files, and a while
  longer, and keys of runs for ever.

Serials are checked in the same transaction; on PostgreSQL the check takes a lock of its own until it ends.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, NamedTuple, Required, TypedDict, Unpack

import sqlalchemy as sa

from pipeline.common.part_id import is_part_id
from pipeline.common.reading_records import ReadingRecord, ScanPlanRecord, to_json
from pipeline.common.records import EvidenceRecord, PartRecord, PartState, ShadowRecord, TouchWait
from pipeline.common.serial_rules import (
    ANY_SERIAL,
    WINDOW,
    Objection,
    SerialAlarm,
    SerialRules,
    with_objection,
)
from pipeline.store import tables
from pipeline.store.database import Transaction
from pipeline.store.errors import (
    MAX_ROWS,
    AlreadyDoneError,
    ConflictError,
    UnfitError,
    cleaned,
    fit,
)
from pipeline.store.rows import READ, Event, add_events, hash_of, part_by_id, write_part
from pipeline.store.tables import idempotency as keys
from pipeline.store.tables import parts

AUDIT_WAITS = "waiting"
_SHA256 = re.compile("[0-9a-f]{64}")
# begins the fingerprint of a key of a run or of files; those of requests are hexadecimal
_LASTING_KEY = "kept "
_OF_FILES = f"{_LASTING_KEY}files"
_LOCK = 0x5E81A1
# number of parts among which those read with certainty are searched
_LOOKED_BACK = 4 * WINDOW
_WITH_SERIAL = (PartState.ACCEPTED, PartState.REVIEWED)
_NAME, _TEXT = parts.c.record["name"].as_string(), parts.c.record["text"].as_string()
_READ, _DECISION = (parts.c.record["reading", name].as_string() for name in ("text", "decision"))


class Added(TypedDict, total=False):
    """Data added to a part in one transaction."""

    state: Required[PartState]
    readings: Sequence[ReadingRecord]  # the last one counts
    evidence: Sequence[EvidenceRecord]
    # to scan; with a reading by touch it says that the part was scanned because of it
    plan: ScanPlanRecord | None
    touch: TouchWait  # way in which a new part waits, with TOUCH_NEEDED
    not_felt: str  # reason why a new part is not felt though the camera is unsure
    targets: Sequence[str]  # to publish to, also that touch is needed
    idempotency: IdempotencyKey | None
    shadow: ShadowRecord | None
    audit: bool  # have a person read it as well, if it is accepted
    rules: SerialRules  # checks of its serial, if it is accepted; a failed one sends it to review


def add_part(
    tx: Transaction,
    *,
    part_id: str,
    name: str,
    expected: str = "",
    database: str = "",
    job: str = "",
    line: str = "",
    **added: Unpack[Added],
) -> PartRecord:
    """Add a part (id: `new_part_id`) and its readings. Raises AlreadyDoneError, ConflictError: key or id is taken."""
    if not is_part_id(part_id):
        raise UnfitError(f"{part_id[:40]!r} is not a part's id", hint="take one of new_part_id")
    received: dict[str, Any] = {
        "name": fit(name, "the name"),
        "expected": fit(expected, "the text expected"),
        "database": fit(database, "the name of the database"),
        "job": fit(job, "the name of the job"),
        "line": fit(line, "the name of the line"),
    }
    lock_serials(tx, added.get("rules", ANY_SERIAL))
    times: dict[str, Any] = {"created_at": tx.now, "changed_at": tx.now}
    part = PartRecord(
        id=part_id, state=added["state"], text="", touch=added.get("touch"), **times, **received
    )
    part, new_events, changed = _read(tx, replace(part, not_felt=added.get("not_felt", "")), added)
    new_events = [("received", received), *new_events]
    if part.not_felt:
        new_events.append(("not_felt", {"why": part.not_felt}))
    figures = {"fell_back": False, "by_camera": False, **changed}
    part = write_part(tx, part, new_events, targets=added.get("targets", ()), new=True, figures=figures)
    _keep_files(tx, part_id, added.get("evidence", ()))
    _claim_key(tx, added.get("idempotency"), part_id)
    return part


def add_readings(tx: Transaction, part_id: str, **added: Unpack[Added]) -> PartRecord:
    """Add later readings of a part. Raises AlreadyDoneError: the key is taken. ConflictError: it was reviewed."""
    lock_serials(tx, added.get("rules", ANY_SERIAL))
    part = part_by_id(tx, part_id, lock=True)
    _claim_key(tx, added.get("idempotency"), part_id)
    if part.state is PartState.REVIEWED:
        who = part.review.who if part.review is not None else "somebody"
        raise ConflictError(f"part {part_id} was reviewed by {who} meanwhile", hint="correct the review")
    part, new_events, figures = _read(tx, replace(part, state=added["state"]), added)
    if part.state is not PartState.ACCEPTED:  # nothing is left to audit
        figures["audit"] = sa.func.nullif(parts.c.audit, AUDIT_WAITS)
    _keep_files(tx, part_id, added.get("evidence", ()))
    return write_part(tx, part, new_events, targets=added.get("targets", ()), figures=figures)


def note_event(tx: Transaction, part_id: str, kind: str, data: Mapping[str, Any]) -> None:
    """Add an event to a part."""
    part = part_by_id(tx, part_id, lock=True)
    write_part(tx, part, [(fit(kind, "the kind of the event", limit=32), data)])


def _read(tx: Transaction, part: PartRecord, added: Added) -> tuple[PartRecord, list[Event], dict[str, Any]]:
    plan, shadow, rules = added.get("plan"), added.get("shadow"), added.get("rules", ANY_SERIAL)
    readings = [replace(reading, at=tx.now) for reading in added.get("readings", ())]
    alarms: list[Event] = []
    if part.state is PartState.ACCEPTED and readings and rules.any:
        last = readings[-1]
        for objection in objections(tx, rules, replace(part, text=cleaned(last.text))):
            part = replace(part, state=PartState.REVIEW)
            readings[-1] = with_objection(readings[-1], objection)
            alarms.append(_alarm(objection))
            if objection.of:  # of two parts with one serial either may be the wrong one
                part_by_id(tx, objection.of, lock=True)
                add_events(tx, objection.of, [("serial_again", {"part": part.id, "text": last.text})])
    waits, by_touch = part.state is PartState.TOUCH_NEEDED, [r.source != "vision" for r in readings]
    new_events: list[Event] = [(READ, to_json(reading)) for reading in readings]
    if plan is not None or waits:
        # scans came after the camera's reading, because of it
        why = {} if plan is None else {"reason": plan.reason, "seconds": plan.seconds}
        place = by_touch.index(True) if True in by_touch else len(new_events)
        new_events.insert(place, ("touch_needed", why))
    if shadow is not None:
        new_events.append(("compared", to_json(shadow)))
    figures: dict[str, Any] = {}
    if waits or (any(by_touch) and (plan is not None or part.plan is not None)):
        figures["fell_back"] = True
    if added.get("audit") and part.state is PartState.ACCEPTED:
        # not written to the history, because the auditor may look at it
        figures["audit"] = AUDIT_WAITS
    touch = part.touch or TouchWait(False, None) if waits else None
    part = replace(part, plan=None if any(by_touch) else plan, touch=touch, shadow=shadow or part.shadow)
    part = replace(part, not_felt="" if any(by_touch) else part.not_felt)
    if readings:
        last = readings[-1]
        part = replace(part, reading=last, text="" if waits else last.text)
        figures["by_camera"] = part.state is PartState.ACCEPTED and last.source == "vision"
    return part, [*new_events, *alarms], figures


def _keep_files(tx: Transaction, part_id: str, files: Sequence[EvidenceRecord]) -> None:
    for file in files:
        if _SHA256.fullmatch(file.sha256) is None:
            raise UnfitError(f"{file.sha256[:80]!r} is not an SHA-256", hint="give 64 digits 0-9, a-f")
        texts = {"name": cleaned(file.name), "media_type": cleaned(file.media_type)}
        row = {**vars(file), **texts, "meta": dict(file.meta), "part_id": part_id, "at": tx.now}
        tx.execute(sa.insert(tables.evidence), row)


# ---- parts that wait for touch


class Waiting(NamedTuple):
    """A part that waits for touch, until its time limit; `by_stage` if the stage of its line is to feel it."""

    part_id: str
    changed_at: datetime
    until: datetime | None
    by_stage: bool | None
    line: str


def waiting_for_touch(tx: Transaction, *, limit: int = MAX_ROWS) -> tuple[Waiting, ...]:
    """All parts that wait for touch by the stage or the sender, oldest first."""
    columns = (parts.c.id, parts.c.changed_at, parts.c.touch_until, parts.c.touch_by_stage, parts.c.line)
    query = sa.select(*columns).where(parts.c.state == PartState.TOUCH_NEEDED)
    return tuple(Waiting(*row) for row in tx.execute(query.order_by(parts.c.id).limit(limit)))


def give_up_touch(tx: Transaction, part_id: str, *, why: str, targets: Sequence[str] = ()) -> PartRecord:
    """Send a part that was not felt to review; a scan may still come. Raises ConflictError: it does not wait."""
    part = part_by_id(tx, part_id, lock=True)
    if part.state is not PartState.TOUCH_NEEDED:
        what = f"the part {part_id} does not wait for touch; it is {part.state.value}"
        raise ConflictError(what, hint="look at it again")
    text = part.text if part.reading is None else part.reading.text
    part = replace(part, state=PartState.REVIEW, text=text, touch=None, not_felt=cleaned(why))
    return write_part(tx, part, [("not_felt", {"why": why})], targets=targets)


# ---- idempotency keys


@dataclass(frozen=True)
class IdempotencyKey:
    """Key by which a repeated request is recognised."""

    key: str  # of the request, with its caller
    fingerprint: str  # hash of its content: another one under the same key is another request
    # keys of its files, which stand for its part from then on; one that stands for another part stays with it
    files: tuple[str, ...] = ()

    @classmethod
    def of_run(cls, run: str, part: str, digest: str) -> IdempotencyKey:
        """The key of a part of a run; `run` hashes what all readings depend on, `digest` what the part's files hold."""
        return cls(f"run {run} {digest} {part}", f"{_LASTING_KEY}{digest}")

    @classmethod
    def of_files(cls, files: Iterable[str]) -> IdempotencyKey:
        """The key of a part that is read from files, from their keys, so that it is read from them only once."""
        files = tuple(files)
        return cls("|".join(files), _OF_FILES, files)


def find_request(tx: Transaction, key: str) -> tuple[str, str] | None:
    """(fingerprint, part id) of the request with that idempotency key; None if there was none."""
    query = sa.select(keys.c.fingerprint, keys.c.part_id).where(keys.c.key_hash == hash_of(key))
    row = tx.execute(query).one_or_none()
    return None if row is None else (row.fingerprint, row.part_id)


def known_keys(tx: Transaction, files: Iterable[str]) -> frozenset[str]:
    """Those of the keys that already belong to a part."""
    hashes = {hash_of(key): key for key in files}
    wanted, present = list(hashes), list[str]()
    for k in range(0, len(wanted), MAX_ROWS):
        some = keys.c.key_hash.in_(wanted[k : k + MAX_ROWS])
        present += tx.execute(sa.select(keys.c.key_hash).where(some)).scalars()
    return frozenset(hashes[key_hash] for key_hash in present)


def renew_keys(tx: Transaction, present: Iterable[str], *, before: datetime) -> None:
    """Renew the keys of files that are still there, if they were last renewed before a time."""
    hashes = [hash_of(key) for key in present]
    for k in range(0, len(hashes), MAX_ROWS):
        old = sa.and_(keys.c.key_hash.in_(hashes[k : k + MAX_ROWS]), keys.c.at < before)
        tx.execute(sa.update(keys).where(old).values(at=tx.now))


def forget_keys(tx: Transaction, before: datetime, *, files_before: datetime | None = None) -> int:
    """Delete keys of requests from before a time, and of files renewed before another; return their number."""
    old = sa.and_(keys.c.at < before, keys.c.fingerprint.not_like(f"{_LASTING_KEY}%"))
    if files_before is not None:
        old = sa.or_(old, sa.and_(keys.c.at < files_before, keys.c.fingerprint == _OF_FILES))
    return tx.execute(sa.delete(keys).where(old)).rowcount


def _claim_key(tx: Transaction, key: IdempotencyKey | None, part_id: str) -> None:
    if key is None:
        return
    fingerprint = fit(key.fingerprint, "the fingerprint")
    row = {"key_hash": hash_of(key.key), "fingerprint": fingerprint, "part_id": part_id, "at": tx.now}
    if not tx.insert_if_new(keys, row) and (done := find_request(tx, key.key)) is not None:
        raise AlreadyDoneError(part_id=done[1], fingerprint=done[0])
    for file in key.files:
        tx.insert_if_new(keys, row | {"key_hash": hash_of(file)})


# ---- checks of serials against the parts in the store


def lock_serials(tx: Transaction, rules: SerialRules) -> None:
    """Let one transaction at a time check serials. Call it before a part is locked, or two may wait for each other."""
    if rules.any and tx.postgresql:
        tx.execute(sa.select(sa.func.pg_advisory_xact_lock(_LOCK)))


def objections(tx: Transaction, rules: SerialRules, part: PartRecord) -> tuple[Objection, ...]:
    """Objections to the serial of a part read with certainty; one read again under its name is no duplicate."""
    possible = [rules.by_order(part.text)]
    if rules.duplicates:
        possible.append(_read_before(tx, part))
    if rules.jump:
        possible.append(rules.by_place(part.text, _before(tx, part)))
    return tuple(objection for objection in possible if objection is not None)


def _read_before(tx: Transaction, part: PartRecord) -> Objection | None:
    same_serial = sa.select(parts.c.id, _NAME.label("name"), _TEXT.label("text")).where(
        parts.c.text_folded == part.text.casefold(), parts.c.state.in_(_WITH_SERIAL), parts.c.id != part.id
    )
    for row in tx.execute(same_serial.order_by(parts.c.id.desc()).limit(WINDOW)):
        if row.text == part.text and not (part.name and row.name == part.name):
            on = row.name or f"part {row.id}"
            return Objection(SerialAlarm.READ_BEFORE, f"{part.text} was already read on {on}", row.id)
    return None


def send_to_review(tx: Transaction, *, name: str, text: str, objection: Objection) -> None:
    """Send the latest accepted part of a name and a serial to review; nothing happens if there is none."""
    same = sa.and_(name == _NAME, text == _TEXT, parts.c.text_folded == text.casefold())
    accepted = sa.select(parts.c.id).where(same, parts.c.state == PartState.ACCEPTED)
    part_id = tx.execute(accepted.order_by(parts.c.id.desc()).limit(1)).scalar()
    if part_id is None:
        return
    part = part_by_id(tx, part_id, lock=True)
    reading = None if part.reading is None else with_objection(part.reading, objection)
    write_part(tx, replace(part, state=PartState.REVIEW, reading=reading), [_alarm(objection)])


def _alarm(objection: Objection) -> Event:
    return "serial_alarm", {"alarm": objection.alarm, "why": objection.why}


def _before(tx: Transaction, part: PartRecord) -> list[tuple[int, str]]:
    """(how many parts before, serial) of the latest parts of a line and job that were read with certainty."""
    query = (
        sa.select(parts.c.state, _TEXT.label("text"), _READ.label("read"), _DECISION.label("decision"))
        .where(parts.c.id < part.id, parts.c.state != PartState.SHADOW)
        .where(parts.c.line == part.line, parts.c.job == part.job)
        .order_by(parts.c.id.desc())
        .limit(_LOOKED_BACK)
    )
    serials = []
    for back, row in enumerate(tx.execute(query), start=1):
        if row.state == PartState.REVIEWED and row.text:
            serials.append((back, row.text))
        elif row.decision == "accept":
            serials.append((back, row.read))
    return serials
