"""A store and its files looked through: what is damaged, missing, changed since it was written, or stuck.

It only looks, and the service may run meanwhile: parts are taken by the page, each page as it was at one moment.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import timedelta
from enum import StrEnum
from itertools import groupby
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Row

from pipeline.common.reading_records import from_json
from pipeline.common.records import PartRecord, PartState
from pipeline.store.backup import unpacked
from pipeline.store.database import Transaction
from pipeline.store.evidence_folder import EvidenceFolder, FileState
from pipeline.store.rows import READ, REVIEWED, searched
from pipeline.store.store import Store
from pipeline.store.tables import events, evidence, outbox, parts

# for which a result may wait to be sent, and a part for touch beyond its time
LATE = timedelta(hours=1)
# a running service sweeps every hour what is an hour old
_ORPHAN_S = 2 * 3600.0
_PAGE = 200
_MOST_TOLD = 1000


class Fault(StrEnum):
    """What may be wrong."""

    DATABASE = "database"
    MISSING = "missing"
    DAMAGED = "damaged"
    DERIVED = "derived"
    CHANGED = "changed"
    STUCK = "stuck"
    UNDELIVERED = "undelivered"
    ORPHANS = "orphans"


WHAT_TO_DO: Mapping[Fault, str] = {
    Fault.DATABASE: "stop the service and restore the last good backup",
    Fault.MISSING: "copy the file of that name from a backup's evidence/files into the service's",
    Fault.DAMAGED: "copy the file of that name from a backup's evidence/files over the service's, and check the disk",
    Fault.DERIVED: "something other than this program has written there: compare the part with a backup",
    Fault.CHANGED: "what the backup holds of the part has been changed or removed since: find out who has written",
    Fault.STUCK: "start the service of its line, or send a scan of the part",
    Fault.UNDELIVERED: "see that the receiver runs and that its address is in the service's settings",
    Fault.ORPHANS: "nothing: a running service removes them within the hour",
}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        fault: its kind.
        subject: id of a part, hash of a file, or name of a target.
        what: is wrong with it.
    """

    fault: Fault
    subject: str
    what: str


@dataclass
class CheckReport:
    """What a check has found.

    Attributes:
        parts: looked at.
        files: of evidence that were found whole, or only found where they were not read.
        findings: the first thousand of each kind.
        counts: of each kind, all.
    """

    parts: int = 0
    files: int = 0
    findings: list[Finding] = field(default_factory=list)
    counts: Counter[Fault] = field(default_factory=Counter)

    def add(self, fault: Fault, subject: str, what: str, *, n: int = 1) -> None:
        """Note that something is wrong."""
        if self.counts[fault] < _MOST_TOLD:
            self.findings.append(Finding(fault, subject, what))
        self.counts[fault] += n

    @property
    def well(self) -> bool:
        """Whether nobody needs to do anything."""
        return not any(n for fault, n in self.counts.items() if fault is not Fault.ORPHANS)


def check(
    store: Store, files: EvidenceFolder, *, read_files: bool = True, against: Path | None = None
) -> CheckReport:
    """Look through a store and its files.

    Args:
        store: to be looked through.
        files: its evidence.
        read_files: compare what they hold with their hashes; else only see whether they are there.
        against: backup of this store: all that it holds must still be there, unchanged.

    Raises:
        StoreError: the store does not answer.
        FileError: the backup is none, or damaged.
    """
    report = CheckReport()
    _check_database(store, report)
    _check_parts(store, report)
    _check_outbox(store, report)
    _check_files(store, files, report, read_files=read_files)
    if against is not None:
        _check_against(store, against, report)
    return report


def _check_database(store: Store, report: CheckReport) -> None:
    with store.database.reading() as tx:
        if tx.postgresql:
            return  # it checks its own pages (data_checksums)
        for found in tx.connection.exec_driver_sql("PRAGMA integrity_check(20)").scalars():
            if found != "ok":
                report.add(Fault.DATABASE, "store.db", str(found))
        for row in tx.connection.exec_driver_sql("PRAGMA foreign_key_check"):
            report.add(Fault.DATABASE, "store.db", f"row {row[1]} of {row[0]} belongs to no row of {row[2]}")


def _check_parts(store: Store, report: CheckReport) -> None:
    after = ""
    while True:
        with store.database.reading() as tx:
            page = _page(tx, after)
        if not page:
            return
        after = page[-1][0].id
        for row, happened in page:
            report.parts += 1
            part = from_json(PartRecord, row.record)
            if wrong := _not_derived(part, row, happened):
                what = f"its {' and '.join(wrong)} do not follow from its history"
                report.add(Fault.DERIVED, row.id, what)
            waits = part.touch.until if part.touch is not None else None
            due = waits or part.changed_at + timedelta(days=1)
            if row.state == PartState.TOUCH_NEEDED and tx.now - due > LATE:
                what = f"waits for touch since {part.changed_at:%Y-%m-%d %H:%M} UTC"
                report.add(Fault.STUCK, row.id, what)


