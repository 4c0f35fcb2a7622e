"""Check a store and its files for damaged, missing, changed or stuck items, without changing anything."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from enum import StrEnum
from typing import Self

import sqlalchemy as sa

from pipeline.common.reading_records import ReadingRecord, from_json
from pipeline.common.records import PartRecord, PartState, ReviewRecord
from pipeline.store.database import AnyRow, Transaction
from pipeline.store.evidence_folder import EvidenceFolder, FileState
from pipeline.store.rows import READ, REVIEWED, search_columns
from pipeline.store.store import Store
from pipeline.store.tables import events, outbox, parts

# longest wait of a result to be sent, and of a part for touch beyond its time
LATE = timedelta(hours=1)
# a running service sweeps files older than an hour, every hour
_ORPHAN_S = 2 * 3600.0
_PAGE = 200
_MOST_TOLD = 1000


_COPY = "copy the file of that name from a backup's evidence/files"
_WRITTEN = "something other than this program has written there"


class Fault(StrEnum):
    """Kinds of faults that a check can find, each with its remedy."""

    todo: str

    def __new__(cls, name: str, todo: str) -> Self:
        fault = str.__new__(cls, name)
        fault._value_, fault.todo = name, todo
        return fault

    DATABASE = "database", "stop the service and restore the last good backup"
    MISSING = "missing", f"{_COPY} into the service's"
    DAMAGED = "damaged", f"{_COPY} over the service's, and check the disk"
    DERIVED = "derived", f"{_WRITTEN}: compare the part with a backup"
    STUCK = "stuck", "start the service of its line, or send a scan of the part"
    UNDELIVERED = (
        "undelivered",
        "see that the receiver runs and that its address is in the service's settings",
    )
    ORPHANS = "orphans", "nothing: a running service removes them within the hour"


@dataclass(frozen=True)
class Finding:
    """One problem; the subject is the id of a part, the hash of a file, or the name of a target."""

    fault: Fault
    subject: str
    what: str


@dataclass
class CheckReport:
    """Result of a check, with the first thousand findings of each kind; files that were not read are only there."""

    parts: int = 0
    files: int = 0
    findings: list[Finding] = field(default_factory=list)
    counts: Counter[Fault] = field(default_factory=Counter)

    def add(self, fault: Fault, subject: str, what: str, *, n: int = 1) -> None:
        if self.counts[fault] < _MOST_TOLD:
            self.findings.append(Finding(fault, subject, what))
        self.counts[fault] += n

    @property
    def well(self) -> bool:
        return not any(n for fault, n in self.counts.items() if fault is not Fault.ORPHANS)


def check(store: Store, files: EvidenceFolder, *, read_files: bool = True) -> CheckReport:
    """Check a store and its files: whether they are there or, with `read_files`, what they hold."""
    report = CheckReport()
    _check_database(store, report)
    _check_parts(store, report)
    _check_outbox(store, report)
    _check_files(store, files, report, read_files=read_files)
    return report


def _check_database(store: Store, report: CheckReport) -> None:
    with store.read_transaction() as tx:
        if tx.postgresql:
            return  # it checks its own pages (data_checksums)
        for message in tx.connection.exec_driver_sql("PRAGMA integrity_check(20)").scalars():
            if message != "ok":
                report.add(Fault.DATABASE, "store.db", str(message))
        for row in tx.connection.exec_driver_sql("PRAGMA foreign_key_check"):
            report.add(Fault.DATABASE, "store.db", f"row {row[1]} of {row[0]} belongs to no row of {row[2]}")


def _check_parts(store: Store, report: CheckReport) -> None:
    for tx, rows in _pages(store):
        history: dict[str, list[AnyRow]] = {}
        of_page = sa.select(events).where(events.c.part_id.between(rows[0].id, rows[-1].id))
        for event in tx.execute(of_page.order_by(events.c.id)):
            history.setdefault(event.part_id, []).append(event)
        for row in rows:
            report.parts += 1
            try:
                part = from_json(PartRecord, row.record)
                wrong = _not_derived(part, row, history.get(row.id, []))
            except ValueError:
                report.add(Fault.DERIVED, row.id, "its record or its history cannot be read")
                continue
            if wrong:
                report.add(Fault.DERIVED, row.id, f"its {' and '.join(wrong)} do not follow from its history")
            due = row.touch_until or part.changed_at + timedelta(days=1)
            if row.state == PartState.TOUCH_NEEDED and tx.now - due > LATE:
                report.add(Fault.STUCK, row.id, f"waits for touch since {part.changed_at:%Y-%m-%d %H:%M} UTC")


def _pages(store: Store) -> Iterator[tuple[Transaction, Sequence[AnyRow]]]:
    after = ""
    query = sa.select(parts).order_by(parts.c.id).limit(_PAGE)
    while True:
        with store.read_transaction() as tx:
            rows = tx.execute(query.where(parts.c.id > after)).all()
            if not rows:
                return
            yield tx, rows
            after = rows[-1].id


def _not_derived(part: PartRecord, row: AnyRow, history: Sequence[AnyRow]) -> list[str]:
    wrong = [name for name, value in search_columns(part).items() if getattr(row, name) != value]
    last = {event.kind: event.data for event in history}
    received = last.get("received", {})
    due_values = {name: received.get(name) for name in ("name", "expected", "database", "job")}
    # compared as records: after an update the part's row is written in the new form, its events are not
    due_values["reading"] = from_json(ReadingRecord, last[READ]) if READ in last else None
    due_values["review"] = from_json(ReviewRecord, last[REVIEWED]) if REVIEWED in last else None
    return wrong + [name for name, value in due_values.items() if getattr(part, name) != value]


def _check_outbox(store: Store, report: CheckReport) -> None:
    target, since, error = outbox.c.target, sa.func.min(outbox.c.created_at), sa.func.max(outbox.c.error)
    with store.read_transaction() as tx:
        query = sa.select(target, sa.func.count(), since, error).where(outbox.c.created_at < tx.now - LATE)
        for name, n, first, last_error in tx.execute(query.group_by(target).order_by(target)):
            why = f"last error: {last_error}" if last_error else "none was tried"
            what = f"{n} results wait, the first since {first:%Y-%m-%d %H:%M} UTC; {why}"
            report.add(Fault.UNDELIVERED, name, what, n=n)


def _check_files(store: Store, files: EvidenceFolder, report: CheckReport, *, read_files: bool) -> None:
    for sha256 in store.every_needed_hash():
        state = files.state(sha256, read=read_files)
        if state is FileState.WHOLE:
            report.files += 1
        elif store.needed_hashes((sha256,)):  # else its time was up meanwhile
            fault = Fault.MISSING if state is FileState.MISSING else Fault.DAMAGED
            report.add(fault, sha256, f"is {state.value}: {files.path(sha256)}")
    orphans = 0
    for names in files.hashes(before_s=time.time() - _ORPHAN_S):
        orphans += len(set(names) - store.needed_hashes(names))
    if orphans:
        report.add(Fault.ORPHANS, str(files.root), f"{orphans} files belong to no part", n=orphans)
