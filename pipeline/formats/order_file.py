"""Read the production order: a table with the serials that are to come."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.common.serial_rules import Counted, ProductionOrder, counted
from pipeline.common.texts import without_blanks
from pipeline.errors import DataError, reading
from pipeline.formats.table_file import TEXT_HEADINGS, TableLine, column_of, is_data, table_lines

_MOST_BYTES = 50_000_000
_SEPARATE = "separate all columns by the same comma, semicolon or tab, and call the one meant serial"
_RANGE = re.compile(r"\s*(\S+?)\s*\.\.\s*(\S+)\s*")
# characters that no stamp has, but that appear in the cells of a wrongly parsed table
_ODD = re.compile(r"[;,|\"<>=\t]|[^\S ]|[^\x20-\x7e\xa0-\uffff]")


def read_order(path: Path) -> ProductionOrder:
    """The production order in a file: one serial a line, the column `serial` of a table, or ranges A001..A099.

    Raises:
        FileError: no such file, not text, no column or several that could hold the serials, a cell that is no
            serial, or an invalid range; names the line.
    """
    with reading(path, most_bytes=_MOST_BYTES):
        column, lines = _serials_column(list(table_lines(path, comments=True)))
        serials: set[str] = set()
        ranges = []
        for line in lines:
            cell = line.cell(column)
            if not cell or cell.startswith("#"):
                continue
            if (odd := _ODD.search(cell)) is not None:
                what = f"line {line.number} holds {cell!r}, and {odd[0]!r} stands in no serial"
                raise DataError(what, _SEPARATE)
            match = _RANGE.fullmatch(cell)
            if match is None:
                serials.add(without_blanks(cell))
            else:
                ranges.append(_range(line, *match.groups()))
        if not serials and not ranges:
            raise DataError("holds no serial", "write one a line, or ranges such as KX400000..KX409999")
    return ProductionOrder(path.name, frozenset(serials), tuple(ranges))


def _serials_column(lines: list[TableLine]) -> tuple[int, list[TableLine]]:
    """The column that holds the serials, and the lines below the headings."""
    if not lines:
        return 0, lines
    named = column_of(lines[0].cells, TEXT_HEADINGS)
    if named is not None:
        return named, lines[1:]
    filled = sorted({place for line in lines for place, cell in enumerate(line.cells) if cell})
    if len(filled) > 1:
        found = ", ".join(map(repr, lines[0].cells))[:200]
        what = f"line {lines[0].number} is {found}" if is_data(lines[0].cells) else f"has the columns {found}"
        hint = "call it serial in the first line"
        raise DataError(f"{what}, and which column holds the serials is not said", hint)
    return filled[0], lines


def _range(line: TableLine, first: str, last: str) -> tuple[Counted, Counted]:
    low, high = counted(first), counted(last)
    if low is None or high is None or low.series != high.series:
        what = f"line {line.number}: {first}..{last} is not a range of serials"
        raise DataError(what, "write it as KX400000..KX409999")
    return low, high
