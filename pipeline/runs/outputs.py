"""Where the results of a run are kept: a journal, with a table that grows beside it, or the service's store.

rows.csv                   rows as they come; after `export` complete and in the order of the parts
rows.csv.unfinished        the journal: a description of the run and a result for every part done; `export` removes it
rows.csv~                  the previous table of that name
rows.quarantine.csv        the parts that could not be read: a manifest, to be corrected and read again

Parquet and workbooks are written by `export`. A resumed run writes the table again from the lines in the journal.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from io import RawIOBase
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from glyphs.atomic import replacing
from glyphs.errors import MissingExtraError
from pipeline.common import output_paths
from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.errors import describe_fault
from pipeline.formats.manifest import COLUMNS, SEVERAL
from pipeline.formats.part_files import PartFiles, absolute
from pipeline.reading.triage import ReadPart
from pipeline.runs.journal import Journal, as_blob, as_text, set_aside, writing
from pipeline.runs.lot import Outline, is_better
from pipeline.runs.tables import SUFFIXES, WORKBOOK, form_of, grows, write_table
from pipeline.runs.workbook import write_workbook

if TYPE_CHECKING:
    from pipeline.common.serial_rules import Objection

STORE_SCHEMES = ("sqlite:///", "postgresql://", "postgresql+")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


def unfinished(table: Path) -> Path:
    """The journal of a run that writes this table."""
    return table.with_name(f"{table.name}.unfinished")


def has_rows(table: Path) -> bool:
    """Whether a table exists and holds more than its headings."""
    return table.exists() and table.stat().st_size > (len(form_of(table).head) if grows(table) else 0)


class Row(NamedTuple):
    """The reading of a part that counts: what a lot's passes go by, the result, and its line of a growing table."""

    outline: Outline
    result: str
    line: bytes


class RunJournal(Journal[ReadPart]):
    """The results of one run, and the table (if `written`) that grows with them, for one thread at a time."""

    kind: ClassVar[str] = "run"
    version: ClassVar[int] = 6
    keeps: ClassVar[Any] = ReadPart
    facts: ClassVar[tuple[str, ...]] = ("decision", "text", "confidence", "error", "line")

    def __init__(self, table: Path, description: Mapping[str, Any] | None, *, written: bool = True) -> None:
        """Raise FileError: the suffix is unknown, the table is another run's, or it cannot be written."""
        if written:
            output_paths.check_writable(table, SUFFIXES)
        self.table, self.written, self._form = table, written, form_of(table)
        self.previous: Path | None = None
        self._growing: RawIOBase | None = None
        self._lines: dict[str, bytes] = {}
        super().__init__(unfinished(table), description, output=table)
        if written and grows(table):
            try:
                write_table((row.line for row in self._rows()), table)
                self._growing = table.open("ab", buffering=0)
            except BaseException:
                self.close()
                raise

    def keep_all(self, results: Mapping[str, ReadPart], *, again: bool = False) -> Mapping[str, ReadPart]:
        self._lines, stored = {}, dict(results)
        for name, read in results.items() if self.written else ():
            try:
                self._lines[name] = self._form.encode(read.record)
            except ValueError as error:
                problem = f"{name}: {describe_fault(error)}; please report it"
                stored[name] = ReadPart((ReadingRecord.failed(name, problem),))
                self._lines[name] = self._form.encode(stored[name].record)
        super().keep_all(stored, again=again)
        if self._growing is not None and not again:
            lines = b"".join(self._lines.values())
            with self._faults():
                while lines:  # unbuffered: the kernel has all lines before this returns
                    lines = lines[self._growing.write(lines) or 0 :]
        return stored

    def facts_of(self, name: str, result: ReadPart) -> Sequence[Any]:
        record = result.record
        decision, text, error = map(as_blob, (record.decision, record.text, record.error))
        line = self._lines[name] if self._growing is not None else b""
        return decision, text, record.confidence, error, line

    def outlines(self) -> Iterator[tuple[Outline, Outline | None]]:
        """Stream what the passes over a lot go by: of the first reading of every part, and of the second."""
        for row in self.rows("name", *self.facts[:4]):
            yield _outline(row[:5]), None if row[5] is None else _outline(row[5:])

    def errors(self) -> dict[str, str]:
        return {first.part: first.error for first, _ in self.outlines() if first.error}

    def better(self, order: Iterable[str] = ()) -> Iterator[Outline]:
        return (row.outline for row in self._rows(order))

    def records(self, order: Iterable[str] = ()) -> Iterator[ReadingRecord]:
        return (self.parse(row.result).record for row in self._rows(order))

    def _rows(self, order: Iterable[str] = ()) -> Iterator[Row]:
        width = 7
        for row in self.rows("name", *self.facts[:4], "kept", "line", order=order):
            first = Row(_outline(row[:5]), *row[5:width])
            second = None if row[width] is None else Row(_outline(row[width : width + 5]), *row[width + 5 :])
            yield second if second is not None and is_better(second.outline, first.outline) else first

    def keep_private(self) -> None:
        with self._faults():
            for path in self.path.parent.glob(f"{self.path.name}*"):
                path.chmod(0o600)

    def close(self) -> None:
        self.close_table()
        super().close()

    def close_table(self) -> None:
        """Windows does not replace a file that is open."""
        if self._growing is not None:
            self._growing.close()

    def lines(self, order: Iterable[str], final: Callable[[ReadingRecord], ReadingRecord]) -> Iterator[bytes]:
        """Stream the lines of the table, as they were written or, where `final` changes the record, anew."""
        for row in self._rows(order):
            stored = self.parse(row.result).record
            record = final(stored)
            yield row.line if row.line and record is stored else self._form.encode(record)

    def _begin(self) -> None:
        # a file with only a header is left by a run that stopped at once; it must not replace a table set aside
        if self.written:
            self.previous = set_aside(self.table, head=self._form.head if grows(self.table) else b"")
        super()._begin()


