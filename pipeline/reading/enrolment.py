"""Learning from corrections: reviewed parts become exemplars, and exemplars a font of the glyph database.

    reviewed part --text forced--> cuts --+
    exemplars already in the database ----+--learn_font--> font NAME, beside the fonts that were there

All exemplars are kept and the font is made of them anew each time: the order in which parts are enrolled does not
matter, and the same part twice is enrolled once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from glyphs.stamping.database import DatabaseError, Exemplar, GlyphDatabase, load_database, save_database
from recognition.exemplars import Cut, ExemplarError

if TYPE_CHECKING:
    from glyphs.fonts.glyph import Font
    from pipeline.common.settings import ReadSettings
    from recognition.learned_shapes import Learned
    from recognition.templates import TemplateCache

MOST_EXEMPLARS = 30
"""Of one character in one font; the eldest go first: a die wears."""


@dataclass(frozen=True)
class ReviewedPart:
    """A part whose text a person has confirmed or corrected.

    Attributes:
        name: of the part.
        text: what stands on it.
        scan: its recorded scan, which goes before a height map.
        height_map: its height map.
    """

    name: str
    text: str
    scan: Path | None = None
    height_map: Path | None = None


@dataclass(frozen=True)
class Refused:
    """What was not taken, and why.

    Attributes:
        part: name of the part.
        why: in words.
    """

    part: str
    why: str


@dataclass(frozen=True)
class EnrolReport:
    """What an enrolment did.

    Attributes:
        font: name of the font.
        enrolled: (part, characters taken) of each part that was new.
        known: parts that were enrolled before.
        refused: parts of which nothing was taken.
        set_aside: exemplars kept but not used, as they disagree with others of the same character.
        exemplars: exemplars that the font is made of now.
        felt: characters that it has from touch.
        never_felt: letters and figures that it has from the nearest known font.
        trusted: whether that one is so near that they are no guesses.
        like: the known font that comes nearest to it.
        likeness: mean correlation with that one's shapes, changed to come near.
    """

    font: str
    enrolled: tuple[tuple[str, str], ...]
    known: tuple[str, ...]
    refused: tuple[Refused, ...]
    set_aside: tuple[Refused, ...]
    exemplars: int
    felt: str
    never_felt: str
    trusted: bool
    like: str
    likeness: float

    def describe(self) -> str:
        """A few lines for a person."""
        taken = sum(len(chars) for _, chars in self.enrolled)
        lines = [f"{self.font}: {taken} characters of {len(self.enrolled)} parts enrolled"]
        if self.known:
            lines[0] += f", {len(self.known)} parts were known"
        lines += [f"refused {r.part}: {r.why}" for r in self.refused]
        lines += [f"set aside {r.part}: {r.why}" for r in self.set_aside]
        if self.exemplars:
            lines.append(
                f"felt {self.felt} ({self.exemplars} exemplars); nearest font {self.like} ({self.likeness:.2f})"
            )
        if self.never_felt:
            doubt = (
                "of the same shapes" if self.trusted else "a guess: readings that may hold one go to review"
            )
            lines.append(f"never felt, after {self.like}: {self.never_felt} ({doubt})")
        return "\n".join(lines)


def enrol(
    parts: Sequence[ReviewedPart],
    database: Path,
    *,
    font: str,
    settings: ReadSettings,
    now: datetime | None = None,
    on_part: Callable[[str], None] | None = None,
) -> EnrolReport:
    """Take the characters of reviewed parts into a database, and make a font of them.

    A database that is not there is made, with the fonts that the settings name, or the built-in ones. The file is
    replaced whole at the end, or left alone where nothing changed.

    Args:
        parts: with their texts.
        database: glyph database.
        font: name of the font to be learned; a new one, or one learned before.
        settings: fonts, character height.
        now: time of enrolment.
        on_part: told the name of every part before it is felt.

    Raises:
        DatabaseError: a database that cannot be read or written, or `font` is a font that was not learned.
        FontError: a font of the settings that cannot be loaded.
    """
    held = _opened(database, settings)
    if font in held.fonts and not any(e.font_name == font for e in held.exemplars):
        raise DatabaseError(
            f"{font!r} is a font of its own in {database}",
            hint=f"name the die another, {font + '-worn'!r} for example",
        )
    learned_names = {e.font_name for e in held.exemplars}
    fonts = tuple(held.fonts.values())
    when = (now or datetime.now(UTC)).isoformat(timespec="seconds")
    exemplars = list(held.exemplars)
    enrolled: list[tuple[str, str]] = []
    known: list[str] = []
    refused: list[Refused] = []
    cache = _cache()
    for part in parts:
        if on_part is not None:
            on_part(part.name)
        text = "".join(part.text.split())
        try:
            evidence = _sha256(part)
            before = [e for e in exemplars if (e.font_name, e.evidence) == (font, evidence)]
            if before and before[0].note == text:
                known.append(part.name)
                continue
            cuts = _cuts(part, text, fonts, cache, settings)
        except MarksError as error:
            refused.append(Refused(part.name, str(error)))
            continue
        # reviewed anew: what was taken under the other text was wrong
        exemplars = [e for e in exemplars if (e.font_name, e.evidence) != (font, evidence)]
        exemplars += [_exemplar(c, font, text, part.name, evidence, when) for c in cuts]
        enrolled.append((part.name, "".join(c.char for c in cuts)))
    exemplars = _youngest(exemplars, font)
    own = [e for e in exemplars if e.font_name == font]
    bases = tuple(f for f in fonts if f.name not in learned_names) or fonts
    learned = _learn(font, own, bases) if own else None
    if learned is not None and (enrolled or font not in held.fonts):
        made = {**held.fonts, font: learned.font}
        save_database(replace(held, fonts=made, exemplars=tuple(exemplars)), database)
    return _report(font, enrolled, known, refused, own, learned)


def _opened(database: Path, settings: ReadSettings) -> GlyphDatabase:
    if database.exists():
        return load_database(database)
    from glyphs.fonts.outlines import BUILTIN_FONTS, load_font

    fonts = [load_font(name) for name in settings.font or BUILTIN_FONTS]
    return GlyphDatabase({f.name: f for f in fonts})


def _cache() -> TemplateCache:
    from recognition.templates import TemplateCache

    return TemplateCache()


def _sha256(part: ReviewedPart) -> str:
    path = part.scan or part.height_map
    if path is None:
        raise ExemplarError("it has no scan and no height map", hint="only scanned parts can be enrolled")
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", "check the name") from error


def _cuts(
    part: ReviewedPart, text: str, fonts: Sequence[Font], cache: TemplateCache, settings: ReadSettings
) -> tuple[Cut, ...]:
    """The characters of a part; ExemplarError where there are none."""
    from pipeline.files.npz import read_soil
    from pipeline.files.touch_file import read_height_map, read_scan
    from pipeline.files.units import Unit
    from recognition.tactile_part import cut_height_map, cut_scan

    if part.scan is not None:
        cuts = cut_scan(read_scan(part.scan), text, fonts, cache=cache, height_mm=settings.height_mm)
    else:
        assert part.height_map is not None
        soil = read_soil(part.height_map) if part.height_map.suffix.lower() == ".npz" else None
        cuts = cut_height_map(
            read_height_map(part.height_map, unit=Unit(settings.unit)),
            text,
            fonts,
            soil=soil,
            cache=cache,
            height_mm=settings.height_mm,
        )
    if not cuts:
        raise ExemplarError("too little of its characters was scanned", hint="scan it again")
    return cuts


def _exemplar(cut: Cut, font: str, text: str, part: str, evidence: str, when: str) -> Exemplar:
    return Exemplar(
        char=cut.char,
        font_name=font,
        edge_map=cut.edge_map,
        note=text,
        enrolled_at=when,
        relief=cut.relief,
        height_mm=cut.height_mm,
        rotation_deg=cut.rotation_deg,
        raised=cut.raised,
        part=part,
        evidence=evidence,
    )


def _youngest(exemplars: Sequence[Exemplar], font: str) -> list[Exemplar]:
    """The exemplars, of each character of the font the last ones only."""
    kept: list[Exemplar] = []
    count: dict[str, int] = {}
    for exemplar in reversed(exemplars):
        if exemplar.font_name == font:
            count[exemplar.char] = count.get(exemplar.char, 0) + 1
            if count[exemplar.char] > MOST_EXEMPLARS:
                continue
        kept.append(exemplar)
    return kept[::-1]


def _learn(font: str, own: Sequence[Exemplar], bases: Sequence[Font]) -> Learned | None:
    from recognition.learned_shapes import learn_font

    taught = [(e.char, e.relief) for e in own if e.relief is not None]
    if not taught:
        return None
    return learn_font(font, [c for c, _ in taught], [r for _, r in taught], known=bases)


def _report(
    font: str,
    enrolled: Sequence[tuple[str, str]],
    known: Sequence[str],
    refused: Sequence[Refused],
    own: Sequence[Exemplar],
    learned: Learned | None,
) -> EnrolReport:
    taught = [e for e in own if e.relief is not None]
    aside = () if learned is None else learned.set_aside
    used = {} if learned is None else learned.used
    return EnrolReport(
        font=font,
        enrolled=tuple(enrolled),
        known=tuple(known),
        refused=tuple(refused),
        set_aside=tuple(
            Refused(taught[k].part, f"its {taught[k].char} of {taught[k].note} does not look like one")
            for k in aside
        ),
        exemplars=sum(len(k) for k in used.values()),
        felt="".join(c for c in sorted(used) if used[c]),
        never_felt="" if learned is None else "".join(c for c in learned.never_felt if c.isalnum()),
        trusted=learned is not None and learned.trusted,
        like="" if learned is None else learned.hand.font.name,
        likeness=0.0 if learned is None else learned.hand.likeness,
    )
