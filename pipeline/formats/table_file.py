"""Read the tables of users: workbooks, and every form of CSV that spreadsheets write."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any, TextIO

from pipeline.common.texts import INVISIBLE, unescape_formula
from pipeline.errors import DataError
from pipeline.formats.zip_checks import check_zip

PART_HEADINGS = ("part", "file", "filename", "name", "part_id", "teil", "bauteil", "datei", "dateiname")
"""Columns that name a part; the first of them in a table counts."""
RIGHT_SERIAL = "right_serial"  # column of our workbooks in which a person writes what a part really reads
TEXT_HEADINGS = (
    *(RIGHT_SERIAL, "text", "serial", "serials", "serial_number", "expected", "truth", "label"),
    *("seriennummer", "seriennr"),
)
"""Columns with the text of a part; the first of them in a table counts."""
_DELIMITERS = ",;\t"
_SEPARATOR_LINE = re.compile(r'\s*"?sep=([^"\r\n])"?[\s,;]*', re.IGNORECASE)
# ="000123" keeps a spreadsheet from taking a serial for a number; 1.23457E+11 is what it makes of one otherwise
_KEPT_AS_TEXT, _ROUNDED = re.compile(r'="([^"]*)"'), re.compile(r"\d[.,]?\d*[eE]\+\d+")
# characters and cells; more than any line of a table has, so that a file without line ends is not loaded whole
_MOST_LINE, _MOST_CELLS = 1_000_000, 16_384
# bytes from which the encoding is detected, and lines from which the delimiter is
_SAMPLE_BYTES, _SAMPLE_LINES = 4096, 20
_OLD_WORKBOOK = b"\xd0\xcf\x11\xe0"
_MOST_SHEET_BYTES = 1_000_000_000
# a sheet has no more rows; a file of some kB can state one of two thousand million, with all rows before it empty
_MOST_ROWS = 1_048_576
# a number of a sheet has 15 digits; a longer serial in it has been rounded
_EXACT_NUMBERS = 10**15


@dataclass(frozen=True, slots=True)
class TableLine:
    """A line of a table that is not blank: its number in the file, from 1, and its cells without blanks around them."""

    number: int
    cells: tuple[str, ...]

    def cell(self, place: int) -> str:
        return self.cells[place] if place < len(self.cells) else ""


def table_lines(
    path: Path, *, comments: bool = False, delimiter: str = "", skip_lines: int = 0
) -> Iterator[TableLine]:
    """Read the lines of a table, headings (if any) included; one line is in memory at a time.

    Bytes that are not UTF-8 are read as Windows-1252. Lines are only skipped at the start where the delimiter is given
    (default: detected), those with # (`comments`) anywhere. Raises DataError, with the line: it is no table.
    """
    with path.open("rb") as start:
        head = start.read(_SAMPLE_BYTES)
    lines = (
        _sheet_lines(path)
        if head.startswith(b"PK\x03\x04")
        else _csv_lines(path, head, delimiter, skip_lines, comments)
    )
    for line in lines:
        if len(line.cells) > _MOST_CELLS:
            raise DataError(f"has over {_MOST_CELLS:,} cells in line {line.number}", "give a table")
        if any(line.cells) and not (comments and line.cells[0].startswith("#")):
            yield line


def _csv_lines(
    path: Path, head: bytes, delimiter: str, skip_lines: int, comments: bool
) -> Iterator[TableLine]:
    number, encoding = skip_lines, encoding_of(head)
    if head.startswith(_OLD_WORKBOOK):
        raise DataError("is a workbook of an old kind", "save it as .xlsx or CSV")
    try:
        errors = CP1252 if encoding == "utf-8-sig" else "strict"
        with path.open(encoding=encoding, errors=errors, newline="") as stream:
            lines: Iterator[str] = islice(_bounded_lines(stream), skip_lines, None)
            skipped = skip_lines
            if not delimiter:
                lines, delimiter, skipped = _detect_delimiter(lines, comments=comments)
            # strict: otherwise one quote too many swallows the lines after it
            # possessive: giving blanks back would take quadratic time on a long run of them
            blanks = re.compile(rf'(?<!")" ++(?={re.escape(delimiter)}|\s*$)')
            tidy = (blanks.sub('"', line) if '" ' in line else line for line in lines)
            reader = csv.reader(tidy, delimiter=delimiter, skipinitialspace=True, strict=True)
            for row in reader:
                number = reader.line_num + skipped
                yield TableLine(number, tuple(_text_of(cell) for cell in row))
    except UnicodeError as error:
        raise DataError("is not UTF-16 text", "save it as CSV (UTF-8)") from error
    except csv.Error as error:
        what = f"is not a CSV table after line {number} ({error})"
        raise DataError(what, "check its quotes, save it as CSV (UTF-8)") from error


def _sheet_lines(path: Path) -> Iterator[TableLine]:
    from openpyxl import load_workbook

    try:
        check_zip(path, most_bytes=_MOST_SHEET_BYTES, hint="save its sheet as CSV (UTF-8)")
        book = load_workbook(path, read_only=True, data_only=True)
        sheet = book.worksheets[0]
        sheet.reset_dimensions()  # other programs state it wrongly
        for number, row in enumerate(sheet.iter_rows(max_row=_MOST_ROWS), start=1):
            yield TableLine(number, tuple(_text_of(_text_of_cell(cell)) for cell in row))
    except DataError:
        raise
    # a damaged workbook may end in any error of the library
    except Exception as error:
        raise DataError("is not a workbook (.xlsx), or damaged", "save its sheet as CSV (UTF-8)") from error


def _text_of_cell(cell: Any) -> str:
    """The text that a sheet shows: 000123 for 123 in the format 000000."""
    value = cell.value
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        if abs(value) >= _EXACT_NUMBERS:
            return f"{value:.5E}"
        return str(value).zfill(len(cell.number_format)) if set(cell.number_format) == {"0"} else str(value)
    return "" if value is None else str(value)


def _text_of(written: str) -> str:
    cell = written.strip().strip(INVISIBLE).strip()
    quoted = _KEPT_AS_TEXT.fullmatch(cell)
    return unescape_formula(cell if quoted is None else quoted[1])


def check_serial(line: int, text: str) -> str:
    """Check a serial of a table. Raises DataError: a spreadsheet has taken it for a number and rounded it."""
    if _ROUNDED.fullmatch(text):
        what = f"line {line} holds {text}, a serial that a spreadsheet has rounded"
        raise DataError(what, "format the column as text there, and save the table again")
    return text


def heading(cell: str) -> str:
    """A heading in the form for comparison: lower case, one word."""
    return re.sub(r"[\s.-]+", "_", cell.strip().lower())


def column_of(headings: Sequence[str], names: Collection[str]) -> int | None:
    """Index of the first of these names among the headings; None if none is there."""
    plain = [heading(cell) for cell in headings]
    return next((plain.index(name) for name in names if name in plain), None)


def is_data(cells: Sequence[str]) -> bool:
    """Whether a first line without a known heading holds data: serials have digits, headings have none."""
    return any(char.isdigit() for cell in cells for char in cell)


def number_of(cell: str) -> float:
    """The number in a cell, with a decimal point or comma; a ValueError if it holds none."""
    return float(cell.replace(",", ".") if cell.count(",") == 1 and "." not in cell else cell)


def encoding_of(head: bytes) -> str:
    """The encoding of a text, from its byte order mark or the positions of its zeros; default: UTF-8."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even, odd = head[0::2], head[1::2]
    if odd and odd.count(0) > len(odd) // 2 and not even.count(0):
        return "utf-16-le"
    if odd and even.count(0) > len(even) // 2 and not odd.count(0):
        return "utf-16-be"
    return "utf-8-sig"


