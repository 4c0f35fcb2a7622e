"""A run over many parts, read by an executor; every row is on the disk within a second, and the same command continues
where it stopped. A part that only the store has is read again, but stored once."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.serial_rules import ANY_SERIAL, SerialRules
from pipeline.common.version import key_of
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob, lost_part, read_listed
from pipeline.reading.triage import ReadPart
from pipeline.runs.journal import resumable, set_aside, writing
from pipeline.runs.lot import Repeats, find_repeats, repeated, reviewed
from pipeline.runs.options import RunOptions
from pipeline.runs.outputs import RunJournal, RunStore, export, write_quarantine
from pipeline.runs.progress import Progress
from pipeline.runs.second_pass import SecondPass
from pipeline.runs.summary import Summary
from pipeline.store.errors import UnfitError
from pipeline.workers.executors import Executor

if TYPE_CHECKING:
    from pipeline.reading.drift import DriftWatch


@dataclass
class Run:
    """A run with the outputs of its rows."""

    journal: RunJournal
    quarantine: Path | None = None  # table of the parts that could not be read
    store: RunStore | None = None
    second: SecondPass | None = None
    rules: SerialRules = ANY_SERIAL
    watch: DriftWatch | None = None  # compares the parts read now with those of a certificate
    progress: Progress = field(default_factory=Progress)
    on_row: Callable[[ReadingRecord], None] | None = None  # every final row, also from before a resumption
    summary: Summary = field(default_factory=Summary)
    read_now: int = 0
    known: int = 0  # of the parts read now, the store already had
    finished: bool = False

    def work(self, parts: Sequence[PartFiles], job: PartJob, executor: Executor) -> None:
        """Read every part that the journal lacks, and export the table in the order of the parts; without a table the
        journal stays until the run is closed. Raises FileError, ClusterError: it ends."""
        if self.watch is not None and self.journal.resumed:
            for read in self.journal.latest(self.watch.window):
                self.watch.add(read.record.source, read.measures)
        try:
            for _, read in resumable(
                self.journal, parts, executor, read_listed, job, lost=lost_part, form=self._keep
            ):
                self.read_now += 1
                self.progress.advance(failed=bool(read.record.error))
        finally:
            if self.quarantine is not None:
                errors = self.journal.errors()
                bad = ((part, errors[part.name]) for part in parts if part.name in errors)
                write_quarantine(self.quarantine, bad)
        if self.second is not None:
            waiting, job = self.second.learned_job(self.journal, parts, job, executor, self.progress.line)
            self.progress.more(len(waiting))
            for _, read in resumable(
                self.journal, waiting, executor, read_listed, job,
                lost=lost_part, form=lambda _, read: self._in_order(read), again=True,
            ):  # fmt: skip
                self.second.again += 1
                self.progress.advance(failed=bool(read.record.error))
        names = [part.name for part in parts]
        repeats = find_repeats(self.journal.better(names)) if self.rules.duplicates else {}
        if self.journal.written:
            export(self.journal, names, lambda record: self._final(record, repeats))
        else:
            for record in self.journal.records():
                self._final(record, repeats)
        self.finished = True

    def _in_order(self, read: ReadPart) -> ReadPart:
        record = read.record
        objection = self.rules.by_order(record.text) if record.decision == "accept" else None
        return ReadPart((reviewed(record, objection),), measures=read.measures)

    def _keep(self, part: PartFiles, read: ReadPart) -> ReadPart:
        checked = self._in_order(read)
        if self.store is not None:
            try:
                self.known += not self.store.keep(part, replace(read, readings=checked.readings))
            # a value that the store cannot hold must not end the run, now or when it is resumed
            except UnfitError as error:
                problem = f"{part.name}: cannot be stored ({' '.join(str(error).split())[:500]})"
                checked = ReadPart((ReadingRecord.failed(part.name, problem),), measures=read.measures)
        if self.watch is not None:
            self.watch.add(checked.record.source, checked.measures)
        return checked

    def _final(self, record: ReadingRecord, repeats: Repeats) -> ReadingRecord:
        objection = repeated(record, repeats)
        if objection is not None and self.store is not None:
            self.store.send_to_review(record, objection)
        record = reviewed(record, objection)
        self.summary.add(record)
        if self.on_row is not None:
            self.on_row(record)
        return record


@contextmanager
def open_run(options: RunOptions, description: dict[str, Any], *, second_pass: bool = False) -> Iterator[Run]:
    """Open a new run with its table, or resume an interrupted one; answers depend on the description, in JSON values.
    Raises FileError: the table is another run's, in use, or cannot be written. StoreError."""
    # a part's own entry in a table is in its own key in the store
    known = {name: value for name, value in description.items() if name != "tables"}
    key = key_of({**known, "store": options.store})
    with ExitStack() as stack:
        if options.out is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="tactile-marks-"))
            table, bad = Path(folder) / "rows", None
        elif options.store is None:
            table, bad = Path(options.out), Path(options.out).with_suffix(".quarantine.csv")
        else:
            # the journal lets an interrupted run continue; the store's keys prevent duplicates
            table, bad = Path(f"tactile-marks-{key}"), Path("parts.quarantine.csv")
        written = options.out is not None and options.store is None
        journal = stack.enter_context(RunJournal(table, description, written=written))
        if bad is not None and not journal.resumed:
            with writing(bad):
                set_aside(bad)
        with ExitStack() as inner:
            run = Run(journal, bad)
            if options.store is not None:
                journal.keep_private()
                store = RunStore(options.store, key, evidence=options.evidence)
                run.store = inner.enter_context(closing(store))
            if second_pass:
                # an earlier run's database is set aside like its table
                database = table.with_suffix(".die.glyphs")
                if not journal.resumed:
                    set_aside(database)
                run.second = SecondPass(database, always=bool(options.learn_die))
            yield run
        # last, after the store is closed: if interrupted before, the same command reads nothing again
        if run.finished and not written:
            journal.remove()
