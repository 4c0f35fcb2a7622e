"""What runs are tested with: an executor that reads nothing, a progress that counts, tables read as by any program."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pyarrow.parquet

from glyphs.errors import FileError
from pipeline.common.output_paths import check_writable
from pipeline.common.reading_records import CandidateRecord, ReadingRecord, from_json
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from pipeline.runs.progress import Progress
from pipeline.runs.tables import SUFFIXES, form_of, write_table
from pipeline.workers.executors import Executor, Outcome

# -------------------------------------------------------------------------------------------------------- run tables

_BEST = tuple(f.name for f in fields(CandidateRecord))
_WORD = re.compile(r"\\u(0000|005c|d[89a-f][0-9a-f]{2})")


@dataclass(frozen=True)
class TableRow:
    """A row of a table: its columns as they are in the file, and some of them as they were."""

    part: str
    text: str
    decision: str
    error: str
    columns: dict[str, Any]


def plain(value: Any) -> Any:
    """A value with the words for characters that UTF-8 lacks turned back."""
    if isinstance(value, str):
        return _WORD.sub(lambda m: chr(int(m[1], 16)), value)
    if isinstance(value, dict):
        return {name: plain(v) for name, v in value.items()}
    return [plain(v) for v in value] if isinstance(value, list) else value


def read_rows(path: Path) -> list[TableRow]:
    """The rows of a table, in its order.

    Raises:
        FileError: it is no such table.
    """
    try:
        if path.suffix == ".parquet":
            found = pyarrow.parquet.read_table(path).to_pylist()
        elif path.suffix == ".jsonl":
            found = [json.loads(line) for line in path.read_bytes().splitlines()]
        else:
            found = csv_rows(path)
        return [
            TableRow(*(plain(r[name]) for name in ("part", "text", "decision", "error")), r) for r in found
        ]
    except (OSError, ValueError, KeyError) as error:
        raise FileError(path, f"is no table ({error})", "look at it") from error


def write_records(records: Iterable[ReadingRecord], path: Path) -> None:
    """Write a table of records."""
    check_writable(path, SUFFIXES)
    write_table(map(form_of(path).encode, records), path)


def record_of_json(line: bytes) -> ReadingRecord:
    """The record of a JSON line."""
    return record_of(json.loads(line))


def record_of(values: dict[str, Any]) -> ReadingRecord:
    """The record of a row with lists and structs."""
    values = plain(values)
    for place in values["characters"]:
        best, others = {name: place.pop(name) for name in _BEST}, place.pop("alternatives")
        place["candidates"] = [best, *others] if best["char"] else []
    return from_json(ReadingRecord, values)


# --------------------------------------------------------------------------------------------------------- csv table


def csv_rows(path: Path | str) -> list[dict[str, str]]:
    """The rows of a CSV table, by column."""
    with Path(path).open(newline="", encoding="utf-8-sig") as stream:
        return list(csv.DictReader(stream))


# ----------------------------------------------------------------------------------------------------- fake executor


class FakeExecutor(Executor):
    """Has an answer to every part, and breaks off after some.

    Attributes:
        read: names of the parts that were asked for.
    """

    def __init__(
        self,
        answer: Callable[[PartFiles, PartJob], ReadPart | Exception],
        *,
        breaks_after: int = 99,
        backwards: bool = False,
    ) -> None:
        self.answer, self.breaks_after, self.backwards = answer, breaks_after, backwards
        self.read = list[str]()

    def calls(
        self, function: Callable[[Any, Any], Any], job: PartJob, tasks: Iterable[PartFiles]
    ) -> Iterator[Outcome[Any, Any]]:
        for part in reversed(list(tasks)) if self.backwards else tasks:
            if len(self.read) == self.breaks_after:
                raise KeyboardInterrupt
            self.read.append(part.name)
            answer = self.answer(part, job)
            failed = isinstance(answer, Exception)
            yield Outcome(part, error=answer) if failed else Outcome(part, answer)


# ----------------------------------------------------------------------------------------------------------- counted


class Counted(Progress):
    """Counts parts; as an interrupt it ends the run after so many."""

    def __init__(self, *, stop_after: int | None = None) -> None:
        self.starts: list[tuple[int, int]] = []
        self.parts, self.failed, self._stop_after = 0, 0, stop_after

    def start(self, total: int, done: int = 0) -> None:
        self.starts.append((total, done))

    def advance(self, *, failed: bool = False) -> None:
        self.parts, self.failed = self.parts + 1, self.failed + failed
        if self.parts == self._stop_after:
            raise KeyboardInterrupt
