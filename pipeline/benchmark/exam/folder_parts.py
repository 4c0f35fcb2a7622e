"""Parts in files, made by anyone."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glyphs.errors import FileError
from glyphs.fonts.serials import allowed_characters
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.specimens import Item, Specimen
from pipeline.common.settings import SettingsError
from pipeline.formats.find_parts import discover
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import load_truth


@dataclass(frozen=True)
class FolderParts:
    """Parts in files, made by anyone.

    Attributes:
        found: the parts that have a truth.
        truth: text by part.
        condition: what they have in common.
    """

    found: tuple[PartFiles, ...]
    truth: dict[str, str]
    condition: Condition

    @classmethod
    def load(cls, inputs: Sequence[str], truth: Path, condition: Condition) -> FolderParts:
        """Load the parts of folders, globs or files whose truth is in a table.

        Args:
            inputs: folders, globs or files.
            truth: CSV with the columns part and text.
            condition: condition shared by the parts, as far as known.

        Raises:
            FileError: the table is missing, or no part in it was found.
            NothingFoundError: no parts at all.
            SettingsError: an invalid format or severity.
        """
        if condition.format:
            allowed_characters(condition.format)
        _check_severity(condition.severity)
        truths = load_truth(truth)
        found = {p: text for p in discover(inputs) if (text := truths.text_of(p.name)) is not None}
        if not found:
            raise FileError(truth, "has no row for these parts", "name the parts as their files")
        return cls(tuple(found), {p.name: text for p, text in found.items()}, condition)

    def items(self) -> list[Item]:
        """All of them, by name."""
        return [
            Item(part.name, number, self.condition, files=part, truth="".join(self.truth[part.name].split()))
            for number, part in enumerate(self.found)
        ]

    def make(self, item: Item) -> Specimen:
        """Load its height map; the photograph when it is asked for."""
        from pipeline.formats.npz import read_soil
        from pipeline.formats.photos import read_photo
        from pipeline.formats.touch_file import read_map_and_rows

        files = item.files
        if files is None or files.problem is not None:
            raise (files.problem if files and files.problem else ValueError(f"{item.part} has no files"))
        if not files.height_map:
            raise FileError(files.scan or item.part, "has no height map", "add one")
        photo = Path(files.photo) if files.photo else None
        surface, rows_known = read_map_and_rows(files.height_map)
        return Specimen(
            part=item.part,
            truth=item.truth,
            height_map=surface,
            soil=read_soil(Path(files.height_map)),
            take_photo=None if photo is None else lambda: read_photo(photo),
            line_mm=None,
            rows_known=rows_known,
            number=item.number,
        )

    def font_of(self, condition: Condition) -> str:
        """See `Parts`: of parts in files, the reader's own fonts are all that is known."""
        return condition.font

    def description(self) -> dict[str, Any]:
        """See `Parts`."""
        table = "\n".join(f"{name}\t{text}" for name, text in sorted(self.truth.items()))
        return {
            "folder": sorted({str(Path(p.height_map or p.name).parent) for p in self.found}),
            "truth": hashlib.sha256(table.encode()).hexdigest()[:16],
            "severity": self.condition.severity,
            "format": self.condition.format,
        }


def _check_severity(severity: float | None) -> None:
    if severity is not None and not 0.0 <= severity <= 1.0:
        raise SettingsError(f"a severity is {severity}", hint="it lies between 0 and 1")
