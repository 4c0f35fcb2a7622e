"""Write an Excel workbook of a run: a short sheet for people first, then everything.

Parts        part, serial, decision, why it is not accepted: one line per part. A person fills in the right serial where
             it was checked; `enroll --truth` and `read --truth` take the workbook then
All columns  the columns of the CSV
Characters   one line per character, with its candidates and their probabilities side by side
Run          time, program and settings
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

from glyphs.errors import FileError
from glyphs.plain_text import visible
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import NamedLine
from pipeline.runs.read_table import notes
from pipeline.runs.tables import CSV_COLUMNS, WORKBOOK, csv_cells

MOST_PARTS = 1_048_575  # lines of a sheet below its headings, a limit of Excel
# characters of a cell, a limit of Excel
_MOST_TEXT = 32_767
_CANDIDATES = 5
_BEFORE, _AFTER = (
    ("Part", "Serial", "Right serial", "Decision", "Confidence"),
    ("Expected", "Verdict", "Depth mm", "Why"),
)
_WIDTHS = {"Part": 28, "Decision": 11, "Confidence": 12, "Verdict": 11, "Depth mm": 10, "Why": 90}
_USUAL_WIDTH = 18
_CHARACTERS = (
    "Part", "Place", "Read", "Probability",
    *(name for k in range(2, _CANDIDATES + 1) for name in (f"Candidate {k}", f"Probability {k}")),
    "State", "Grade", "Action", "Shallowest mm", "Mean depth mm", "Depth sd mm",
)  # fmt: skip
_COLOURS = {"accept": "C6EFCE", "review": "FFEB9C", "reject": "FFC7CE", "error": "FFC7CE"}
_UNSAFE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def check_number(path: Path, parts: int) -> None:
    """Refuse, before the work starts, more parts than a workbook can hold. Raises FileError: there are more."""
    if path.suffix.lower() == WORKBOOK and parts > MOST_PARTS:
        raise FileError(
            path, f"can hold {MOST_PARTS:,} parts, but there are {parts:,}", "end it in .csv or .parquet"
        )


def write_workbook(records: Iterable[ReadingRecord], path: Path, about: Mapping[str, Any]) -> None:
    """Write at most `MOST_PARTS` records, which wait on the disk, with facts of the run (`settings` is nested). Raises
    OSError. ValueError: no table can hold a record."""
    from openpyxl import Workbook

    book = Workbook(write_only=True)
    names = [NamedLine.parse(line).name for line in about.get("settings", {}).get("line", ())]
    headings = (*_BEFORE, *names, *_AFTER)
    parts = _Sheet(book, "Parts", headings, widths=[_WIDTHS.get(name, _USUAL_WIDTH) for name in headings])
    columns = _Sheet(book, "All columns", CSV_COLUMNS)
    characters = _Sheet(book, "Characters", _CHARACTERS)
    times: list[datetime] = []
    for record in records:
        if record.at is not None:
            times = [min([*times, record.at]), max([*times, record.at])]
        decision = record.decision or "error"
        confidence = None if record.error else record.confidence
        why = record.error or notes(record)
        texts = {line.name: line.text for line in record.lines}
        row = csv_cells(record)
        depth_mm = row[CSV_COLUMNS.index("depth_min_mm")]
        parts.add(
            (
                record.part, record.text, None, decision, confidence, *(texts.get(name) for name in names),
                record.expected, record.verdict, depth_mm, why,
            ),
            decision=decision,
        )  # fmt: skip
        columns.add(row)
        for cells in _characters(record):
            if characters.lines < MOST_PARTS:
                characters.add(cells)
    run = _Sheet(book, "Run", ("What", "Value"), widths=(24, 100))
    for line in _about(about, times):
        run.add(line)
    for sheet in (parts, columns, characters):
        sheet.close()
    book.save(path)


class _Sheet:
    def __init__(self, book: Any, title: str, headings: Sequence[str], *, widths: Sequence[int] = ()) -> None:
        from openpyxl.styles import Font, PatternFill
        from openpyxl.utils import get_column_letter

        self.lines, self._width = 0, len(headings)
        self._sheet = book.create_sheet(title)
        self._sheet.freeze_panes = "A2"
        self._last = get_column_letter(len(headings))
        for place, width in enumerate(widths or [14] * len(headings), start=1):
            self._sheet.column_dimensions[get_column_letter(place)].width = width
        self._fills = {word: PatternFill("solid", fgColor=colour) for word, colour in _COLOURS.items()}
        bold = Font(bold=True)
        cells = [self._cell(heading) for heading in headings]
        for cell in cells:
            cell.font = bold
        self._sheet.append(cells)

    def add(self, values: Sequence[Any], *, decision: str = "") -> None:
        cells = [self._cell(value) for value in values]
        for cell, value in zip(cells, values, strict=True):
            if decision and value == decision:
                cell.fill = self._fills.get(decision, self._fills["review"])
        self._sheet.append(cells)
        self.lines += 1

    def close(self) -> None:
        self._sheet.auto_filter.ref = f"A1:{self._last}{self.lines + 1}"

    def _cell(self, value: Any) -> Any:
        from openpyxl.cell import WriteOnlyCell

        if not isinstance(value, str):
            cell = WriteOnlyCell(self._sheet, value=value)
            if isinstance(value, float):
                cell.number_format = "0.0000"
            return cell
        text = _UNSAFE.sub(lambda match: visible(match[0]), value)[:_MOST_TEXT]
        cell = WriteOnlyCell(self._sheet, value=text or None)
        if text:
            cell.data_type, cell.number_format = "s", "@"  # text, whatever it begins with
        return cell


def _characters(record: ReadingRecord) -> Iterator[tuple[Any, ...]]:
    for number, place in enumerate(record.characters, start=1):
        candidates: list[Any] = []
        for candidate in islice(place.candidates, _CANDIDATES):
            candidates += [candidate.char, candidate.probability]
        candidates += [None] * (2 * _CANDIDATES - len(candidates))
        yield (
            record.part, number, *candidates,
            place.state, place.grade, place.action, place.depth_min_mm, place.depth_mean_mm, place.depth_sd_mm,
        )  # fmt: skip


def _about(about: Mapping[str, Any], times: Sequence[datetime]) -> Iterator[tuple[str, str]]:
    settings = about.get("settings", {})
    for name, time in zip(("first part read", "last part read"), times, strict=False):
        yield name, time.isoformat(timespec="seconds")
    yield "written", datetime.now(UTC).isoformat(timespec="seconds")
    for name, value in about.items():
        if name != "settings" and value:
            yield name, _text(value)
    for name, value in settings.items():
        yield f"setting {name}", _text(value)
    yield "all other settings", "defaults"


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
