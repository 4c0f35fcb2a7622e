"""Choose the text of a part, and measure what speaks for it.

    one sense:  lattice --format--> text              marks of the text --\\
    both:       fuse_lattices --format--> text                             measures --> score
                                          posteriors of the text --------/
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cached_property, partial
from statistics import fmean
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from glyphs.surface.display import one_line
from recognition.decide.deferred import deferred
from recognition.decide.evidence import DecisionSettings, Evidence, SenseEvidence
from recognition.decide.fuse_lattices import fuse_lattices
from recognition.decide.reading import (
    Candidate,
    CharacterReading,
    OtherLine,
    Reading,
    mean_depth_mm,
    with_spaces,
)
from recognition.decide.risk_text import USUAL_RISK, risk_in_words
from recognition.decide.score import (
    DIGITS,
    LAND_MEASURES,
    PHOTO_MEASURES,
    STROKE_MEASURES,
    TEXT_MEASURES,
    Group,
    Measure,
    Measures,
    Score,
    covered_share,
    land_measures,
    log_odds,
    mean_belief,
    photo_measures,
    score_of,
    stroke_measures,
    text_measures,
)
from recognition.language.box import Box
from recognition.language.code_text import holds
from recognition.language.confusions import CharacterState, state_of
from recognition.language.constrained_decoding import Choice as Decoding
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.marks.depth import MarkDepth
from recognition.marks.measure import TextMarks
from recognition.marks.no_depth import NoDepth
from recognition.marks.strokes import PlaceStrokes
from recognition.recogniser.read_line import ReadLine, word_gaps
from recognition.see.places import boxes_of

if TYPE_CHECKING:
    from recognition.find.layouts import Layout
    from recognition.marks.grade import MarkGrade
    from recognition.marks.laid_text import LaidText
    from recognition.see.codes import Code

T = TypeVar("T")
Groups: TypeAlias = Mapping[tuple[Measure, ...], Callable[[], Group]]

DOUBTFUL = 0.5
"""Score below which a part may have a layout that is not read; one that has hardly exceeds 0.1."""
LEAST_PLACES = 4
"""Least number of characters without a format that count as text if they are unsure: a scratch is read as a 1, two
dents as OO."""


@dataclass(frozen=True, eq=False)
class Choice:
    """The text that is chosen from the evidence, and what was measured for it.

    Attributes:
        senses: senses that it rests on; the first one gives its places.
        alone: readings of each sense alone, if both have looked.
        lattice: posteriors of the places under the format; None if no line was found.
        open_lattice: posteriors without the format.
        decoding: best text under the format, and its rivals; None if nothing can be read as text.
        characters: the text with its marks; empty if there is none.
        marks: marks of the text; None without heights.
        others: other lines of the part.
        codes: codes in its photographs.
        spaces_after: places that a word gap follows.
        accept_risk: greatest share of wrong readings among those accepted.
        threshold: least score for acceptance, which keeps that risk.
        measures: measures of the text, computed when they are read.
        score: probability that the text is right.
        odds: log odds of the text by its posteriors.
    """

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

    __repr__ = one_line

    @property
    def sense(self) -> SenseEvidence:
        """The sense that gives the places of the text."""
        return self.senses[0]

    @property
    def line(self) -> ReadLine | None:
        """The line of the text."""
        return None if self.sense.lines is None else self.sense.lines.main

    @property
    def is_fused(self) -> bool:
        """Whether posteriors of both senses are combined."""
        return len(self.senses) > 1

    @property
    def text(self) -> str:
        """The text without blanks; empty if there is none."""
        return "".join(place.char for place in self.characters)

    @cached_property
    def strokes(self) -> tuple[PlaceStrokes, ...]:
        """Felt strokes of the text and its rivals, place by place; empty if unknown."""
        if self.marks is None or self.posteriors is None:
            return ()
        return self.marks.strokes(self.posteriors, slope=score_of(self.scored_as).slope)

    @property
    def whole(self) -> tuple[bool, ...]:
        """Whether each character was felt from edge to edge; empty if that is not known."""
        known = self.marks is not None and self.marks.has_strokes(self.posteriors)
        return self.marks.whole if self.marks is not None and known else ()

    @property
    def posteriors(self) -> Lattice | None:
        """Posteriors with which strokes are weighed."""
        return self.lattice if self.is_fused or self.line is None else self.line.lattice

    @property
    def scored_as(self) -> str:
        """Source whose score and threshold apply: "fused" only if the posteriors of both senses are combined."""
        return "fused" if self.is_fused else self.sense.source

    @property
    def is_low(self) -> bool:
        """Whether there is a text whose score is below the threshold."""
        return bool(self.characters) and self.score < self.threshold

    @property
    def shortfall(self) -> str:
        """The shortfall of the score from the threshold, in words."""
        digits = next((n for n in range(3, 7) if round(self.score, n) < self.threshold), 6)
        least = f"{self.threshold:g} for {risk_in_words(self.accept_risk)}"
        return f"confidence {self.score:.{digits}f} is below the threshold {least}"

    @property
    def may_be_explained(self) -> bool:
        """Whether the score is low, and not because the marks are in a layout that is not read."""
        return self.is_low and not self.layout

    @property
    def font(self) -> str:
        """Font along whose strokes the marks are graded, or else the most probable face; empty if none fits."""
        if self.in_own_font is not None:
            return self.in_own_font.font.name
        along = None if self.marks is None or self.marks.font_fits else self.marks.along
        faces = {name: p for name, p in self.faces.items() if along is None or name != along.font.name}
        return max(faces, key=faces.__getitem__, default="")

    @property
    def faces(self) -> Mapping[str, float]:
        """Probability of each face that the text may be in, and of none; empty if unknown."""
        return {} if self.line is None or not self.characters else self.line.faces

    @property
    def in_own_font(self) -> LaidText | None:
        """The text in the font of the part; None if that is unknown."""
        return None if self.marks is None else self.marks.in_own_font

    @property
    def other_font_fits_better(self) -> bool:
        """Whether the marks fit another font clearly better than the named ones."""
        return self.marks is not None and self.marks.other_font_fits_better

    @property
    def layout(self) -> Layout | None:
        """Other layout in which a doubtful part reads well; None without one."""
        return None if self.characters and self.score >= DOUBTFUL else self.sense.layout

    @cached_property
    def height_mm(self) -> float:
        """Character height; 0 if unknown."""
        marks, line = self.sense.marks, self.line
        if self.in_own_font is not None:
            return self.in_own_font.height_mm
        if line is None or self.decoding is None:
            return 0.0
        return line.line.height_mm if marks is None else marks.felt.line.height_mm

    @cached_property
    def rotation_deg(self) -> float:
        """Rotation of the line, from +x towards +y."""
        if self.in_own_font is not None:
            return self.in_own_font.rotation_deg
        return 0.0 if self.line is None or self.decoding is None else self.line.line.turned_deg

    @property
    def spaced_text(self) -> str:
        """The text with its word gaps."""
        return with_spaces(self.text, self.spaces_after)

    def is_held_by(self, code_text: str) -> bool | None:
        """Whether a code holds the text; None if it holds no serial."""
        return holds(code_text, self.spaced_text)


def choose_text(
    evidence: Evidence,
    settings: DecisionSettings,
    alone: Mapping[str, Reading],
    *,
    without: frozenset[Measure] = frozenset(),
) -> Choice:
    """Choose the text of a part.

    Args:
        evidence: evidence of one sense or both.
        settings: format of the serial, further lines that the part should have, thresholds.
        alone: readings of each sense alone, if there are both.
        without: measures that the score treats as unknown, to see what each is worth.
    """
    if not alone:
        choice = _text_of_sense(evidence.senses[0], settings)
    else:
        choice = replace(_text_of_both(evidence, settings, alone), alone=alone)
    choice = _measured(replace(choice, codes=_codes(choice, evidence)))
    if is_dirt(choice):
        choice = replace(choice, characters=(), spaces_after=frozenset())
    return _scored(choice, evidence, settings, without)


def _codes(choice: Choice, evidence: Evidence) -> tuple[Code, ...]:
    """Codes of the photographs; without a position if that is not known in the frame of the text."""
    if evidence.vision is None:
        return ()
    codes = evidence.vision.log.codes
    same_frame = evidence.vision.scaled == choice.sense.scaled
    return codes if same_frame else tuple(replace(code, corners=()) for code in codes)


def _text_of_sense(sense: SenseEvidence, settings: DecisionSettings) -> Choice:
    part, grammar = sense.lines, settings.grammar
    main = None if part is None else part.main
    if part is None or main is None:
        return Choice((sense,))
    decoding = choose(main.lattice, grammar)
    lattice = replace(main.lattice, boxes=boxes_of(main.line, main.columns))
    openly, columns = main.open_places
    openly = replace(openly, boxes=boxes_of(main.line, columns))
    if not decoding.text or not main.is_text:
        return Choice((sense,), lattice=lattice, open_lattice=openly)
    unsure = decoding.probability < settings.least_score(sense.source)
    if grammar is None and len(decoding.text) < LEAST_PLACES and unsure:
        return Choice((sense,), lattice=lattice)
    return Choice(
        (sense,),
        lattice=lattice,
        open_lattice=openly,
        decoding=decoding,
        characters=characters_of(decoding, lattice),
        others=tuple(_other_lines(sense, settings)),
        spaces_after=spaces_of(main, decoding.text, grammar),
        odds=log_odds(decoding.probability * main.likely),
    )


def _text_of_both(evidence: Evidence, settings: DecisionSettings, alone: Mapping[str, Reading]) -> Choice:
    """Text of the combined posteriors; of one sense if the other has read nothing, or other places."""
    touch, vision = evidence.senses
    felt, seen = (_text_of_sense(sense, settings) for sense in (touch, vision))
    if not alone["tactile"].characters:
        return seen if alone["vision"].characters else replace(felt, decoding=None, characters=())
    open_lattice = _fused(felt.open_lattice, seen.open_lattice) or felt.open_lattice
    lattice = _fused(felt.lattice, seen.lattice)
    decoding = None if lattice is None else choose(lattice, settings.grammar)
    if lattice is None or decoding is None or not decoding.text:
        return replace(felt, open_lattice=open_lattice)
    known = None if settings.grammar is None else settings.grammar.spaces(decoding.text)
    return Choice(
        (touch, vision),
        lattice=lattice,
        open_lattice=open_lattice,
        decoding=decoding,
        characters=characters_of(decoding, lattice),
        others=_joined_lines(alone["tactile"], alone["vision"]),
        spaces_after=felt.spaces_after if known is None else known,
        odds=None
        if touch.lines is None or touch.lines.main is None
        else log_odds(decoding.probability * touch.lines.main.likely),
    )


def _fused(felt: Lattice | None, seen: Lattice | None) -> Lattice | None:
    """Combined posteriors of both senses; None if they have not read equally many places.

    Equally many count as the same places, because both senses read the line with the format, or the only one.
    """
    if felt is None or seen is None or felt.n_places != seen.n_places:
        return None
    return fuse_lattices(felt, seen)


def characters_of(
    decoding: Decoding, lattice: Lattice, *, most_candidates: int = 5
) -> tuple[CharacterReading, ...]:
    """List the candidates of each place: the chosen character first, then its rivals under the format."""
    characters = []
    for k, chosen in enumerate(decoding.text):
        beliefs = decoding.place(k)
        order = [chosen, *(c for c in beliefs if c != chosen)][:most_candidates]
        shares = [min(1.0, beliefs.get(c, 0.0)) for c in order]
        candidates = tuple(map(Candidate, order, shares, shares))
        characters.append(CharacterReading(candidates, lattice.boxes[k], state=state_of(beliefs)))
    return tuple(characters)


def spaces_of(line: ReadLine, text: str, grammar: Grammar | None) -> frozenset[int]:
    """Find the places that a word gap follows: from the format if it fixes them, or else from the line.

    Args:
        line: the line that was read.
        text: text without blanks.
        grammar: format of the text.
    """
    known = None if grammar is None else grammar.spaces(text)
    return word_gaps(line.columns, line.looks) if known is None else known


def hull(boxes: Sequence[Box]) -> Box | None:
    """Return the common hull of boxes; None if there are none."""
    if not boxes:
        return None
    corners = np.array([astuple(box) for box in boxes])
    return Box(*corners[:, :2].min(axis=0).tolist(), *corners[:, 2:].max(axis=0).tolist())


def _other_lines(
    sense: SenseEvidence, settings: DecisionSettings, *, least_serial_evidence: float = -12.0
) -> list[OtherLine]:
    """Lines beside the serial: requested ones under their formats, others without one.

    Args:
        sense: evidence with the lines.
        settings: formats of the serial and of the requested lines.
        least_serial_evidence: log probability of the serial's format on a line, below which the line is not the
            serial. In the exam, 41 second lines of six characters, under a format of eight, have -19.5 at most; their
            serials have -5.5 at least.
    """
    assert sense.lines is not None
    score = score_of(sense.source)
    named = [
        _named_line(name, line, settings.asked[name].grammar, score)
        for name, line in sense.lines.named.items()
        if line.is_text
    ]
    return named + [
        _unassigned_line(line, settings.grammar, score, least_serial_evidence) for line in sense.lines.others
    ]


def _named_line(name: str, line: ReadLine, grammar: Grammar, score: Score) -> OtherLine:
    decoding = choose(line.lattice, grammar)
    text = with_spaces(decoding.text, spaces_of(line, decoding.text, grammar)).rstrip()
    box = hull(boxes_of(line.line, line.columns))
    return OtherLine(name, text, score.of_belief(decoding.probability), box, line=line.line)


def _unassigned_line(
    line: ReadLine, grammar: Grammar | None, score: Score, least_serial_evidence: float
) -> OtherLine:
    lattice, columns = line.open_places
    text = with_spaces(lattice.text, word_gaps(columns, line.looks))
    sure = float(np.exp(lattice.log_belief.max(axis=1).sum()))
    may_be_serial = line.evidence_of(grammar) >= least_serial_evidence
    box = hull(boxes_of(line.line, columns))
    return OtherLine("", text, score.of_belief(sure), box, may_be_serial=may_be_serial, line=line.line)


def _joined_lines(touch: Reading, vision: Reading) -> tuple[OtherLine, ...]:
    """The other lines of both senses, the surer one of each."""
    joined = {(line.name, line.name or line.text): line for line in touch.others}
    named = {line.text for line in (*touch.others, *vision.others) if line.name}
    for line in vision.others:
        felt = joined.get((line.name, line.name or line.text))
        box = line.box if vision.unit == touch.unit else None
        if felt is None or line.confidence > felt.confidence:
            joined[line.name, line.name or line.text] = replace(line, box=box if felt is None else felt.box)
    # drop unassigned text that the other sense has read as a requested line
    return tuple(line for line in joined.values() if line.name or line.text not in named)


def _measured(choice: Choice) -> Choice:
    """The choice with the marks of its text, which are measured when they are first read."""
    marks = choice.sense.marks
    if marks is None or choice.lattice is None or choice.line is None or not choice.characters:
        return choice
    text_marks = marks.of_text(choice.text, [place.box for place in choice.characters])
    characters = tuple(
        replace(
            place,
            depth=deferred(partial(_depth_at, text_marks, k, MarkDepth)),
            no_depth=deferred(partial(_depth_at, text_marks, k, NoDepth)),
            grade=deferred(partial(_grade_at, text_marks, k)),
        )
        for k, place in enumerate(choice.characters)
    )
    return replace(choice, marks=text_marks, characters=characters)


def _depth_at(marks: TextMarks, place: int, kind: type[T]) -> T | None:
    depth = marks.depths[place]
    return depth if isinstance(depth, kind) else None


def _grade_at(marks: TextMarks, place: int) -> MarkGrade | None:
    return marks.grades[place]


def is_dirt(choice: Choice, *, least_felt: float = 0.35) -> bool:
    """Whether an unreadable line is no text but dirt or land: hardly a stroke of it was felt.

    Args:
        choice: with its marks.
        least_felt: least share of strokes felt, mean of the characters.
    """
    unread = [
        place.state is not None and place.state.state is CharacterState.NOT_READ
        for place in choice.characters
    ]
    if not unread or not all(unread):
        return False
    felt = [place.felt for place in choice.strokes if place.felt is not None]
    return bool(felt) and fmean(felt) < least_felt


def _scored(
    choice: Choice, evidence: Evidence, settings: DecisionSettings, without: frozenset[Measure]
) -> Choice:
    """The choice with its measures and its score."""
    groups = measure_groups(choice, evidence, settings)
    known: Mapping[Measure, float] = Measures(groups)
    if without:
        known = {name: value for name, value in known.items() if name not in without}
    score = score_of(choice.scored_as).probability(known) if choice.characters else 0.0
    margin = min((place.margin for place in choice.characters), default=0.0)
    of_score = {Measure.CONFIDENCE: round(score, DIGITS), Measure.MARGIN: margin}
    return replace(
        choice,
        accept_risk=settings.accept_risk,
        threshold=settings.least_score(choice.scored_as),
        measures=Measures({**groups, tuple(of_score): lambda: of_score}),
        score=score,
    )


def measure_groups(choice: Choice, evidence: Evidence, settings: DecisionSettings) -> Groups:
    """Functions that measure a part with its text."""
    line, touch, vision = choice.line, evidence.touch, evidence.vision
    felt = choice.alone.get("tactile")
    openly = choice.open_lattice if felt is None else felt.trace.open_lattice

    def laid() -> LaidText | None:
        own = None if choice.marks is None else choice.marks.laid
        return own if felt is None else own or felt.trace.laid

    def height_mm() -> float | None:
        return choice.height_mm if choice.sense.scaled and choice.height_mm > 0.0 else None

    def covered() -> float | None:
        marks = choice.marks
        if marks is not None and marks.has_strokes(choice.posteriors) and marks.nothing_covered:
            return 0.0
        return covered_share(choice.strokes)

    relief = None if touch is None or not touch.views else touch.views[0].relief
    photo = None if vision is None else vision.log.photo
    format_nats = None if line is None or choice.decoding is None else line.evidence
    return {
        TEXT_MEASURES: lambda: _text_measures(choice, settings),
        (Measure.FORMAT,): lambda: {Measure.FORMAT: format_nats},
        (Measure.HEIGHT,): lambda: {Measure.HEIGHT: height_mm()},
        (Measure.DEPTH,): lambda: {Measure.DEPTH: mean_depth_mm(choice.characters)},
        STROKE_MEASURES: lambda: stroke_measures(choice.strokes),
        (Measure.COVERED,): lambda: {Measure.COVERED: covered()},
        (Measure.BELIEF,): lambda: {Measure.BELIEF: mean_belief(openly)},
        LAND_MEASURES: lambda: land_measures(relief, laid()),
        PHOTO_MEASURES: lambda: photo_measures(photo),
    }


def _text_measures(choice: Choice, settings: DecisionSettings) -> Mapping[Measure, float]:
    """Measures of the text that the score needs; empty if there is none."""
    if choice.line is None or choice.decoding is None or not choice.characters:
        return {}
    texts = {choice.text, *(reading.plain_text for reading in choice.alone.values())}
    return text_measures(
        probability=choice.decoding.probability,
        count_probability=choice.line.likely,
        places=[place.confidence for place in choice.characters],
        format_given=settings.grammar is not None,
        same_text=len(texts) == 1 if choice.is_fused else None,
    )
