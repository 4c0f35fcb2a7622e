"""Learn from corrections: reviewed parts become exemplars, and exemplars a font of the glyph database. The font is
rebuilt from all exemplars each time, so that the order of parts makes no difference."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from pipeline.common.texts import without_blanks
from pipeline.common.version import file_sha256
from pipeline.formats.glyph_database import Exemplar, GlyphDatabase, load_database, save_database
from recognition.enrol.exemplars import Cut, ExemplarError, cut_height_map, cut_scan
from recognition.enrol.learned_font import agreement, learn_font

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.formats.part_files import PartFiles

MOST_EXEMPLARS = 30  # of a character in a font; the oldest are dropped first because dies wear

_OF_CUT = ("char", "relief", "height_mm", "rotation_deg", "raised", "place")


@dataclass(frozen=True)
class Refused:
    """A part that could not be enrolled, and why."""

    part: str
    why: str


_Cuts = tuple[str, tuple[Cut, ...]] | Refused  # hash of a part's file, and the characters cut from it


@dataclass(frozen=True)
class EnrolReport:
    """Result of an enrolment."""

    font: str
    enrolled: tuple[tuple[str, str], ...]  # (part, characters taken) of each new part
    known: tuple[str, ...]
    refused: tuple[Refused, ...]
    # kept but not used: they disagree with the character or with others of it
    set_aside: tuple[Exemplar, ...]
    exemplars: int
    felt: str  # characters learned from touch
    never_felt: str  # letters and digits taken from the nearest known font
    trusted: bool  # that font is near enough for these not to count as guesses
    like: str
    likeness: float  # mean correlation with the fitted shapes of that font, `like`
    agreement: float = 1.0  # share of exemplars that agree with others of their character

    def describe(self) -> str:
        taken = sum(len(chars) for _, chars in self.enrolled)
        known = f", {len(self.known)} parts were known" if self.known else ""
        lines = [f"{self.font}: {taken} characters of {len(self.enrolled)} parts enrolled{known}"]
        lines += [f"refused {r.part}: {r.why}" for r in self.refused]
        if self.exemplars:
            n_exemplars = self.exemplars + len(self.set_aside)
            lines.append(f"{self.exemplars} of {n_exemplars} used, for the shapes of {self.felt}")
            lines.append(f"nearest font: {self.like} ({self.likeness:.2f})")
        if self.set_aside:
            lines.append(f"set aside, unlike the character or others of it: {_by_character(self.set_aside)}")
        if self.never_felt:
            guess = "guesses: templates alone send such a character to review"
            doubt = "of the same shapes" if self.trusted else guess
            lines.append(f"not learned, taken from {self.like}: {self.never_felt} ({doubt})")
        return "\n".join(lines)


def enrol(
    parts: Sequence[PartFiles],  # with confirmed texts in `expected`; a scan is preferred to a height map
    database: Path,
    *,
    font: str,
    settings: ReadSettings,
    vouching: bool = True,  # the nearest known font may vouch for rare characters: see `learn_font`
    now: datetime | None = None,
    each: Callable[[Callable[[PartFiles], _Cuts], Sequence[PartFiles]], Iterable[_Cuts]] = map,
) -> EnrolReport:
    """Add the characters of reviewed parts to a database, and make a font of them.

    A missing database is made, with the fonts that the settings name, or the built-in ones. `each` calls a function
    with every part and gives the results in order, as `map` does. Raises FileError: the database cannot be read or
    written, or `font` was not learned. ExemplarError: no font can be made from the exemplars. FontError: a font cannot
    be loaded.
    """
    held = _open_database(database, settings)
    if font in held.fonts and not any(e.font_name == font for e in held.exemplars):
        hint = f"give the die another name, {font + '-worn'!r} for example"
        raise FileError(database, f"has {font!r} as a font of its own", hint)
    when = (now or datetime.now(UTC)).isoformat(timespec="seconds")
    exemplars = list(held.exemplars)
    before = {(e.evidence, e.note) for e in exemplars if e.font_name == font}
    enrolled: list[tuple[str, str]] = []
    known: list[str] = []
    refused: list[Refused] = []
    for part, cut in zip(parts, each(partial(_cut, settings, before), parts), strict=True):
        if isinstance(cut, Refused):
            refused.append(cut)
            continue
        (sha, cuts), text = cut, without_blanks(part.expected)
        if not cuts or any((e.font_name, e.evidence, e.note) == (font, sha, text) for e in exemplars):
            known.append(part.name)
            continue
        # reviewed again: the characters cut with the previous text were wrong
        exemplars = [e for e in exemplars if (e.font_name, e.evidence) != (font, sha)]
        exemplars += [
            Exemplar(
                **{name: getattr(c, name) for name in _OF_CUT},
                font_name=font,
                note=text,
                enrolled_at=when,
                part=part.name,
                evidence=sha,
            )
            for c in cuts
        ]
        enrolled.append((part.name, "".join(c.char for c in cuts)))
    exemplars = _youngest(exemplars, font)
    taught = [e for e in exemplars if e.font_name == font]
    learned_names = {e.font_name for e in held.exemplars}
    fonts = tuple(held.fonts.values())
    bases = tuple(f for f in fonts if f.name not in learned_names) or fonts
    learned = None
    if taught:
        chars, reliefs = zip(*((e.char, e.relief) for e in taught), strict=True)
        learned = learn_font(font, chars, reliefs, known=bases, vouching=vouching)
    if learned is not None and (enrolled or font not in held.fonts):
        all_fonts = {**held.fonts, font: learned.font}
        save_database(replace(held, fonts=all_fonts, exemplars=tuple(exemplars)), database)
    used = {} if learned is None else learned.used
    return EnrolReport(
        font=font,
        enrolled=tuple(enrolled),
        known=tuple(known),
        refused=tuple(refused),
        set_aside=() if learned is None else tuple(taught[k] for k in learned.set_aside),
        exemplars=sum(map(len, used.values())),
        felt="".join(c for c in sorted(used) if used[c]),
        never_felt="" if learned is None else "".join(c for c in learned.never_felt if c.isalnum()),
        trusted=learned is not None and learned.hand.is_own,
        like="" if learned is None else learned.hand.font.name,
        likeness=0.0 if learned is None else learned.hand.likeness,
        agreement=agreement([e.char for e in taught], used),
    )


def _open_database(database: Path, settings: ReadSettings) -> GlyphDatabase:
    if database.exists():
        return load_database(database)
    from glyphs.fonts.outlines import BUILTIN_FONTS, load_font

    fonts = [load_font(name) for name in settings.font or BUILTIN_FONTS]
    return GlyphDatabase({f.name: f for f in fonts})


def _cut(settings: ReadSettings, before: Collection[tuple[str, str]], part: PartFiles) -> _Cuts:
    from pipeline.formats.touch_file import read_part_map, read_scan

    text, path = without_blanks(part.expected), Path(part.scan or part.height_map)
    try:
        if not part.felt:
            raise ExemplarError("it has no scan and no height map", hint="only scanned parts can be enrolled")
        try:
            sha = file_sha256(path)
        except OSError as error:
            raise FileError(path, f"cannot be read ({error.strerror})", "check the name") from error
        if (sha, text) in before:
            return sha, ()
        if part.scan:
            cuts = cut_scan(read_scan(path), text, height_mm=settings.height_mm)
        else:
            top = read_part_map(path, settings)
            cuts = cut_height_map(top.height_map, text, soil=top.soil, height_mm=settings.height_mm)
        if not cuts:
            raise ExemplarError("too little of its characters was scanned", hint="scan it again")
        return sha, tuple(cuts)
    except MarksError as error:
        return Refused(part.name, str(error))


def _youngest(exemplars: Sequence[Exemplar], font: str) -> list[Exemplar]:
    youngest: list[Exemplar] = []
    count: Counter[str] = Counter()
    for exemplar in reversed(exemplars):
        count[exemplar.char] += exemplar.font_name == font
        if exemplar.font_name != font or count[exemplar.char] <= MOST_EXEMPLARS:
            youngest.append(exemplar)
    return youngest[::-1]


def _by_character(set_aside: Sequence[Exemplar]) -> str:
    """`C 1 (part-3 place 2), 8 2 (part-1 place 4, part-7 place 1)`."""
    where: dict[str, list[str]] = {}
    for exemplar in sorted(set_aside, key=lambda exemplar: (exemplar.char, exemplar.part, exemplar.place)):
        where.setdefault(exemplar.char, []).append(f"{exemplar.part} place {exemplar.place}")
    return ", ".join(f"{char} {len(places)} ({', '.join(places)})" for char, places in where.items())
