"""A night's production: many parts, read by an executor, every row on the disk before the next one counts.

    listed parts --not done yet--> executor --> store --> RunJournal, its table, quarantine, summary
                                                            --> what was not accepted, read again (SecondPass)

Whatever ends the run, the same command goes on where it ended: a part whose row is in the table is not read again. One
that the store has and the table has not is read again, and the store takes it once, also after the run's end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from pipeline.common.reading_records import ReadingRecord
from pipeline.formats.part_files import PartFiles
from pipeline.runs.journal import resumable
from pipeline.runs.summary import Summary
from pipeline.runs.task import ReadPart, RunOrder, read_listed
from pipeline.store.errors import UnfitError
from pipeline.workers.executors import Executor

if TYPE_CHECKING:
    from pipeline.reading.drift import DriftWatch
    from pipeline.runs.lot_check import LotCheck
    from pipeline.runs.quarantine import Quarantine
    from pipeline.runs.run_journal import RunJournal
    from pipeline.runs.second_pass import SecondPass
    from pipeline.runs.store_target import RunStore


@dataclass
class Run:
    """Where the rows of a run go.

    Attributes:
        book: the run on the disk.
        quarantine: list of the parts that could not be read.
        store: keeps them as well.
        second: what has the lot teach itself; needs a book.
        lot: sends to a person what cannot be a serial of this lot.
        watch: compares the parts that are read now with those of a certificate.
        on_row: told of every part that is read now.
        on_any_row: told of these, and of those that an earlier sitting read; with a second pass, of the rows that
            count in the end.
        summary: of all rows, those of an earlier sitting included.
        read_now: parts read in this sitting.
        known: of these, parts that the store had already.
        finished: whether every part has been.
    """

    book: RunJournal
    quarantine: Quarantine | None = None
    store: RunStore | None = None
    second: SecondPass | None = None
    lot: LotCheck | None = None
    watch: DriftWatch | None = None
    on_row: Callable[[ReadingRecord], None] | None = None
    on_any_row: Callable[[ReadingRecord], None] | None = None
    summary: Summary = field(default_factory=Summary)
    read_now: int = 0
    known: int = 0
    finished: bool = False

    def work(self, parts: Sequence[PartFiles], order: RunOrder, executor: Executor) -> None:
        """Read every part that the book does not hold, and put the table in the order of the parts.

        Beside a store the book is no result: it stays, unfinished, until whoever opened the run is done with it.

        Raises:
            FileError: the table cannot be written.
            ClusterError: the cluster is lost.
        """
        failed: dict[str, str] = {}
        for record in self.book.records():
            if self.lot is not None:
                self.lot.known(record)
            if self.second is None:
                self._count(record)
            if record.error:
                failed[record.part] = record.error
        if self.quarantine is not None and failed:
            for part in parts:
                if part.name in failed:
                    self.quarantine.add(part, failed[part.name])
        done = resumable(
            self.book.journal, parts, executor, read_listed, order, lost=lost_part, kept=self._record
        )
        for part, record in done:
            if record.error and self.quarantine is not None:
                self.quarantine.add(part, record.error)
            self.read_now += 1
            if self.second is None:
                self._count(record)
            if self.on_row is not None:
                self.on_row(record)
        if self.second is not None:
            self.second.checked = self.lot.checked if self.lot is not None else None
            self.second.work(self.book, parts, order, executor)
            for record in self.book.records():
                self._count(record)
        if self.store is None:
            self.book.finish(part.name for part in parts)
        self.finished = True

    def _record(self, read: ReadPart) -> ReadingRecord:
        """The record of a part, which lot, store and certificate have had a look at."""
        if self.lot is not None:
            read = replace(read, record=self.lot.checked(read.record))
        record = read.record
        if self.store is not None:
            try:
                self.known += not self.store.add(read)
            # what no store holds may not end the run, now and whenever it goes on
            except UnfitError as error:
                problem = f"{record.part}: cannot be stored ({' '.join(str(error).split())[:500]})"
                record = ReadingRecord.failed(record.part, problem)
        if self.watch is not None:
            self.watch.add(record.source, read.measures)
        return record

    def _count(self, record: ReadingRecord) -> None:
        self.summary.add(record)
        if self.on_any_row is not None:
            self.on_any_row(record)


def lost_part(listed: PartFiles, error: Exception) -> ReadPart:
    """A part that no worker has read, with what became of the worker."""
    file = listed.files[0] if listed.files else listed.name
    reason = " ".join(str(error).split()) or type(error).__name__
    return ReadPart(listed, ReadingRecord.failed(listed.name, f"{file}: {reason}; try it alone"))
