"""Check an enrolment: each half of the parts is read with the shapes learned from the other half."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from glyphs.errors import MarksError
from pipeline.common.settings import ReadSettings
from pipeline.common.texts import without_blanks
from pipeline.formats.glyph_database import load_database, save_database
from pipeline.formats.part_files import PartFiles
from pipeline.reading.enrolment import enrol
from pipeline.reading.part_job import PartJob, reading_of


@dataclass(frozen=True)
class HeldOutCheck:
    """Errors on parts that were read with shapes learned from other parts, and without them."""

    parts: int
    characters: int
    edits: int
    edits_without: int

    @property
    def is_worse(self) -> bool:
        return self.edits > self.edits_without

    def describe(self) -> str:
        line = (
            f"held out: {self.parts} parts read with shapes learned from the others: "
            f"{self.edits} of {self.characters} characters wrong, {self.edits_without} without the font"
        )
        if not self.is_worse:
            return line
        return f"{line}\nwarning: reading is worse with this font; enroll more parts, or read without it"


def check_held_out(
    parts: Sequence[PartFiles],
    database: Path,
    *,
    font: str,
    settings: ReadSettings,
    fewest_parts: int = 6,
    most_parts: int = 20,
) -> HeldOutCheck | None:
    """Read reviewed parts with a font learned from other parts of the same die, and without it; None for fewer parts
    than `fewest_parts`, of which half would teach too little."""
    parts = parts[:most_parts]
    if len(parts) < fewest_parts:
        return None
    checks: list[tuple[int, ...]] = []
    with tempfile.TemporaryDirectory() as folder:
        for k, (teach, read) in enumerate(((parts[1::2], parts[::2]), (parts[::2], parts[1::2]))):
            half = Path(folder) / f"half-{k}.glyphs"
            _copy_without(database, half, font)
            try:
                report = enrol(teach, half, font=font, settings=settings)
            except MarksError:
                return None
            if not report.exemplars:
                return None
            learned = settings.model_copy(update={"database": half, "font": ()})
            checks.append(_compare(read, settings, learned))
    return HeldOutCheck(*map(sum, zip(*checks, strict=True)))


def _copy_without(database: Path, copy: Path, font: str) -> None:
    held = load_database(database)
    fonts = {name: held_font for name, held_font in held.fonts.items() if name != font}
    exemplars = tuple(exemplar for exemplar in held.exemplars if exemplar.font_name != font)
    save_database(replace(held, fonts=fonts, exemplars=exemplars), copy)


def _compare(parts: Sequence[PartFiles], without: ReadSettings, learned: ReadSettings) -> tuple[int, ...]:
    from rapidfuzz.distance import Levenshtein

    texts = [without_blanks(part.expected) for part in parts]
    edits = [
        sum(
            Levenshtein.distance(_read(part, settings), text) for part, text in zip(parts, texts, strict=True)
        )
        for settings in (learned, without)
    ]
    return len(parts), sum(map(len, texts)), *edits


def _read(part: PartFiles, settings: ReadSettings) -> str:
    alike = settings.model_copy(update={"mode": "tactile", "active": False})
    try:
        return without_blanks(reading_of(PartJob(replace(part, font=""), alike)).text)
    except MarksError:
        return ""
