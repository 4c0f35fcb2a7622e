"""Tables of texts: the truth of parts and the production order; accuracy of readings against the truth.

*Character accuracy* is 1 - (sum of edit distances) / (sum of true lengths), not below 0 (Levenshtein). *Serial
accuracy* is the share of parts whose whole text is right. Spaces count for neither, and a part with an error counts as
read empty. A table may name tray-7/part-3 or part-3.jpg; the longest common end of both paths decides.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path, PurePath, PureWindowsPath
from typing import TYPE_CHECKING

from rapidfuzz.distance import Levenshtein

from glyphs.errors import FileError
from pipeline.common.names import folded
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.serial_rules import NumberedSerial, ProductionOrder, split_serial
from pipeline.common.settings import SettingsError
from pipeline.common.texts import first_of, without_blanks
from pipeline.errors import DataError, reading
from pipeline.formats.kinds import file_kind
from pipeline.formats.table_file import (
    PART_HEADINGS,
    RIGHT_SERIAL,
    TEXT_HEADINGS,
    TableLine,
    check_serial,
    column_of,
    heading,
    is_data,
    table_lines,
)

if TYPE_CHECKING:
    from recognition.language.grammar import Grammar

_MAX_FILE_BYTES = 200_000_000
_MOST_NAMED = 20


@dataclass
class Accuracy:
    """Running counts of readings compared with the truth."""

    truth: PartTexts
    parts: int = 0
    parts_right: int = 0
    characters: int = 0
    edits: int = 0  # characters wrong, missing or too many, of all `characters` of the truth
    without_truth: int = 0
    seen: set[str] = field(default_factory=set)  # names of the parts with a truth, as the table has them
    wrong: list[str] = field(default_factory=list)  # parts with any error, as PART (TRUTH read as TEXT)
    accepted_wrong: list[str] = field(default_factory=list)
    accepted: int = 0

    def add(self, record: ReadingRecord) -> None:
        name, text = self.truth.name_of(record.part), self.truth.text_of(record.part)
        self.seen |= set() if name is None else {name}
        if text is None:
            self.without_truth += 1
            return
        stamped = without_blanks(text)
        distance = Levenshtein.distance(stamped, without_blanks(record.text))
        accepted = record.decision == "accept"
        self.accepted += accepted
        if distance:
            self.wrong.append(f"{record.part} ({stamped} read as {record.text or 'nothing'})")
            self.accepted_wrong += [record.part] if accepted else []
        self.parts += 1
        self.parts_right += distance == 0
        self.characters += len(stamped)
        self.edits += distance

    def outside(self, grammar: Grammar, parts: Collection[str]) -> list[str]:
        texts = {part: self.truth.text_of(part) or "" for part in parts}
        broken = {part: grammar.objections(text) for part, text in texts.items() if text}
        return [
            f"{part} should read {texts[part]!r}, but {'; '.join(clauses)}"
            for part, clauses in sorted(broken.items())
            if clauses
        ]

    def lines(self) -> list[str]:
        if not self.parts:
            return ["no part that was read has a truth"]
        not_read = len(self.truth) - len(self.seen)
        more = [f"{self.without_truth} without a truth"] if self.without_truth else []
        more += [f"{not_read} of the truth not read"] if not_read else []
        characters = max(0.0, 1.0 - self.edits / max(1, self.characters))
        shares = (
            f"characters {characters:.2%} ({self.edits} edits in {self.characters})",
            f"serials {self.parts_right / self.parts:.2%} ({self.parts_right} of {self.parts})",
        )
        lines = ["; ".join([", ".join(shares), *([", ".join(more)] if more else [])])]
        if self.wrong:
            lines.append(f"wrong: {first_of(self.wrong, _MOST_NAMED)}")
        if self.accepted:
            names = f": {first_of(self.accepted_wrong, _MOST_NAMED)}" if self.accepted_wrong else ""
            lines.append(f"accepted and wrong: {len(self.accepted_wrong)} of {self.accepted}{names}")
        return lines


@dataclass(frozen=True)
class PartLine:
    """A line of a table of parts: its text, stamped or read, and the other columns by their headings in lower case."""

    line: int
    part: str
    text: str
    others: dict[str, str]


class PartTexts(dict[str, str]):
    """Texts by the names of parts, independent of composition (NFC, NFD) and case."""

    @cached_property
    def _by_last(self) -> dict[str, list[str]]:
        alike: dict[str, list[str]] = {}
        for name in self:
            alike.setdefault(folded(name).rpartition("/")[2], []).append(name)
        return alike

    def name_of(self, part: str) -> str | None:
        """The name of a part in the table, with more or fewer of its folders; None if it has none, or several."""
        if part in self:
            return part
        wanted = f"/{folded(part)}"
        paths = {name: f"/{folded(name)}" for name in self._by_last.get(wanted.rpartition("/")[2], ())}
        shorter = [name for name, path in paths.items() if wanted.endswith(path)]
        longest = max(map(len, shorter), default=0)
        nearest = [name for name in shorter if len(name) == longest]
        nearest = nearest or [name for name, path in paths.items() if path.endswith(wanted)]
        return nearest[0] if len(nearest) == 1 else None

    def text_of(self, part: str) -> str | None:
        name = self.name_of(part)
        return None if name is None else self[name] or None


def load_truth(path: Path) -> PartTexts:
    """Text by part name, see `load_part_lines`."""
    return PartTexts((line.part, line.text) for line in load_part_lines(path))


def load_part_lines(path: Path, *, repeated: bool = False) -> list[PartLine]:
    """The lines of a table with the columns part (or file) and text (or serial), in this order without headings. Raises
    FileError: it lacks columns, or repeats a part although `repeated` is off."""
    with reading(path, most_bytes=_MAX_FILE_BYTES):
        lines = table_lines(path)
        head = next(lines, TableLine(1, ()))
        titles = [cell.lower() for cell in head.cells]
        part, text = column_of(titles, PART_HEADINGS), column_of(titles, TEXT_HEADINGS)
        if part is None and text is None and len(titles) == 2 and is_data(titles):
            part, text, lines = 0, 1, chain((head,), lines)
        elif part is None or text is None:
            what = f"has the columns {', '.join(titles) or 'none'}"
            raise DataError(what, "its first line must name part and text")
        part_lines: list[PartLine] = []
        seen: set[str] = set()
        for line in lines:
            name, value = line.cell(part), check_serial(line.number, line.cell(text))
            if not value and (not name or heading(head.cell(text)) == RIGHT_SERIAL):
                continue
            if not name or len(line.cells) <= text:
                raise DataError(f"line {line.number} is not complete", "give a part and its text")
            name = part_name(name)
            if name in seen and not repeated:
                raise DataError(
                    f"line {line.number} names {name} a second time", "keep one line for each part"
                )
            others = {title: line.cell(k) for k, title in enumerate(titles) if k not in (part, text)}
            part_lines.append(PartLine(line.number, name, value, others))
            seen.add(name)
        if not part_lines:
            raise DataError("holds no part", "give a line for each part and its text")
    return part_lines


def load_expected(value: str, grammar: Grammar | None = None) -> str | PartTexts:
    """The value of `--verify`: a text of every part, or texts by part from a table (.csv, .xlsx or an existing file).
    Raises FileError: the table, or a text in it, is not usable. SettingsError: the text does not fit."""

    def broken(text: str) -> str:
        return "" if grammar is None else "; ".join(grammar.objections(text))

    if not value.lower().endswith((".csv", ".xlsx")) and not os.path.isfile(value):
        if not value.strip():
            hint = "give the text that the part should read, or a CSV table"
            raise SettingsError("--verify is empty", hint=hint)
        if broken(value):
            raise SettingsError(f"--verify is {value!r}, but {broken(value)}", hint="correct it or --format")
        return value.strip()
    path = Path(value)
    table = load_truth(path)
    for part, text in table.items():
        if not text:
            raise FileError(path, f"gives no text for {part}", "give it, or leave the part out")
        if broken(text):
            raise FileError(path, f"{part} should read {text!r}, but {broken(text)}", "correct one of them")
    return table


def part_name(cell: str) -> str:
    """The part that a cell names, directly or by a file name or path of any system."""
    path = PureWindowsPath(cell) if "\\" in cell else PurePath(cell)
    return path.with_suffix("").as_posix() if file_kind(path.suffix) else cell


_MOST_BYTES = 50_000_000
_SEPARATE = "separate all columns by the same comma, semicolon or tab, and call the one meant serial"
_AS_SERIALS = "one serial per line, or ranges such as KX400000..KX409999, on the first sheet of a workbook"
_RANGE = re.compile(r"\s*(\S+?)\s*(?:\.\.+|…)\s*(\S+)\s*")
_DASH = re.compile(r"\s*[-\u2013\u2014]\s*")
# characters that no stamp has, but that the cells of a wrongly parsed table have
_ODD = re.compile(r"[;,|\"<>=\t]|[^\S ]|[^\x20-\x7e\xa0-\uffff]")


def read_order(path: Path, grammar: Grammar | None = None) -> ProductionOrder:
    """Read the production order in a file: one serial per line, the column `serial` of a table, or ranges A001..A099. A
    range with a dash, A001-A099, must be unmistakable: the whole does not fit the grammar, and both ends do. Raises
    FileError: it is not text, no single column holds the serials, or a serial or range is invalid."""
    with reading(path, most_bytes=_MOST_BYTES):
        column, lines = _serials_column(list(table_lines(path, comments=True)))
        serials: set[str] = set()
        ranges = []
        written: list[tuple[int, str]] = []
        for line in lines:
            cell = check_serial(line.number, line.cell(column))
            if not cell or cell.startswith("#"):
                continue
            if (odd := _ODD.search(cell)) is not None:
                what = f"line {line.number} holds {cell!r}, and {odd[0]!r} stands in no serial"
                raise DataError(what, _SEPARATE)
            text = cell
            if (match := _RANGE.fullmatch(cell)) is not None:
                text = match[1]
                ranges.append(_range(line, *match.groups()))
            elif (ends := _dashed_range(line, cell, grammar)) is not None:
                text = _DASH.split(cell)[0]
                ranges.append(ends)
            else:
                serials.add(without_blanks(cell))
            written.append((line.number, text))
        if not serials and not ranges:
            raise DataError("holds no serial", f"write {_AS_SERIALS}")
        if grammar is not None and all(grammar.objections(text) for _, text in written):
            number, text = written[0]
            what = f"line {number} is {text!r}, but {'; '.join(grammar.objections(text))}; no other line fits either"
            raise DataError(what, f"correct --format, or write {_AS_SERIALS}")
    return ProductionOrder(path.name, frozenset(serials), tuple(ranges))


def _serials_column(lines: list[TableLine]) -> tuple[int, list[TableLine]]:
    if not lines:
        return 0, lines
    named = column_of(lines[0].cells, TEXT_HEADINGS)
    if named is not None:
        return named, lines[1:]
    filled = sorted({place for line in lines for place, cell in enumerate(line.cells) if cell})
    if len(filled) > 1:
        cells = ", ".join(map(repr, lines[0].cells))[:200]
        what = f"line {lines[0].number} is {cells}" if is_data(lines[0].cells) else f"has the columns {cells}"
        hint = "call it serial in the first line"
        raise DataError(f"{what}, and it is unclear which column holds the serials", hint)
    return filled[0], lines


def _dashed_range(
    line: TableLine, cell: str, grammar: Grammar | None
) -> tuple[NumberedSerial, NumberedSerial] | None:
    for dash in _DASH.finditer(cell):
        first, last = cell[: dash.start()], cell[dash.end() :]
        low, high = split_serial(first), split_serial(last)
        if low is None or high is None or low.series != high.series or low.number >= high.number:
            continue
        if grammar is not None and not grammar.objections(cell):
            return None
        if grammar is not None and not (grammar.objections(first) or grammar.objections(last)):
            return low, high
        what = f"line {line.number}: {cell} may be one serial, or all serials from {first} to {last}"
        raise DataError(what, f"write {first}..{last} for a range; one serial needs a --format that it fits")
    return None


def _range(line: TableLine, first: str, last: str) -> tuple[NumberedSerial, NumberedSerial]:
    low, high = split_serial(first), split_serial(last)
    if low is None or high is None or low.series != high.series or low.number > high.number:
        what = f"line {line.number}: {first}..{last} is not a range of serials"
        raise DataError(what, "write it as KX400000..KX409999")
    return low, high
