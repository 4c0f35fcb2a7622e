"""A run of `read` on the disk: a journal of records, and beside it the table that the user asked for.

rows.csv                   rows as they come; after `finish` complete and in the order of the parts
rows.csv.unfinished        the journal: what is run, and the record of every part that is done; gone with `finish`
rows.csv~                  the table that stood there before the run

Parquet and workbooks, to which nothing can be appended, are written by `finish`. The table is never read: a run that is
taken up writes it anew from the journal.

     open --> add, add, add --> finish          kill, loss of power: the same `open` takes it up again
                           \\--> forget          of a run whose rows are kept elsewhere: nothing stays
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Set
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar

from glyphs.atomic import replacing
from glyphs.errors import FileError, describe_fault
from pipeline.common.reading_records import ReadingRecord
from pipeline.runs.journal import Journal, cannot_be_written
from pipeline.runs.tables import LINE_FORMS, WORKBOOK, LineForm, check_output, form_of, write_table
from pipeline.runs.workbook import write_workbook


class RecordJournal(Journal[ReadingRecord]):
    """The records of a run, and the table that grows with them.

    Attributes:
        form: of the table's lines.
        table: open for more lines; None of a table to which nothing can be appended.
    """

    kind: ClassVar[str] = "run"
    version: ClassVar[int] = 4
    keeps: ClassVar[Any] = ReadingRecord
    form: LineForm
    table: FileIO | None = None

    def add(self, name: str, kept: ReadingRecord, *, line: bytes = b"") -> ReadingRecord:
        """Keep a record, and append its line; what no table holds is a fault, and its record says so."""
        if name in self.names:
            return kept
        try:
            line = self.form.encode(kept)
        except ValueError as error:
            kept = ReadingRecord.failed(name, f"{name}: {describe_fault(error)}; please report it")
            line = self.form.encode(kept)
        super().add(name, kept, line=line)
        try:
            while self.table is not None and line:
                line = line[self.table.write(line) :]
        except OSError as error:
            raise cannot_be_written(self._output, error) from error
        return kept

    def add_second(self, second: ReadingRecord) -> None:
        """Keep the second reading of a part; its line is that of the better of the two."""
        from recognition.learning.lot import is_better

        try:
            line = self.form.encode(second)
        except ValueError:  # what no table holds is no better than what it has
            return
        first, _ = next(self.entries((second.part,)))
        self.add_again(second.part, second, line=line if is_better(second, first) else None)


class RunJournal:
    """The records of one run, and its table; for one thread of one process at a time.

    Attributes:
        path: the table.
        journal: which parts are done.
        resumed: whether a run that broke off was taken up.
        kept: where the table that stood there before went; None where there was none with a row.
    """

    def __init__(self, path: Path, description: Mapping[str, Any]) -> None:
        """Begin a run or take one up; as `open`."""
        check_output(path)
        self.path = path
        self.kept: Path | None = None
        marker = _beside(path, ".unfinished")
        self.journal = RecordJournal(marker, description, output=path, make_place=self._make_place)
        self.resumed, self.journal.form = self.journal.resumed, form_of(path)
        if path.suffix.lower() in LINE_FORMS:
            try:
                write_table(self.journal.lines(), path)
                self.journal.table = open(path, "ab", buffering=0)  # noqa: SIM115
            except BaseException:
                self.close()
                raise

    @classmethod
    def open(cls, path: Path, description: Mapping[str, Any]) -> RunJournal:
        """Take up the run that broke off there, or begin one.

        Raises:
            FileError: unknown suffix; no place to write; another run writes it, or broke off there; damage.
        """
        return cls(path, description)

    def __enter__(self) -> RunJournal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def done(self) -> Set[str]:
        """Names of the parts whose records are kept; grows with `add`."""
        return self.journal.names

    def add(self, record: ReadingRecord) -> None:
        """Keep a record; of two of one part the first counts.

        Raises:
            FileError: it cannot be written; the records before stay.
        """
        self.journal.add(record.part, record)

    def records(self, order: Iterable[str] = ()) -> Iterator[ReadingRecord]:
        """The better record of every part, streamed: those named first, the others as they came."""
        from recognition.learning.lot import is_better  # slow to import

        for first, second in self.journal.entries(order):
            yield second if second is not None and is_better(second, first) else first

    def finish(self, order: Iterable[str]) -> None:
        """Write the table in order, records of parts not named last, and end the run.

        Args:
            order: names of the parts; names without a record are passed over.

        Raises:
            FileError: it cannot be written; the same command takes the run up and ends it.
        """
        self._close_table()
        try:
            if self.path.suffix.lower() == WORKBOOK:
                with replacing(self.path) as temporary:
                    write_workbook(self.records(order), temporary, self.journal.description)
            else:
                write_table(self.journal.lines(order), self.path)
        except FileError as problem:
            if not isinstance(problem.__cause__, OSError):
                raise
            raise cannot_be_written(self.path, problem.__cause__) from problem
        self.journal.remove()

    def keep_private(self) -> None:
        """Let nobody but the owner read what is kept; for records that are no table of the user's.

        Raises:
            FileError: the disk refuses.
        """
        try:
            for path in self.path.parent.glob(f"{self.path.name}*"):
                path.chmod(0o600)
        except OSError as error:
            raise cannot_be_written(self.path, error) from error

    def forget(self) -> None:
        """End the run and remove its table, for its records are kept elsewhere.

        Raises:
            FileError: the disk refuses.
        """
        self._close_table()
        try:
            self.path.unlink(missing_ok=True)
        except OSError as error:
            raise cannot_be_written(self.path, error) from error
        self.journal.remove()

    def close(self) -> None:
        """Let go of the table; a run that is not finished can be taken up again."""
        self._close_table()
        self.journal.close()

    def _close_table(self) -> None:
        if self.journal.table is not None:  # Windows does not replace a file that is open
            self.journal.table.close()
            self.journal.table = None

    def _make_place(self) -> None:
        # what is no longer than a head is left by a run that broke off as it began: no reason to lose a table kept
        form = LINE_FORMS.get(self.path.suffix.lower())
        if self.path.exists() and self.path.stat().st_size > len(form.head if form else b""):
            self.kept = _beside(self.path, "~")
            os.replace(self.path, self.kept)
        else:
            self.path.unlink(missing_ok=True)


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(path.name + ending)
