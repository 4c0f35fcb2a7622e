"""Files to which records are appended one by one, and which are read back whatever ended the program that wrote."""

from __future__ import annotations

import contextlib
import os
import time
from array import array
from collections.abc import Iterable, Iterator, Set
from io import FileIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from glyphs.errors import FileError
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.row import Row
from pipeline.runs.tables import LINE_FORMS, LineForm, parquet_records

_MOST_RECORD_BYTES = 1 << 24  # more than all texts of a row take, escaped
_SYNC_S = 1.0


class Record(NamedTuple):
    """One whole record of a file.

    Attributes:
        start: byte at which it begins.
        line: number of its first line, from 1.
        data: with its end.
    """

    start: int
    line: int
    data: bytes


class RowFile:
    """A CSV or JSON lines file that grows by a row at a time; of two rows of one part the first counts.

    A row is handed to the kernel before `append` returns, so it outlives any end of the process. The disk is made to
    write once a second at most: a loss of power may take the last rows. A last record that does not end is cut off.

    Attributes:
        path: the file.
        form: how it holds rows.
    """

    def __init__(self, path: Path) -> None:
        """Take up the file, or make it.

        Raises:
            FileError: it is damaged before its last record; tells the line.
            OSError: it cannot be written.
        """
        self.path = path
        self.form = LINE_FORMS[path.suffix.lower()]
        self._numbers: dict[str, int] = {}
        self._starts = array("q")
        self._end = 0
        self._straight = True  # no record in the file but those counted
        if path.exists():
            self._read_back()
        self._stream: FileIO = open(path, "ab", buffering=0)  # noqa: SIM115
        try:
            if self._end < len(self.form.head):
                self._write(self.form.head)
                self._end = len(self.form.head)
            self.sync()
        except BaseException:
            self._stream.close()
            raise

    @property
    def names(self) -> Set[str]:
        """Parts whose rows are kept; grows with `append`."""
        return self._numbers.keys()

    def append(self, record: ReadingRecord) -> None:
        """Keep a record, unless there is one of its part.

        Raises:
            FileError: another program replaced the file.
            OSError: it cannot be written; nothing of it stays.
            ValueError: a record that no table holds, see `pipeline.runs.tables.plain_values`.
        """
        if record.part in self._numbers:
            return
        line = self.form.encode(record)
        self._write(line)
        self._starts.append(self._end)
        self._numbers[record.part] = len(self._numbers)
        self._end += len(line)
        if time.monotonic() >= self._synced_s + _SYNC_S:
            self.sync()

    def rows(self) -> Iterator[Row]:
        """The rows kept when it begins, in the order of the file, streamed.

        Raises:
            FileError: the file was damaged or replaced meanwhile.
        """
        number, kept = 0, len(self._starts)
        with self._reading() as stream:
            for record in whole_records(stream, self.form, self.path):
                if number == kept:
                    return
                row = row_of_record(record, self.form, self.path)
                if record.start == self._starts[number] and row is not None:
                    number += 1
                    yield row

    def numbers_in(self, order: Iterable[str]) -> array[int]:
        """Places of the rows in the file, from 0: of the parts named, in that order, then of the others."""
        left = bytearray(b"\1") * len(self._starts)
        numbers = array("q")
        for name in order:
            number = self._numbers.get(name)
            if number is not None and left[number]:
                left[number] = 0
                numbers.append(number)
        numbers.extend(number for number, is_left in enumerate(left) if is_left)
        return numbers

    def holds_just(self, numbers: Iterable[int]) -> bool:
        """Whether the file is its head and these rows, in this order."""
        return self._straight and all(number == place for place, number in enumerate(numbers))

    def records(self, numbers: Iterable[int]) -> Iterator[bytes]:
        """The records of the rows at these places, without their head.

        Raises:
            FileError: the file was replaced or shortened meanwhile.
        """
        with self._reading() as stream:
            for number in numbers:
                stream.seek(self._starts[number])
                data = read_record(stream, self.form)
                if not self.form.ended(data):
                    raise self._taken()
                yield data

    def record_of(self, name: str) -> bytes:
        """The record of a part whose row is kept.

        Raises:
            FileError: the file was replaced or shortened meanwhile.
        """
        return next(self.records((self._numbers[name],)))

    def sync(self) -> None:
        """Have the disk write what it was given.

        Raises:
            FileError: another program replaced the file.
            OSError: it cannot be written.
        """
        os.fsync(self._stream.fileno())
        self._check_ours()
        self._synced_s = time.monotonic()

    def close(self) -> None:
        """Have it written, and close it.

        Raises:
            OSError: it cannot be written.
        """
        if not self._stream.closed:
            with self._stream:
                os.fsync(self._stream.fileno())

    def _read_back(self) -> None:
        with self.path.open("rb+") as stream:
            for record in whole_records(stream, self.form, self.path):
                row = row_of_record(record, self.form, self.path)
                self._end = record.start + len(record.data)
                if row is None:
                    continue
                if row.part in self._numbers:
                    self._straight = False
                    continue
                self._numbers[row.part] = len(self._numbers)
                self._starts.append(record.start)
            stream.truncate(self._end)

    def _write(self, record: bytes) -> None:
        rest = memoryview(record)
        try:
            while rest:
                rest = rest[self._stream.write(rest) :]
        except BaseException:
            with contextlib.suppress(OSError, ValueError):
                self._stream.truncate(self._end)
            raise

    @contextlib.contextmanager
    def _reading(self) -> Iterator[BinaryIO]:
        with self.path.open("rb") as stream:
            if not self._stream.closed:
                self._check_ours()
            yield stream

    def _check_ours(self) -> None:
        """Refuse to go on with a file that a spreadsheet, say, has saved another in place of."""
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(self._stream.fileno()), os.stat(self.path)):
                return
        raise self._taken()

    def _taken(self) -> FileError:
        return FileError(
            self.path,
            "was replaced, shortened or removed by another program",
            "close what has it open and start the same command again",
        )


