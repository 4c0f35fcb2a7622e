"""A run of `read` on the disk: a journal of records, and the requested table beside it.

rows.csv                   rows as they come; after `finish` complete and in the order of the parts
rows.csv.unfinished        the journal: a description of the run and a record for every part done; `finish` removes it
rows.csv~                  the previous table of that name

Parquet and workbooks, to which nothing can be appended, are written by `finish`. The table is never read: a resumed run
writes it again from the journal.

     open --> keep, keep, keep --> finish          after a kill or power failure the same `open` resumes the run
                           \\--> remove          for a run whose rows are kept elsewhere: no file stays
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from io import RawIOBase
from pathlib import Path
from typing import Any, ClassVar

from glyphs.atomic import replacing
from pipeline.common.output_paths import check_writable
from pipeline.common.reading_records import ReadingRecord
from pipeline.errors import describe_fault
from pipeline.runs.journal import Journal, set_aside, writing
from pipeline.runs.lot import is_better
from pipeline.runs.tables import SUFFIXES, WORKBOOK, form_of, grows, write_table
from pipeline.runs.workbook import write_workbook


def unfinished(table: Path) -> Path:
    """The journal of a run that writes this table."""
    return table.with_name(f"{table.name}.unfinished")


def has_rows(table: Path) -> bool:
    """Whether a table exists and holds more than its headings."""
    return table.exists() and table.stat().st_size > (len(form_of(table).head) if grows(table) else 0)


class RunJournal(Journal[ReadingRecord]):
    """The records of one run, and the table that grows with them, for one thread at a time.

    Attributes:
        table: the file that the user asked for.
        written: whether there is a table; without one only the journal is written.
        kept: new name of the previous table; None if there was none with a row.
    """

    kind: ClassVar[str] = "run"
    version: ClassVar[int] = 5
    keeps: ClassVar[Any] = ReadingRecord

    def __init__(self, table: Path, description: Mapping[str, Any] | None, *, written: bool = True) -> None:
        """Begin a run or resume one.

        Args:
            table: the file that the user asked for.
            description: description of the run.
            written: as in the attribute.

        Raises:
            FileError: the suffix is unknown, the table cannot be written or is being written, or the journal is that of
                another run, or damaged.
        """
        if written:
            check_writable(table, SUFFIXES)
        self.table, self.written, self._form = table, written, form_of(table)
        self.kept: Path | None = None
        self._growing: RawIOBase | None = None
        super().__init__(unfinished(table), description, output=table)
        if written and grows(table):
            try:
                write_table(self.records(), table)
                self._growing = table.open("ab", buffering=0)
            except BaseException:
                self.close()
                raise

    def keep_all(
        self, kept: Mapping[str, ReadingRecord], *, again: bool = False
    ) -> Mapping[str, ReadingRecord]:
        """Store records and append their lines; one that no table can hold becomes a record with an error."""
        stored, lines = dict(kept), b""
        for name, record in kept.items() if self.written else ():
            try:
                lines += self._form.encode(record)
            except ValueError as error:
                problem = f"{name}: {describe_fault(error)}; please report it"
                stored[name] = ReadingRecord.failed(name, problem)
                lines += self._form.encode(stored[name])
        super().keep_all(stored, again=again)
        if self._growing is not None and not again:
            with self._faults():
                while lines:  # unbuffered: the kernel has all lines before this returns
                    lines = lines[self._growing.write(lines) or 0 :]
        return stored

    def records(self, order: Iterable[str] = ()) -> Iterator[ReadingRecord]:
        """Stream the better record of every part: named parts first, the others in the order of reading."""
        for first, second in self.entries(order):
            yield second if second is not None and is_better(second, first) else first

    def finish(
        self, order: Iterable[str], final: Callable[[ReadingRecord], ReadingRecord] = lambda record: record
    ) -> None:
        """Write the table in order, with unnamed parts last, and end the run.

        Args:
            order: names of the parts; names without a record are skipped.
            final: makes the record that is written from each stored one.

        Raises:
            FileError: it cannot be written; the same command resumes the run and ends it.
        """
        self._close_table()

        records = map(final, self.records(order))
        with writing(self.table):
            if self.table.suffix.lower() == WORKBOOK:
                with replacing(self.table) as temporary:
                    write_workbook(records, temporary, self.description)
            else:
                write_table(records, self.table)
        self.remove()

    def keep_private(self) -> None:
        """Make the files readable by their owner only; for records that are not the user's own table.

        Raises:
            FileError: the disk refuses.
        """
        with self._faults():
            for path in self.path.parent.glob(f"{self.path.name}*"):
                path.chmod(0o600)

    def close(self) -> None:
        """Close the table; an unfinished run can be resumed."""
        self._close_table()
        super().close()

    def _close_table(self) -> None:
        if self._growing is not None:  # Windows does not replace a file that is open
            self._growing.close()

    def _begin(self) -> None:
        # a file with only a header is left by a run that stopped at once; it must not replace a table set aside
        if self.written:
            self.kept = set_aside(self.table, head=self._form.head if grows(self.table) else b"")
        super()._begin()
