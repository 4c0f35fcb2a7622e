"""Numbers in text, as programs export them: any delimiter, decimal point or comma, headings, words for missing values.

text --layout of the first lines--> head | body --numpy--> NumberTable
"""

from __future__ import annotations

import contextlib
import io
import re
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError
from pipeline.formats.table_file import CP1252, encoding_of

_SNIFF_BYTES = 200_000
_SNIFF_LINES = 400
_MOST_HEAD_LINES = 300
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_COMMA_NUMBER = re.compile(r"[-+]?(?:\d+,?\d*|,\d+)(?:[eE][-+]?\d+)?")
# what stands for a missing value: two words, the NaN of Microsoft's C, and what else a cell may hold
_PHRASE = re.compile(
    r"(?i)\b(?:no|not|out[ _-]of)[ _-]?(?:data|value|measured|range)\b|\bn/a\b|(?<=[\s;,])#[a-z][\w/!?]*"
)
_C_NAN = re.compile(r"[-+]?\d\.#[A-Za-z]+\d*")
_IS_MISSING = re.compile(
    r"(?i)\s*|nan|[-+]?inf\w*|-+|\*+|\?+|_+|bad|null|none|na|nodata|invalid|missing|masked|void|undefined"
)


@dataclass(frozen=True)
class Layout:
    """Layout of the numbers of a text.

    Attributes:
        delimiter: between columns; None for blanks and tabs.
        comma: the decimal sign is a comma.
        columns: of numbers.
        first_line: of the numbers, from 0.
    """

    delimiter: str | None
    comma: bool
    columns: int
    first_line: int

    def cells(self, line: str) -> list[str]:
        """The columns of a line; an empty one after the last delimiter is none, unless the table has so many."""
        line = _C_NAN.sub("nan", _PHRASE.sub("nan", line.strip("\r\n ")))
        cells = line.split(self.delimiter)
        ends = self.delimiter is not None and not cells[-1].strip() and len(cells) != self.columns
        return cells[:-1] if ends else cells


@dataclass(frozen=True)
class NumberTable:
    """A table of numbers.

    Attributes:
        head: lines before the numbers.
        names: of the columns, in small letters; empty where the last line of the head does not name them all.
        rows: (n, columns), NaN where a value is missing.
    """

    head: tuple[str, ...]
    names: tuple[str, ...]
    rows: NDArray[np.float64]


_LAYOUTS = ((";", True), (";", False), ("\t", True), ("\t", False), (None, True), (",", False), (None, False))


def is_number_table(path: Path) -> bool:
    """Whether a file on this machine is text with a matrix of numbers or columns x, y, z."""
    try:
        with path.open("rb") as stream:
            start = stream.read(_SNIFF_BYTES)
    except OSError:
        return False
    text = _decoded(start)
    lines = text.splitlines()[:_SNIFF_LINES] if "\0" not in text else []
    found = _layout(lines[:-1] if len(start) == _SNIFF_BYTES else lines)
    if found is None or found.columns < 3:
        return False
    body = lines[found.first_line :]
    return len(body) >= 3 and found.first_line <= max(_MOST_HEAD_LINES, len(body))


def read_number_table(path: Path) -> NumberTable:
    """The numbers of a text file.

    Raises:
        DataError: no text, no table of numbers, or rows of different lengths.
    """
    text = _decoded(path.read_bytes())
    sample = text[:_SNIFF_BYTES].splitlines()
    found = _layout(sample[:_SNIFF_LINES])
    if found is None:
        what = "holds no table of numbers"
        raise DataError(what, "export columns x y z, or a matrix of heights, one row a line")
    head = tuple(sample[: found.first_line])
    body = text.split("\n", found.first_line)[found.first_line] if found.first_line else text
    if body.count("\n") * found.columns > 9 * MAX_PIXELS:
        raise DataError("holds more numbers than the limit", "crop or thin the map")
    return NumberTable(head, _names(head, found), _numbers(body, found))


def _decoded(data: bytes) -> str:
    """The text, with one kind of line ends and without quotes."""
    text = data.decode(encoding_of(data[:_SNIFF_BYTES]), CP1252)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.replace('","', ";").replace('"', "") if '"' in text[:_SNIFF_BYTES] else text


def _layout(lines: Sequence[str]) -> Layout | None:
    """The layout in which most lines are numbers, as many a line; None where there is none with two columns."""
    found: list[tuple[int, Layout]] = []
    for delimiter, comma in _LAYOUTS:
        counts = [_count(line, Layout(delimiter, comma, 0, 0)) for line in lines]
        for columns, n in Counter(c for c in counts if c >= 2).most_common(1):
            found.append((n * columns, Layout(delimiter, comma, columns, counts.index(columns))))
    return max(found, key=lambda one: one[0])[1] if found else None


def _count(line: str, layout: Layout) -> int:
    """Columns of a line of numbers; 0 of any other."""
    if line[:1] in ("#", "%"):
        return 0
    number = _COMMA_NUMBER if layout.comma else _NUMBER
    numbers = 0
    cells = layout.cells(line)
    for cell in cells:
        cell = cell.strip()
        if number.fullmatch(cell):
            numbers += 1
        elif not _IS_MISSING.fullmatch(cell):
            return 0
    # with a comma nothing else tells a decimal from two columns
    return len(cells) if 2 * numbers >= len(cells) else 0


def _names(head: tuple[str, ...], layout: Layout) -> tuple[str, ...]:
    last = head[-1].strip().lstrip("#%/ ") if head else ""
    names = [cell.strip().strip('"').lower() for cell in re.split(r"[;,\t]", last) if cell.strip()]
    if len(names) != layout.columns:
        names = last.lower().split()
    return tuple(names) if len(names) == layout.columns else ()


def _numbers(body: str, layout: Layout) -> NDArray[np.float64]:
    if layout.comma:
        body = body.replace(",", ".")
    if "#" not in body:
        with contextlib.suppress(ValueError):
            return np.loadtxt(io.StringIO(body), delimiter=layout.delimiter, ndmin=2)
    return _numbers_and_words(body, layout)


def _numbers_and_words(body: str, layout: Layout) -> NDArray[np.float64]:
    """The first block of numbers, up to the head of another channel; slower, for words and gaps are taken as NaN."""
    numbers, width = array("d"), layout.columns
    for n, line in enumerate(body.split("\n"), start=layout.first_line + 1):
        cells = layout.cells(line)
        if not line.strip():
            continue
        values = [_number(cell) for cell in cells]
        if numbers and (line.startswith("#") or (len(values) != width and np.isnan(values).any())):
            break
        if len(values) != width:
            raise DataError(
                "has rows of different lengths or text between its numbers "
                f"(line {n} has {len(values)} columns, others {width})",
                "export it again",
            )
        numbers.extend(values)
    return np.array(numbers).reshape(-1, width)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")
