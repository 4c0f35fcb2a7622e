"""How right the readings are, against a table of what was stamped.

*Character accuracy* is 1 - (sum of edit distances) / (sum of true lengths), not below 0: an edit is one
character wrong, missing or too many (Levenshtein). *Serial accuracy* is the share of parts whose whole text
is right. Spaces count for neither: they are not stamped. A part with an error counts as read empty.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rapidfuzz.distance import Levenshtein

from glyphs.errors import FileError, require_file
from pipeline.common.row import Row
from pipeline.files.touch_file import is_height_map, is_photo, is_scan

_PART_HEADINGS = ("part", "file", "filename", "name", "part_id")
_TEXT_HEADINGS = ("text", "serial", "truth", "label")
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


def load_truth(path: Path) -> dict[str, str]:
    """Text by part name, see `load_part_lines`."""
    return {line.part: line.text for line in load_part_lines(path)}


def load_part_lines(path: Path, *, repeated: bool = False) -> list[PartLine]:
    """The lines of a CSV with the columns part (or file) and text (or serial).

    Args:
        path: the table.
        repeated: a part may have several lines.

    Raises:
        FileError: not such a table, or one that names a part twice and must not.
    """
    require_file(path, most_bytes=_MAX_FILE_BYTES)
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            return _parse(path, csv.DictReader(stream, skipinitialspace=True), repeated)
    except UnicodeDecodeError as error:
        raise FileError(path, "is not UTF-8 text", "save it as CSV (UTF-8)") from error
    except csv.Error as error:
        raise FileError(path, f"is not a CSV table ({error})", "save it as CSV (UTF-8)") from error


def _parse(path: Path, table: csv.DictReader[str], repeated: bool) -> list[PartLine]:
    headings = {(h or "").strip().lower(): h for h in table.fieldnames or ()}
    part = next((headings[h] for h in _PART_HEADINGS if h in headings), None)
    text = next((headings[h] for h in _TEXT_HEADINGS if h in headings), None)
    if part is None or text is None:
        raise FileError(
            path, f"has the columns {', '.join(headings) or 'none'}", "its first line must name part and text"
        )
    others = {name: heading for name, heading in headings.items() if heading not in (part, text)}
    lines: list[PartLine] = []
    seen: set[str] = set()
    for record in table:
        name, value = (record[part] or "").strip(), record[text]
        if not name and not value:
            continue
        if value is None or not name:
            raise FileError(path, f"line {table.line_num} is not complete", "give a part and its text")
        name = part_name(name)
        if name in seen and not repeated:
            raise FileError(path, f"line {table.line_num} names {name} a second time", "keep one line a part")
        more = {key: (record[heading] or "").strip() for key, heading in others.items()}
        lines.append(PartLine(table.line_num, name, value.strip(), more))
        seen.add(name)
    if not lines:
        raise FileError(path, "holds no part", "give a line for each part")
    return lines


def part_name(cell: str) -> str:
    """The part that a cell means: a file's name stands for its part."""
    path = Path(cell)
    known = is_height_map(path) or is_scan(path) or is_photo(path)
    return path.stem if known else cell


def name_in(truth: Mapping[str, str], part: str) -> str | None:
    """What a table calls a part: its name, or that without its folder; None where it has none."""
    return next((name for name in (part, part.rpartition("/")[2]) if name in truth), None)


def without_blanks(text: str) -> str:
    """A text as it is stamped."""
    return "".join(text.split())


class Scores:
    """Rows held against the truth, as they come."""

    def __init__(self, truth: Mapping[str, str]) -> None:
        self._truth = truth
        self._seen: set[str] = set()
        self._parts = self._right = self._characters = self._edits = self._without = 0

    def add(self, row: Row) -> None:
        """Count one row."""
        name = name_in(self._truth, row.part)
        if name is None:
            self._without += 1
            return
        self._seen.add(name)
        stamped, read = without_blanks(self._truth[name]), without_blanks(row.text)
        distance = Levenshtein.distance(stamped, read)
        self._parts += 1
        self._right += distance == 0
        self._characters += len(stamped)
        self._edits += distance

    def accuracy(self) -> Accuracy:
        """Of the rows so far."""
        not_read = len(self._truth) - len(self._seen)
        return Accuracy(self._parts, self._right, self._characters, self._edits, self._without, not_read)


def score(rows: Iterable[Row], truth: Mapping[str, str]) -> Accuracy:
    """Compare the rows with the truth."""
    scores = Scores(truth)
    for row in rows:
        scores.add(row)
    return scores.accuracy()
