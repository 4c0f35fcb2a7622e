"""How right the readings are, against a table of what was stamped.

*Character accuracy* is 1 - (sum of edit distances) / (sum of true lengths), not below 0: an edit is one
character wrong, missing or too many (Levenshtein). *Serial accuracy* is the share of parts whose whole text
is right. Spaces count for neither: they are not stamped. A part with an error counts as read empty.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path, PurePath, PureWindowsPath

from rapidfuzz.distance import Levenshtein

from glyphs.errors import FileError, require_file
from pipeline.common.reading_records import ReadingRecord
from pipeline.formats.kinds import is_height_map, is_photo, is_scan
from pipeline.formats.table_file import (
    PART_HEADINGS,
    TEXT_HEADINGS,
    TableLine,
    column_of,
    is_data,
    table_lines,
)

_MAX_FILE_BYTES = 200_000_000


@dataclass(frozen=True)
class Accuracy:
    """Readings against the truth.

    Attributes:
        parts: parts with a truth.
        parts_right: of these, read without any error.
        characters: true characters of those parts.
        edits: characters wrong, missing or too many.
        without_truth: parts that were read but have none.
        not_read: parts that have a truth but were not among the inputs.
    """

    parts: int
    parts_right: int
    characters: int
    edits: int
    without_truth: int
    not_read: int

    @property
    def character_accuracy(self) -> float:
        """1 - edits / characters, not below 0."""
        return max(0.0, 1.0 - self.edits / self.characters) if self.characters else 0.0

    @property
    def serial_accuracy(self) -> float:
        """Share of parts read without any error."""
        return self.parts_right / self.parts if self.parts else 0.0

    def describe(self) -> str:
        """One line for a person."""
        if not self.parts:
            return "no part that was read has a truth"
        more = [f"{self.without_truth} without a truth"] if self.without_truth else []
        more += [f"{self.not_read} of the truth not read"] if self.not_read else []
        return (
            f"characters {self.character_accuracy:.2%} ({self.edits} edits in {self.characters}), "
            f"serials {self.serial_accuracy:.2%} ({self.parts_right} of {self.parts})"
            + (f"; {', '.join(more)}" if more else "")
        )


@dataclass(frozen=True)
class PartLine:
    """A line of a table of parts.

    Attributes:
        line: number in the file.
        part: its name.
        text: stamped on it, or read.
        others: the further columns, by their headings in lower case.
    """

    line: int
    part: str
    text: str
    others: dict[str, str]


class PartTexts(dict[str, str]):
    """Texts by the names of parts, found however a name is composed (NFC, NFD) and in whatever case."""

    @cached_property
    def _names(self) -> dict[str, str | None]:
        """The only name of each spelling; None where several have it."""
        names: dict[str, str | None] = {}
        for name in self:
            names[_folded(name)] = None if _folded(name) in names else name
        return names

    def name_of(self, part: str) -> str | None:
        """What the table calls a part: its name, or that without its folder; None where it has none."""
        for name in (part, part.rpartition("/")[2]):
            if name in self:
                return name
            if (found := self._names.get(_folded(name))) is not None:
                return found
        return None

    def text_of(self, part: str) -> str | None:
        """The text of a part; None where the table has none."""
        name = self.name_of(part)
        return None if name is None else self[name]


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()


def load_truth(path: Path) -> PartTexts:
    """Text by part name, see `load_part_lines`."""
    return PartTexts((line.part, line.text) for line in load_part_lines(path))


def load_part_lines(path: Path, *, repeated: bool = False) -> list[PartLine]:
    """The lines of a table with the columns part (or file) and text (or serial), in this order without headings.

    Args:
        path: the table.
        repeated: a part may have several lines.

    Raises:
        FileError: not such a table, or one that names a part twice and must not.
    """
    require_file(path, most_bytes=_MAX_FILE_BYTES)
    lines = table_lines(path)
    head = next(lines, TableLine(1, ()))
    part, text = column_of(head.cells, PART_HEADINGS), column_of(head.cells, TEXT_HEADINGS)
    others: dict[str, int] = {}
    if part is None and text is None and len(head.cells) == 2 and is_data(head.cells):
        part, text, lines = 0, 1, chain((head,), lines)
    elif part is None or text is None:
        found = ", ".join(cell.lower() for cell in head.cells) or "none"
        raise FileError(path, f"has the columns {found}", "its first line must name part and text")
    else:
        titles = [cell.lower() for cell in head.cells]
        others = {name: place for place, name in enumerate(titles) if place not in (part, text)}
    found_lines: list[PartLine] = []
    seen: set[str] = set()
    for line in lines:
        name, value = line.cell(part), line.cell(text)
        if not name and not value:
            continue
        if not name or len(line.cells) <= text:
            raise FileError(path, f"line {line.number} is not complete", "give a part and its text")
        name = part_name(name)
        if name in seen and not repeated:
            raise FileError(path, f"line {line.number} names {name} a second time", "keep one line a part")
        more = {title: line.cell(place) for title, place in others.items()}
        found_lines.append(PartLine(line.number, name, value, more))
        seen.add(name)
    if not found_lines:
        raise FileError(path, "holds no part", "give a line for each part")
    return found_lines


def part_name(cell: str) -> str:
    """The part that a cell means: a file's name, as any system writes it, stands for its part."""
    path = PureWindowsPath(cell) if "\\" in cell else PurePath(cell)
    known = is_height_map(path) or is_scan(path) or is_photo(path)
    return path.stem if known else cell


def without_blanks(text: str) -> str:
    """A text as it is stamped."""
    return "".join(text.split())


class Scores:
    """Readings held against the truth, as they come."""

    def __init__(self, truth: Mapping[str, str]) -> None:
        self._truth = PartTexts(truth)
        self._seen: set[str] = set()
        self._parts = self._right = self._characters = self._edits = self._without = 0

    def add(self, record: ReadingRecord) -> None:
        """Count one reading."""
        name = self._truth.name_of(record.part)
        if name is None:
            self._without += 1
            return
        self._seen.add(name)
        stamped, read = without_blanks(self._truth[name]), without_blanks(record.text)
        distance = Levenshtein.distance(stamped, read)
        self._parts += 1
        self._right += distance == 0
        self._characters += len(stamped)
        self._edits += distance

    def accuracy(self) -> Accuracy:
        """Of the readings so far."""
        not_read = len(self._truth) - len(self._seen)
        return Accuracy(self._parts, self._right, self._characters, self._edits, self._without, not_read)


def score(records: Iterable[ReadingRecord], truth: Mapping[str, str]) -> Accuracy:
    """Compare the readings with the truth."""
    scores = Scores(truth)
    for record in records:
        scores.add(record)
    return scores.accuracy()
