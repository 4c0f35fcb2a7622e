"""Parts from elsewhere: files with a table of their texts, or the table alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glyphs.errors import FileError
from glyphs.fonts.serials import allowed_characters
from pipeline.benchmark.exam.condition import Condition, Level
from pipeline.benchmark.exam.specimens import Item, Specimen
from pipeline.common.settings import SettingsError
from pipeline.common.texts import without_blanks
from pipeline.common.version import key_of
from pipeline.formats.find_parts import discover
from pipeline.formats.table_file import number_of
from pipeline.formats.truth import load_part_lines, load_truth

# of a table of answers: a truth with one of them was probably confused with the answers
_ANSWER_COLUMNS = ("confidence", "decision", "accepted")


@dataclass(frozen=True)
class ListedParts:
    """Parts with the table of their texts; `described` are the values that determine the parts, as JSON."""

    known: tuple[Item, ...]
    table: Path
    described: dict[str, Any]

    @classmethod
    def of_files(cls, inputs: Sequence[str], truth: Path, condition: Condition) -> ListedParts:
        """The parts of folders, globs or files whose text is in a table with the columns part and text. Raises
        FileError: no table or row. NothingFoundError: no part. SettingsError: an invalid format or severity."""
        if condition.format:
            allowed_characters(condition.format)
        if (severity := condition.severity) is not None and not 0.0 <= severity <= 1.0:
            raise SettingsError(f"a severity is {severity}", hint="it lies between 0 and 1")
        truths = load_truth(truth)
        with_text = [(p, text) for p in discover(inputs) if (text := truths.text_of(p.name)) is not None]
        if not with_text:
            raise FileError(truth, "has no row for these parts", "name the parts as their files")
        known = tuple(
            Item(part.name, number, condition, files=part, truth=without_blanks(text))
            for number, (part, text) in enumerate(with_text)
        )
        folders = sorted({str(Path(part.height_map or part.name).parent) for part, _ in with_text})
        described = {
            "folder": folders,
            "truth": key_of({item.part: item.truth for item in known}),
            "severity": severity,
            "format": condition.format,
        }
        return cls(known, truth, described)

    @classmethod
    def of_table(cls, table: Path) -> ListedParts:
        """The parts of a CSV with the columns part and text; other columns are factors. Raises FileError."""
        known = []
        for number, line in enumerate(load_part_lines(table)):
            if column := next((name for name in _ANSWER_COLUMNS if name in line.others), ""):
                what = f"has the column {column}, so it holds answers and not the truth"
                raise FileError(table, what, "give the truth with --truth, and this table as answers")
            condition = Condition({name: _level(cell) for name, cell in line.others.items() if cell})
            severity = condition.get("severity")
            if severity is not None and not (isinstance(severity, float) and 0.0 <= severity <= 1.0):
                what = f"line {line.line}: the severity is {severity!r}"
                raise FileError(table, what, "it lies between 0 and 1")
            known.append(Item(line.part, number, condition, truth=without_blanks(line.text)))
        return cls(tuple(known), table, {"truth": key_of({item.part: item.truth for item in known})})

    def items(self) -> list[Item]:
        return list(self.known)

    def make(self, item: Item) -> Specimen:
        from pipeline.formats.photos import read_photo
        from pipeline.formats.touch_file import read_part_map

        files = item.files
        if files is None:
            raise FileError(
                self.table, f"has only the text of {item.part}", "give the design to see the part"
            )
        if files.problem is not None:
            raise files.problem
        if not files.height_map:
            raise FileError(files.scan or item.part, "has no height map", "add one")
        photo = Path(files.photo) if files.photo else None
        top = read_part_map(files.height_map)
        return Specimen(
            part=item.part,
            truth=item.truth,
            height_map=top.height_map,
            soil=top.soil,
            take_photo=None if photo is None else lambda: read_photo(photo),
            line_mm=None,
            rows_known=top.rows_known,
            number=item.number,
        )

    def font_of(self, condition: Condition) -> str:
        return condition.font

    def description(self) -> dict[str, Any]:
        return self.described


def _level(cell: str) -> Level:
    if cell.lower() in ("true", "false"):
        return cell.lower() == "true"
    try:
        return number_of(cell)
    except ValueError:
        return cell