def _page(tx: Transaction, after: str) -> list[tuple[Row[*tuple[Any, ...]], list[Row[*tuple[Any, ...]]]]]:
    """Parts with their events."""
    found = tx.execute(sa.select(parts).where(parts.c.id > after).order_by(parts.c.id).limit(_PAGE)).all()
    happened = _by_part(tx, events, found[0].id, found[-1].id) if found else {}
    return [(row, happened.get(row.id, [])) for row in found]


def _by_part(
    tx: Transaction, table: sa.Table, first: str, last: str
) -> dict[str, list[Row[*tuple[Any, ...]]]]:
    columns = [column for column in table.c if column.name != "gone"]  # which may change
    mine = sa.select(*columns).where(table.c.part_id.between(first, last))
    rows = tx.execute(mine.order_by(table.c.part_id, table.c.id))
    return {part_id: list(of_part) for part_id, of_part in groupby(rows, lambda row: row.part_id)}


def _not_derived(
    part: PartRecord, row: Row[*tuple[Any, ...]], happened: list[Row[*tuple[Any, ...]]]
) -> list[str]:
    """What a part's row holds that is not what its record and its events make of it."""
    wrong = [name for name, value in searched(part).items() if getattr(row, name) != value]
    last = {event.kind: event.data for event in happened}
    wanted = {"reading": last.get(READ), "review": last.get(REVIEWED)}
    given = {
        name: value for event in happened if event.kind == "received" for name, value in event.data.items()
    }
    wanted |= {name: given.get(name) for name in ("name", "expected", "database", "job")}
    return wrong + [name for name, value in wanted.items() if row.record[name] != value]


def _check_outbox(store: Store, report: CheckReport) -> None:
    with store.database.reading() as tx:
        late = outbox.c.created_at < tx.now - LATE
        asked = sa.select(
            outbox.c.target,
            sa.func.count().label("n"),
            sa.func.min(outbox.c.created_at).label("since"),
            sa.func.max(outbox.c.error).label("error"),
        )
        for row in tx.execute(asked.where(late).group_by(outbox.c.target).order_by(outbox.c.target)):
            why = f"; it was said: {row.error}" if row.error else "; none was tried"
            what = f"{row.n} results wait, the first since {row.since:%Y-%m-%d %H:%M} UTC{why}"
            report.add(Fault.UNDELIVERED, row.target, what, n=row.n)


def _check_files(store: Store, files: EvidenceFolder, report: CheckReport, *, read_files: bool) -> None:
    look: Callable[[str], FileState] = files.state if read_files else files.presence
    for sha256 in _needed(store):
        state = look(sha256)
        if state is FileState.WHOLE:
            report.files += 1
        elif store.needed_hashes((sha256,)):  # else its time was up meanwhile
            fault = Fault.MISSING if state is FileState.MISSING else Fault.DAMAGED
            report.add(fault, sha256, f"is {state.value}: {files.path(sha256)}")
    orphans = 0
    for names in files.kept(before_s=time.time() - _ORPHAN_S):
        orphans += len(set(names) - store.needed_hashes(names))
    if orphans:
        report.add(Fault.ORPHANS, str(files.root), f"{orphans} files belong to no part", n=orphans)


def _needed(store: Store) -> Iterator[str]:
    after = ""
    while hashes := store.needed_after(after):
        yield from hashes
        after = hashes[-1]


def _check_against(store: Store, backup: Path, report: CheckReport) -> None:
    after = ""
    with unpacked(backup) as (made, copied):
        while True:
            with copied.database.reading() as tx:
                page = _page(tx, after)
                if not page:
                    return
                first, after = page[0][0].id, page[-1][0].id
                then = [_by_part(tx, table, first, after) for table in (events, evidence)]
            changed: dict[str, str] = {}
            with store.database.reading() as tx:
                now = [_by_part(tx, table, first, after) for table in (events, evidence)]
            for old, new in zip(then, now, strict=True):
                for part_id, rows in old.items():
                    if any(row not in new.get(part_id, ()) for row in rows):
                        changed.setdefault(part_id, "is not" if part_id in now[0] else "is gone, and was")
            for part_id, what in sorted(changed.items()):
                report.add(Fault.CHANGED, part_id, f"{what} as it was on {made.made_at[:16]}")