# error handler that decodes bytes that are not UTF-8 as programs on Windows write them
CP1252 = "or-cp1252"


def _as_cp1252(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("cp1252", "replace"), error.end


codecs.register_error(CP1252, _as_cp1252)


def _bounded_lines(stream: TextIO) -> Iterator[str]:
    while line := stream.readline(_MOST_LINE):
        if len(line) == _MOST_LINE:
            raise DataError(f"has a line of over {_MOST_LINE:,} characters", "give a table")
        yield line


def _detect_delimiter(lines: Iterator[str], *, comments: bool) -> tuple[Iterator[str], str, int]:
    """The lines to parse, their delimiter, and the number of lines before them. The delimiter is that of a "sep=" line,
    or the one that splits most of the first lines into as many cells as the first."""
    sample = list(islice(lines, _SAMPLE_LINES))
    first = next((k for k, line in enumerate(sample) if line.strip()), len(sample))
    if first < len(sample) and (named := _SEPARATOR_LINE.fullmatch(sample[first])):
        return chain(sample[first + 1 :], lines), named[1], first + 1
    typical = [
        line for line in sample[first:] if line.strip() and not (comments and line.lstrip().startswith("#"))
    ]
    return chain(sample, lines), max(_DELIMITERS, key=lambda mark: _evenness(typical, mark)), 0


def _evenness(lines: Sequence[str], delimiter: str) -> tuple[int, int]:
    try:
        rows = [row for row in csv.reader(lines, delimiter=delimiter, skipinitialspace=True) if row]
    except csv.Error:  # reported when the table is parsed
        rows = [line.split(delimiter) for line in lines[:1]]
    cells = len(rows[0]) if rows else 0
    return (sum(len(row) == cells for row in rows), cells) if cells > 1 else (0, 0)
