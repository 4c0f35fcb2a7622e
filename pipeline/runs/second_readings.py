"""What came of parts that were read a second time: in a file of its own beside the table, until the run is finished.

    first rows (RowFile) ----+--is_better--> the row that counts
    second readings ---------+

The first rows are never touched before the end: whatever breaks off the second pass, the lot teaches itself from the
same readings again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from pathlib import Path

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.row import Row
from pipeline.runs.row_files import RowFile
from pipeline.runs.tables import LineForm, record_of_json
from recognition.learning.lot import is_better


class SecondReadings:
    """The second readings of a run; the file is made with the first of them.

    Attributes:
        path: a JSON lines file.
    """

    def __init__(self, path: Path, *, keep: bool) -> None:
        """Take up what is there, or begin.

        Args:
            path: a JSON lines file.
            keep: go on with what is there; else it is removed.

        Raises:
            FileError: it is damaged before its last record.
            OSError: it cannot be written.
        """
        self.path = path
        if not keep:
            path.unlink(missing_ok=True)
        self._file = RowFile(path) if path.exists() else None

    @property
    def names(self) -> Set[str]:
        """Parts that were read a second time."""
        return self._file.names if self._file is not None else frozenset()

    def add(self, record: ReadingRecord) -> None:
        """Keep a second reading.

        Raises:
            FileError: another program replaced the file.
            OSError: it cannot be written.
            ValueError: a record that no table holds.
        """
        if self._file is None:
            self._file = RowFile(self.path)
        self._file.append(record)

    def of(self, first: Row) -> ReadingRecord | None:
        """The second reading of a part, where it is better than the first."""
        if self._file is None or first.part not in self._file.names:
            return None
        second = record_of_json(self._file.record_of(first.part))
        return second if is_better(second, first) else None

    def rows(self, first: Iterable[Row]) -> Iterator[Row]:
        """Of every row that or, where that is better, the second."""
        for row in first:
            second = self.of(row)
            yield row if second is None else Row.of(second)

    def records(self, first: Iterable[bytes], form: LineForm) -> Iterator[bytes]:
        """The same of rows as a file of that form holds them."""
        if self._file is None:
            yield from first
            return
        for data in first:
            second = self.of(form.decode(data))
            yield data if second is None else form.encode(second)

    def close(self) -> None:
        """Bring it to the disk.

        Raises:
            OSError: it cannot be written.
        """
        if self._file is not None:
            self._file.close()

    def remove(self) -> None:
        """The table has them now."""
        if self._file is not None:
            self._file.close()
            self._file = None
        self.path.unlink(missing_ok=True)
