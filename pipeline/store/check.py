"""A store and its files looked through: what is damaged, missing, changed since it was written, or stuck.

It only looks, and the service may run meanwhile: parts are taken by the page, each page as it was at one moment.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from enum import StrEnum
from itertools import groupby
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Row

from pipeline.common.records import PartState
from pipeline.store.backup import unpacked
from pipeline.store.database import Transaction
from pipeline.store.errors import cleaned
from pipeline.store.evidence_folder import EvidenceFolder, FileState
from pipeline.store.seals import SEALED, broken_at
from pipeline.store.store import Store
from pipeline.store.tables import outbox, parts, seals

LATE = timedelta(hours=1)
"""For which a result may wait to be sent, and a part for touch beyond its time."""
_ORPHAN_S = 2 * 3600.0
"""A running service sweeps every hour what is an hour old."""
_PAGE = 200
_MOST_TOLD = 1000


class Fault(StrEnum):
    """What may be wrong."""

    DATABASE = "database"
    MISSING = "missing"
    DAMAGED = "damaged"
    CHAIN = "chain"
    DERIVED = "derived"
    CHANGED = "changed"
    STUCK = "stuck"
    UNDELIVERED = "undelivered"
    ORPHANS = "orphans"


WHAT_TO_DO: Mapping[Fault, str] = {
    Fault.DATABASE: "stop the service and restore the last good backup",
    Fault.MISSING: "copy the file of that name from a backup's evidence/files into the service's",
    Fault.DAMAGED: "copy the file of that name from a backup's evidence/files over the service's, and check the disk",
    Fault.CHAIN: "something other than this program has written there: compare the part with a backup",
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
    store: Store, evidence: EvidenceFolder, *, read_files: bool = True, against: Path | None = None
) -> CheckReport:
    """Look through a store and its files.

    Args:
        store: to be looked through.
        evidence: its files.
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
    _check_files(store, evidence, report, read_files=read_files)
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
        with store.database.snapshot() as tx:
            page = _page(tx, after)
        for part, chain, rows in page:
            report.parts += 1
            if broken := broken_at(part.id, chain, rows):
                report.add(Fault.CHAIN, part.id, broken)
            if wrong := _not_derived(part, rows):
                report.add(
                    Fault.DERIVED, part.id, f"its {' and '.join(wrong)} do not follow from its history"
                )
            due = part.touch_until or part.changed_at + timedelta(days=1)
            if part.state == PartState.TOUCH_NEEDED and tx.now - due > LATE:
                report.add(
                    Fault.STUCK, part.id, f"waits for touch since {part.changed_at:%Y-%m-%d %H:%M} UTC"
                )
        if not page:
            return
        after = page[-1][0].id


PartRows = tuple[Row[Any], Sequence[Row[Any]], Mapping[str, Sequence[Row[Any]]]]


def _page(tx: Transaction, after: str) -> list[PartRows]:
    """Parts with their seals, and their rows of every table that is sealed."""
    found = tx.execute(sa.select(parts).where(parts.c.id > after).order_by(parts.c.id).limit(_PAGE)).all()
    if not found:
        return []
    of_all = {t.name: _by_part(tx, t, found[0].id, found[-1].id) for t in (*SEALED, seals)}
    return [
        (part, of_all[seals.name].get(part.id, ()), {t.name: of_all[t.name].get(part.id, ()) for t in SEALED})
        for part in found
    ]


def _by_part(tx: Transaction, table: sa.Table, first: str, last: str) -> dict[str, list[Row[Any]]]:
    mine = sa.select(table).where(table.c.part_id.between(first, last)).order_by(table.c.part_id, table.c.id)
    return {part_id: list(rows) for part_id, rows in groupby(tx.execute(mine), lambda row: row.part_id)}


def _not_derived(part: Row[Any], rows: Mapping[str, Sequence[Row[Any]]]) -> list[str]:
    """Columns of a part that are not what its rows make of them."""
    readings, reviews, events = rows["readings"], rows["reviews"], rows["events"]
    given = events[0].data if events and events[0].kind == "received" else {}
    wanted: dict[str, Any] = {name: given[name] for name in ("name", "expected", "database") if name in given}
    wanted["reading_id"] = readings[-1].id if readings else None
    # the review that counts: where two people must agree, the one that the event tells
    agreed = [event for event in events if event.kind == "reviewed"]
    counts = [r for r in reviews if agreed and (r.after, r.at) == (agreed[-1].data["after"], agreed[-1].at)]
    wanted["review_id"] = counts[-1].id if counts else None
    wanted["name_folded"], wanted["text_folded"] = part.name.casefold(), part.text.casefold()
    if part.state == PartState.TOUCH_NEEDED:
        wanted["text"] = ""
    elif part.state == PartState.REVIEWED:
        wanted["text"] = counts[-1].after if counts else None
    elif not agreed:
        wanted["text"] = cleaned(readings[-1].text) if readings else ""
    return [name for name, value in wanted.items() if getattr(part, name) != value]


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


def _check_files(store: Store, evidence: EvidenceFolder, report: CheckReport, *, read_files: bool) -> None:
    look: Callable[[str], FileState] = evidence.state if read_files else evidence.presence
    for sha256 in _needed(store):
        state = look(sha256)
        if state is FileState.WHOLE:
            report.files += 1
        elif store.needed_hashes((sha256,)):  # else its time was up meanwhile
            fault = Fault.MISSING if state is FileState.MISSING else Fault.DAMAGED
            report.add(fault, sha256, f"is {state.value}: {evidence.path(sha256)}")
    orphans = 0
    for names in evidence.kept(before_s=time.time() - _ORPHAN_S):
        orphans += len(set(names) - store.needed_hashes(names))
    if orphans:
        report.add(Fault.ORPHANS, str(evidence.root), f"{orphans} files belong to no part", n=orphans)


def _needed(store: Store) -> Iterator[str]:
    after = ""
    while hashes := store.needed_after(after):
        yield from hashes
        after = hashes[-1]


def _check_against(store: Store, backup: Path, report: CheckReport) -> None:
    after = ""
    with unpacked(backup) as (told, copied):
        while True:
            with copied.database.reading() as tx:
                page = _page(tx, after)
            if not page:
                return
            after = page[-1][0].id
            with store.database.snapshot() as tx:
                found = _by_part(tx, seals, page[0][0].id, after)
            for part, chain, _ in page:
                now = {seal.number: seal.digest for seal in found.get(part.id, ())}
                if any(now.get(seal.number) != seal.digest for seal in chain):
                    what = "is not" if part.id in found else "is gone, and was"
                    report.add(Fault.CHANGED, part.id, f"{what} as it was on {told.made_at[:16]}")
