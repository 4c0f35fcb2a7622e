"""The table of a run on the disk: a row a part, kept as soon as it is known; a run that breaks off is taken up again.

rows.csv                   the rows as they come; after `finish`, in the order of the parts
rows.csv.unfinished        what is run, and its hash; locked by the process that writes; gone with `finish`
rows.csv~                  the table that stood there before the run
rows.parquet.rows.jsonl    to Parquet and Excel's workbooks nothing can be appended: their rows until `finish`
rows.csv.second.jsonl      of parts that were read a second time, what came of it; until `finish`

     open --> add, add, add --> finish          kill, loss of power: the same `open` takes it up again
                           \\--> forget          of a run whose rows are kept elsewhere: nothing stays
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import weakref
from collections.abc import Iterable, Iterator, Mapping, Set
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any

from glyphs.atomic import replacing, sync_names
from glyphs.errors import FileError
from pipeline.common.file_lock import lock
from pipeline.common.parsed import json_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.row import Row
from pipeline.common.run_description import differences, key_of
from pipeline.runs.row_files import RowFile, read_rows
from pipeline.runs.second_readings import SecondReadings
from pipeline.runs.tables import (
    LINE_FORMS,
    WORKBOOK,
    check_output,
    parquet_records,
    record_of_json,
    write_parquet,
    write_records,
)
from pipeline.runs.workbook import write_workbook

FORMAT_VERSION = 3
"""The first had flat JSON lines, and tables without height_px; the second knew no other lines."""


class RunJournal:
    """The rows of one run; for one thread of one process at a time.

    Attributes:
        path: the table.
        description: what is run: plain JSON values.
        resumed: whether a run that broke off was taken up.
        kept: where the table that stood there before went; None where there was none with a row.
    """

    def __init__(self, path: Path, description: Mapping[str, Any]) -> None:
        """Begin a run or take one up; as `open`."""
        check_output(path)
        self.path = path
        self.description = description
        self.resumed = False

        self.kept: Path | None = None
        self._finished = False
        appendable = path.suffix.lower() in LINE_FORMS
        self._rows_path = path if appendable else _beside(path, ".rows.jsonl")
        self._marker_path = _beside(path, ".unfinished")
        with self._faults_told():
            self._marker = _locked(self._marker_path, path)
            try:
                self._rows = self._taken_up()
                self._second = SecondReadings(_beside(path, ".second.jsonl"), keep=self.resumed)
            except BaseException:
                if not os.fstat(self._marker.fileno()).st_size:
                    self._marker_path.unlink(missing_ok=True)
                self._marker.close()
                raise

    @classmethod
    def open(cls, path: Path, description: Mapping[str, Any]) -> RunJournal:
        """Take up the run that broke off there, or begin one.

        Raises:
            FileError: unknown suffix; no place to write; another run writes it, or broke off there; damage.
        """
        return cls(path, description)

    def __enter__(self) -> RunJournal:
        """The book."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()

    @property
    def done(self) -> Set[str]:
        """Names of the parts whose rows are kept; grows with `add`."""
        return self._rows.names

    def add(self, record: ReadingRecord) -> None:
        """Keep a record; of two of one part the first counts, and the second is not written.

        When it returns, the row outlives any end of the process; a loss of power may take the last rows.

        Raises:
            FileError: it cannot be written; the rows before stay.
            ValueError: a record that no table holds, see `pipeline.runs.tables.plain_values`.
        """
        with self._faults_told():
            self._rows.append(record)

    def add_second(self, record: ReadingRecord) -> None:
        """Keep the second reading of a part; the better of the two counts (`recognition.learning.lot.is_better`).

        Raises:
            FileError: it cannot be written.
            ValueError: a record that no table holds.
        """
        with self._faults_told():
            self._second.add(record)

    @property
    def read_again(self) -> Set[str]:
        """Names of the parts that were read a second time."""
        return self._second.names

    def rows(self) -> Iterator[Row]:
        """The rows kept so far, streamed: in the order of the file, after `finish` in the order of the parts.

        After `finish` the rows of a workbook are no longer kept.

        Raises:
            FileError: the file was damaged or replaced meanwhile.
        """
        return read_rows(self.path) if self._finished else self._second.rows(self._rows.rows())

    def first_rows(self) -> Iterator[Row]:
        """As `rows` before `finish`, whatever second readings said."""
        return self._rows.rows()

    def finish(self, order: Iterable[str]) -> None:
        """Put the rows in order, those of parts not named last, and end the run.

        Args:
            order: names of the parts; names without a row are passed over.

        Raises:
            FileError: it cannot be written; the same command takes the run up and ends it.
        """
        numbers = self._rows.numbers_in(order)
        with self._faults_told():
            self._rows.sync()
            # an error of the disk after the end would be told of a run that is whole; and Windows neither removes
            # nor replaces a file that is open
            self._rows.close()
            if self._rows_path != self.path:
                records = map(record_of_json, self._records(numbers))
                with replacing(self.path) as temporary:
                    if self.path.suffix.lower() == WORKBOOK:
                        write_workbook(records, temporary, self.description)
                    else:
                        write_parquet(records, temporary)
                if self.path.suffix.lower() != WORKBOOK:  # what a workbook holds cannot be taken up again
                    self._rows_path.unlink()
            elif self.read_again or not self._rows.holds_just(numbers):
                with replacing(self.path) as temporary, temporary.open("wb") as table:
                    table.write(self._rows.form.head)
                    table.writelines(self._records(numbers))
            self._second.remove()
            self._end()
            if self._rows_path != self.path:
                self._rows_path.unlink(missing_ok=True)
        self._finished = True
        self.close()

    def keep_private(self) -> None:
        """Let nobody but the owner read what is kept; for rows that are no table of the user's.

        Raises:
            FileError: the disk refuses.
        """
        with self._faults_told():
            for path in (self._rows_path, self._marker_path):
                path.chmod(0o600)

    def forget(self) -> None:
        """End the run and remove its rows, for they are kept elsewhere.

        Raises:
            FileError: the disk refuses.
        """
        with self._faults_told():
            self._rows.close()
            self._rows_path.unlink(missing_ok=True)
            self._second.remove()
            self._end()
        self.close()

    def _end(self) -> None:
        sync_names(self.path.parent)
        if os.name == "nt":
            self._marker.close()  # which does not remove a file that is open
        self._marker_path.unlink()  # last: broken off anywhere before, the run is taken up and ended again

    def _records(self, numbers: Iterable[int]) -> Iterator[bytes]:
        return self._second.records(self._rows.records(numbers), self._rows.form)

    def close(self) -> None:
        """Let go of the table; a run that is not finished can be taken up again.

        Raises:
            FileError: it cannot be written.
        """
        try:
            with self._faults_told():
                self._rows.close()
                self._second.close()
        finally:
            self._marker.close()

    def _taken_up(self) -> RowFile:
        held = self._held()
        if held is None:
            self._make_place()
        else:
            self._check_same(held)
            self.resumed = True
            if self._rows_path != self.path and self.path.exists() and not self._rows_path.exists():
                write_records(parquet_records(self.path), self._rows_path)  # broke off within `finish`
        rows = RowFile(self._rows_path)
        try:
            sync_names(self.path.parent)
            if held is None:
                # only now: until here, what stands there may be the table before the run
                self._marker.write(self._heading())
                os.fsync(self._marker.fileno())
        except BaseException:
            rows.close()
            raise
        return rows

    def _held(self) -> Mapping[str, Any] | None:
        """What the marker tells; None where it is new, or its run had no row yet."""
        self._marker.seek(0)
        text = self._marker.read()
        try:
            held = json_of(text)
        except ValueError:
            held = None
        if isinstance(held, dict):
            if held.get("format_version", FORMAT_VERSION) != FORMAT_VERSION:
                what = "is of a run of another version of the program, whose rows are kept otherwise"
                raise FileError(self._marker_path, what, self._hint())
            if isinstance(held.get("description"), dict):
                return held
        if text and self._has_rows(self._rows_path):
            raise FileError(self._marker_path, "is damaged", self._hint())
        self._marker.truncate(0)
        return None

    def _check_same(self, held: Mapping[str, Any]) -> None:
        if held.get("key") == key_of(self.description):
            return
        what = differences(held["description"], self.description)
        raise FileError(self.path, f"is of another run, not finished ({what})", self._hint())

    def _make_place(self) -> None:
        for path in {self._rows_path: None, self.path: None}:
            if self._has_rows(path):
                self.kept = _beside(path, "~")
                os.replace(path, self.kept)
            else:
                path.unlink(missing_ok=True)

    def _has_rows(self, path: Path) -> bool:
        # what is no longer than a head is left by a run that broke off as it began: no reason to lose a table kept
        form = LINE_FORMS.get(path.suffix.lower())
        return path.exists() and path.stat().st_size > len(form.head if form else b"")

    def _heading(self) -> bytes:
        heading = {
            "format_version": FORMAT_VERSION,
            "description": dict(self.description),
            "key": key_of(self.description),
        }
        return (json.dumps(heading, indent=1) + "\n").encode()

    @contextlib.contextmanager
    def _faults_told(self) -> Iterator[None]:
        """Tell an OSError, and what `replacing` made of one, as what it means to the run."""
        try:
            yield
        except (OSError, FileError) as problem:
            fault = problem.__cause__ if isinstance(problem, FileError) else problem
            if not isinstance(fault, OSError):
                raise
            full = fault.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
            hint = "make room" if full else "see to the disk and its permissions"
            what = f"cannot be written ({fault.strerror or fault})"
            raise FileError(self.path, what, f"{hint} and start the same command again") from fault

    def _hint(self) -> str:
        return f"name another file, or remove {self._marker_path.name} to start again"


_HELD: weakref.WeakSet[FileIO] = weakref.WeakSet()


def _let_go() -> None:
    # a lock is its holder's and its children's: a worker that outlives a killed run would keep the next one out
    for marker in tuple(_HELD):
        marker.close()


if hasattr(os, "register_at_fork"):  # Windows forks no process
    os.register_at_fork(after_in_child=_let_go)


def _locked(marker: Path, table: Path) -> FileIO:
    """The marker, made if it is missing, locked by this process alone."""
    while True:
        stream: FileIO = open(marker, "a+b", buffering=0)  # noqa: SIM115
        try:
            if not lock(stream.fileno(), wait=False):
                raise FileError(table, "is being written by another run", "wait for it or name another file")
            if os.path.samestat(os.fstat(stream.fileno()), os.stat(marker)):
                _HELD.add(stream)
                return stream
        except FileNotFoundError:
            pass
        except BaseException:
            stream.close()
            raise
        stream.close()  # the run before removed it as it ended


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(path.name + ending)