def read_rows(path: Path) -> Iterator[Row]:
    """The rows of a table that `pipeline.runs.tables.write_records` or a finished run wrote, streamed.

    Raises:
        FileError: the table is damaged.
    """
    form = LINE_FORMS.get(path.suffix.lower())
    if form is None:
        yield from map(Row.of, parquet_records(path))
        return
    with path.open("rb") as stream:
        for record in whole_records(stream, form, path):
            if (row := row_of_record(record, form, path)) is not None:
                yield row


def read_record(stream: BinaryIO, form: LineForm) -> bytes:
    """The record that begins where the stream stands, or what there is of it; empty at the end."""
    data = stream.readline(_MOST_RECORD_BYTES)
    if form.ended(data) or not form.quoted:
        return data
    lines, length, quotes = [data], len(data), data.count(b'"')
    while quotes % 2 and length < _MOST_RECORD_BYTES and (data := stream.readline(_MOST_RECORD_BYTES)):
        lines.append(data)
        length += len(data)
        quotes += data.count(b'"')
    return b"".join(lines)


def whole_records(stream: BinaryIO, form: LineForm, path: Path) -> Iterator[Record]:
    """The records of a file from its start, its head among them; a last one that does not end is left out.

    Raises:
        FileError: what does not end is no last record: later lines are rows.
    """
    start, line = 0, 1
    while data := read_record(stream, form):
        if len(data) >= _MOST_RECORD_BYTES:
            raise _damaged(path, line, "longer than any row")
        if not form.ended(data):
            if any(_is_row(later, form) for later in data.splitlines(keepends=True)[1:]):
                raise _damaged(path, line, "a quote is not closed")
            return
        yield Record(start, line, data)
        start += len(data)
        line += data.count(b"\n")


def row_of_record(record: Record, form: LineForm, path: Path) -> Row | None:
    """The row of a record; None for the head.

    Raises:
        FileError: the record is neither; tells the line.
    """
    if form.head and record.start == 0:
        if record.data.rstrip() != form.head.rstrip():
            raise FileError(path, "line 1 does not name the columns of this version", "name another file")
        return None
    try:
        return form.decode(record.data)
    except ValueError as error:
        raise _damaged(path, record.line, str(error)[:200]) from error


def _is_row(data: bytes, form: LineForm) -> bool:
    try:
        form.decode(data)
    except ValueError:
        return False
    return True


def _damaged(path: Path, line: int, reason: str) -> FileError:
    return FileError(path, f"line {line} is damaged ({reason})", "remove that line; its part is read again")
