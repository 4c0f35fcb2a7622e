"""The text that is chosen for a part, with all that speaks for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

from glyphs.surface.display import OneLine
from recognition.decide.evidence import SenseEvidence
from recognition.decide.reading import CharacterReading, OtherLine, Reading, with_spaces
from recognition.decide.risk_text import USUAL_RISK
from recognition.decide.score import Measure, score_of
from recognition.language.constrained_decoding import Choice as Decoding
from recognition.language.lattice import Lattice
from recognition.marks.measure import TextMarks
from recognition.marks.strokes import PlaceStrokes
from recognition.recogniser.read_line import ReadLine

if TYPE_CHECKING:
    from recognition.find.layouts import Layout
    from recognition.marks.laid_text import LaidText
    from recognition.see.codes import Code

DOUBTFUL = 0.5
"""Score below which a part may have a layout that is not read; one that has hardly exceeds 0.1."""


@dataclass(frozen=True, eq=False, repr=False)
class Choice(OneLine):
    """The text that is chosen from the evidence, and what was measured for it; if both looked, each `alone`."""

    senses: tuple[SenseEvidence, ...]
    alone: Mapping[str, Reading] = field(default_factory=lambda: MappingProxyType({}))
    lattice: Lattice | None = None
    open_lattice: Lattice | None = None
    decoding: Decoding | None = None
    characters: tuple[CharacterReading, ...] = ()
    marks: TextMarks | None = None
    others: tuple[OtherLine, ...] = ()
    codes: tuple[Code, ...] = ()
    spaces_after: frozenset[int] = frozenset()
    accept_risk: float = USUAL_RISK
    threshold: float = 0.0
    measures: Mapping[Measure, float] = field(default_factory=dict)
    score: float = 0.0
    odds: float | None = None
    odds_by_touch: float | None = None  # of this text by touch alone, if both senses are combined

    @property
    def sense(self) -> SenseEvidence:
        """The sense that gives the places of the text."""
        return self.senses[0]

    @property
    def line(self) -> ReadLine | None:
        return self.sense.main

    @property
    def is_fused(self) -> bool:
        return len(self.senses) > 1

    @property
    def text(self) -> str:
        return "".join(place.char for place in self.characters)

    @cached_property
    def strokes(self) -> tuple[PlaceStrokes, ...]:
        if self.marks is None or self.posteriors is None:
            return ()
        return self.marks.strokes(self.posteriors, slope=score_of(self.scored_as).slope)

    @property
    def whole(self) -> tuple[bool, ...]:
        known = self.marks is not None and self.marks.has_strokes(self.posteriors)
        return self.marks.whole if self.marks is not None and known else ()

    @property
    def posteriors(self) -> Lattice | None:
        return self.lattice if self.is_fused or self.line is None else self.line.lattice

    @property
    def scored_as(self) -> str:
        """Source whose score and threshold apply: "fused" only if the posteriors of both senses are combined."""
        return "fused" if self.is_fused else self.sense.source

    @property
    def is_low(self) -> bool:
        return bool(self.characters) and self.score < self.threshold

    @property
    def may_be_explained(self) -> bool:
        """Whether the score is low, and not because the marks are in a layout that is not read."""
        return self.is_low and not self.layout

    @property
    def font(self) -> str:
        if self.in_own_font is not None:
            return self.in_own_font.font.name
        along = None if self.marks is None or self.marks.font_fits else self.marks.along
        faces = {name: p for name, p in self.faces.items() if along is None or name != along.font.name}
        return max(faces, key=faces.__getitem__, default="")

    @property
    def faces(self) -> Mapping[str, float]:
        return {} if self.line is None or not self.characters else self.line.faces

    @property
    def in_own_font(self) -> LaidText | None:
        return None if self.marks is None else self.marks.in_own_font

    @property
    def other_font_fits_better(self) -> bool:
        return self.marks is not None and self.marks.other_font_fits_better

    @property
    def layout(self) -> Layout | None:
        return None if self.characters and self.score >= DOUBTFUL else self.sense.layout

    @cached_property
    def height_mm(self) -> float:
        marks, line = self.sense.marks, self.line
        if self.in_own_font is not None:
            return self.in_own_font.height_mm
        if line is None or self.decoding is None:
            return 0.0
        return line.line.height_mm if marks is None else marks.felt.line.height_mm

    @cached_property
    def rotation_deg(self) -> float:
        if self.in_own_font is not None:
            return self.in_own_font.rotation_deg
        return 0.0 if self.line is None or self.decoding is None else self.line.line.turned_deg

    @property
    def spaced_text(self) -> str:
        return with_spaces(self.text, self.spaces_after)