def export(
    journal: RunJournal,
    order: Iterable[str],
    final: Callable[[ReadingRecord], ReadingRecord] = lambda record: record,
) -> None:
    """Write the table of a run in order, unnamed parts last, by the records that `final` makes, and end the run. Raises
    FileError; the same command resumes the run."""
    journal.close_table()
    with writing(journal.table):
        if journal.table.suffix.lower() == WORKBOOK:
            with replacing(journal.table) as temporary:
                write_workbook(map(final, journal.records(order)), temporary, journal.description)
        else:
            write_table(journal.lines(order, final), journal.table)
    journal.remove()


def _outline(cells: Sequence[Any]) -> Outline:
    name, decision, text, confidence, error = cells
    # SQLite stores no number that is not finite
    return Outline(as_text(name), as_text(decision), as_text(text), confidence or 0.0, as_text(error))


def write_quarantine(path: Path, bad: Iterable[tuple[PartFiles, str]]) -> None:
    """Write the list of parts that could not be read with their problems; without parts remove it."""
    rows = [_quarantined(part, problem) for part, problem in bad]
    with writing(path):
        if rows:
            output_paths.write_table(path, [(*COLUMNS, "problem"), *rows])
        else:
            path.unlink(missing_ok=True)


def _quarantined(part: PartFiles, problem: str) -> list[str]:
    height_map, scan, *photos = map(absolute, (part.height_map, part.scan, *part.photos))
    if not part.files and part.problem is not None:
        height_map = absolute(str(part.problem.path))
    files = (height_map, scan, SEVERAL.join(photos))
    cells = (part.name.strip(), *files, part.expected, part.format, part.font, problem)
    return [_CONTROL.sub("?", cell) for cell in cells]  # the table must have one line a part


class RunStore:
    """A store that keeps each part of a run once, known by run, name and files, even if the run is repeated."""

    def __init__(self, url: str, run: str, *, evidence: Path | None = None) -> None:
        """Open the store for a run; `run` is a hash of everything that its readings depend on. Raises StoreError,
        FileError: it cannot be opened. MissingExtraError: the extra `service` is not installed."""
        try:
            from pipeline.store.evidence_folder import EvidenceFolder
            from pipeline.store.store import Store
        except ModuleNotFoundError as error:
            raise MissingExtraError("a store", error.name or "sqlalchemy", "service") from error
        self._run = run
        self._folder = EvidenceFolder(evidence) if evidence is not None else None
        self._store = Store.open(url)

    def close(self) -> None:
        self._store.close()

    def keep(self, part: PartFiles, read: ReadPart) -> bool:
        """Store a part that could be read; whether it is new. Raises ValueError: no store can hold a text.
        FileError: a picture cannot be kept."""
        from pipeline.store.errors import MAX_TEXT, AlreadyDoneError, cleaned
        from pipeline.store.parts import IdempotencyKey

        if read.record.error:
            return True
        accepted = read.state is PartState.ACCEPTED
        text = cleaned(part.name)[:MAX_TEXT]
        try:
            self._store.add_part(
                part_id=new_part_id(),
                name=text,
                # no stage can scan it any more
                state=PartState.ACCEPTED if accepted else PartState.REVIEW,
                readings=(replace(read.record, part=text),),
                evidence=() if self._folder is None else self._folder.keep_pictures(read.pictures),
                expected=part.expected,
                database=read.record.database,
                idempotency=IdempotencyKey.of_run(self._run, part.name, read.sha256),
            )
        except AlreadyDoneError:
            return False
        return True

    def send_to_review(self, record: ReadingRecord, objection: Objection) -> None:
        from pipeline.store.errors import MAX_TEXT, cleaned

        name = cleaned(record.part)[:MAX_TEXT]
        self._store.send_to_review(name=name, text=cleaned(record.text), objection=objection)
