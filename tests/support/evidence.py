"""Evidence and readings made up for tests: lines with given posteriors, and texts with given marks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType, SimpleNamespace
from typing import Any, cast

import numpy as np

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import Evidence, Log, SenseEvidence, Source
from recognition.decide.reading import Candidate, CharacterReading, Reading
from recognition.find.part_lines import PartLines
from recognition.language.box import Box
from recognition.language.lattice import Lattice
from recognition.marks.measure import TextMarks
from recognition.marks.strokes import PlaceStrokes
from recognition.recogniser.read_line import Floats, ReadLine
from recognition.see.text_line import HEIGHT_ROWS, TextLine
from recognition.settings import ReaderSettings

# ---------------------------------------------------------------------------------------------------------- evidence

LINE = TextLine.straight(3.0, 10.0, length_mm=20.0, height_mm=5.0)


@dataclass(frozen=True, eq=False)
class BelievedLine(ReadLine):
    """A line of text with given posteriors, also without the format."""

    openly: Lattice | None = None

    @property
    def open_places(self) -> tuple[Lattice, Floats]:  # type: ignore[override]
        lattice = self.lattice if self.openly is None else self.openly
        return lattice, _columns(lattice)

    @property
    def is_text(self) -> bool:
        return True

    def evidence_of(self, grammar: object, *, alike: Sequence[str] = ()) -> float:
        return 0.0


def believed_line(
    lattice: Lattice, openly: Lattice | None = None, *, likely: float = 1.0, at: TextLine = LINE
) -> ReadLine:
    """A line with these posteriors, a character every height.

    Args:
        lattice: posteriors under the format.
        openly: posteriors without it (default: the same).
        likely: probability of the number of places.
        at: where it stands.
    """
    by_expert = MappingProxyType({"network": lattice})
    return BelievedLine(at, lattice, _columns(lattice), 0.0, likely, by_expert, (), openly=openly)


def _columns(lattice: Lattice) -> Floats:
    return HEIGHT_ROWS * np.arange(1.0, lattice.n_places + 1.0)


def sense_of(
    lattice: Lattice | None,
    source: Source = "tactile",
    *,
    others: Mapping[str, ReadLine] = MappingProxyType({}),
    unassigned: tuple[ReadLine, ...] = (),
    likely: float = 1.0,
    **log: Any,
) -> SenseEvidence:
    """What a sense has read: these posteriors, or nothing."""
    main = None if lattice is None else believed_line(lattice, likely=likely)
    return SenseEvidence(source, lines=PartLines(main, others, unassigned), log=Log(**log))


def text_of(
    characters: str | Sequence[CharacterReading],
    *,
    strokes: tuple[PlaceStrokes, ...] = (),
    score: float = 0.5,
    threshold: float = 0.98,
    laid_in: str = "",
    font: str = "",
    source: Source = "tactile",
    **more: Any,
) -> Choice:
    """A text with these marks, by default one whose score is low.

    Args:
        characters: the text, or its places.
        strokes: felt strokes.
        score: its score.
        threshold: score from which it is accepted.
        laid_in: font that explains the marks best.
        font: font along which they were graded.
        source: sense that has read it.
        more: further fields.
    """
    places = reading_of(characters).characters if isinstance(characters, str) else tuple(characters)
    laid, own = (SimpleNamespace(font=SimpleNamespace(name=name)) for name in (laid_in or font, font))
    marks = SimpleNamespace(
        laid=laid,
        along=own,
        in_own_font=own if font else None,
        font_fits=True,
        other_font_fits_better=(laid_in or font) != font,
        strokes=lambda lattice, *, slope: strokes,
        has_strokes=lambda lattice: bool(strokes),
        whole=(True,) * len(strokes),
    )
    choice = Choice(
        (SenseEvidence(source),),
        lattice=Lattice(("A",), np.zeros((len(places), 1))),
        characters=places,
        marks=cast(TextMarks, marks),
        score=score,
        threshold=threshold,
    )
    return replace(choice, **more)


Judge = Callable[[Evidence, Choice, ReaderSettings], Iterator[Finding]]


def judged(choice: Choice, *judges: Judge, settings: ReaderSettings | None = None) -> tuple[Finding, ...]:
    """What judges say of a text."""
    evidence, settings = Evidence.of(choice.sense), settings or ReaderSettings()
    return tuple(finding for judge in judges for finding in judge(evidence, choice, settings))


# ---------------------------------------------------------------------------------------------------------- readings

BOX = Box(0.0, 0.0, 1.0, 1.0)


def reading_of(
    text: str,
    confidence: float = 0.99,
    *,
    beliefs: float | Sequence[float] = 0.99,
    flags: ReadingFlag = ReadingFlag.NONE,
    findings: Sequence[Finding] = (),
    **more: Any,
) -> Reading:
    """A text, each place believed so much, with flags in general words; `more` is for the reading."""
    each = [beliefs] * len(text) if isinstance(beliefs, float) else beliefs
    places = (CharacterReading((Candidate(c, 1.0, p),), BOX) for c, p in zip(text, each, strict=True))
    return Reading(tuple(places), confidence, (*map(Finding.of, flags), *findings), **more)


def traced(reading: Reading, **fields: Any) -> Reading:
    """The reading with these fields of its trace."""
    return replace(reading, trace=replace(reading.trace, **fields))
