"""Read the production order: a table with the serials that are to come."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from glyphs.errors import FileError, require_file
from pipeline.common.serial_rules import ProductionOrder, SerialRange, counted
from pipeline.formats.table_file import TEXT_HEADINGS, TableLine, column_of, is_data, table_lines

_MOST_BYTES = 50_000_000
_RANGE = re.compile(r"\s*(\S+?)\s*\.\.\s*(\S+)\s*")
# no stamp bears these, but a table that is parsed wrongly has them in its cells
_ODD = re.compile(r"[;,|\"<>=\t]|[^\S ]|[^\x20-\x7e\xa0-\uffff]")


def read_order(path: Path) -> ProductionOrder:
    """The production order in a file: one serial a line, the column `serial` of a table, or ranges A001..A099.

    Raises:
        FileError: no such file, not text, no column or several that could hold the serials, a cell that is no
            serial, or an invalid range; names the line.
    """
    require_file(path, most_bytes=_MOST_BYTES)
    lines = list(table_lines(path, comments=True))
    column, lines = _serials_column(path, lines)
    serials: set[str] = set()
    ranges = []
    for line in lines:
        cell = line.cell(column)
        if not cell or cell.startswith("#"):
            continue
        if (odd := _ODD.search(cell)) is not None:
            raise FileError(
                path,
                f"line {line.number} holds {cell!r}, and {odd[0]!r} stands in no serial",
                "separate all columns by the same comma, semicolon or tab, and call the one meant serial",
            )
        match = _RANGE.fullmatch(cell)
        if match is None:
            serials.add("".join(cell.split()))
        else:
            ranges.append(_range(path, line, *match.groups()))
    if not serials and not ranges:
        raise FileError(path, "holds no serial", "write one a line, or ranges such as KX400000..KX409999")
    return ProductionOrder(path.name, frozenset(serials), tuple(ranges))


def _serials_column(path: Path, lines: list[TableLine]) -> tuple[int, list[TableLine]]:
    """The column that holds the serials, and the lines below the headings."""
    if not lines:
        return 0, lines
    named = column_of(lines[0].cells, TEXT_HEADINGS)
    if named is not None:
        return named, lines[1:]
    filled = sorted({place for line in lines for place, cell in enumerate(line.cells) if cell})
    if len(filled) > 1:
        found = _quoted(lines[0].cells)
        what = f"line {lines[0].number} is {found}" if is_data(lines[0].cells) else f"has the columns {found}"
        raise FileError(
            path, f"{what}, and which column holds the serials is not said",
            "call it serial in the first line",
        )  # fmt: skip
    return filled[0], lines


def _range(path: Path, line: TableLine, first: str, last: str) -> SerialRange:
    ends = [one for end in (first, last) if (one := counted(end)) is not None]
    if len(ends) < 2 or len({(one.head, one.digits, one.tail) for one in ends}) > 1:
        raise FileError(
            path,
            f"line {line.number}: {first}..{last} is not a range of serials",
            "write it as KX400000..KX409999",
        )
    return SerialRange(ends[0].head, ends[0].number, ends[1].number, ends[0].digits, ends[0].tail)


def _quoted(cells: Sequence[str]) -> str:
    return ", ".join(map(repr, cells))[:200]
