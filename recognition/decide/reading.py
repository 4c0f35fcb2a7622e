"""The reading of one part."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from html import escape
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from recognition.decide.decision import BESIDE_SERIAL, Decision, Finding, ReadingFlag, decision_of, flags_of
from recognition.decide.deferred import deferrable
from recognition.language.box import Box
from recognition.language.confusions import CharacterState, PlaceState, state_of
from recognition.language.elements import named_fields

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import EdgeMap, HeightMap
    from recognition.decide.evidence import Evidence
    from recognition.decide.score import Measure
    from recognition.decide.verify import Verification
    from recognition.language.constrained_decoding import Choice
    from recognition.language.lattice import Lattice
    from recognition.marks.depth import MarkDepth
    from recognition.marks.grade import Action, MarkGrade
    from recognition.marks.laid_text import LaidText
    from recognition.marks.no_depth import NoDepth
    from recognition.marks.strokes import PlaceStrokes
    from recognition.see.codes import Code
    from recognition.see.text_line import TextLine
    from whisker_array.estimation.relief import Relief
    from whisker_array.scan.scan import Scan


@dataclass(frozen=True)
class Candidate:
    """One candidate for one place; its score is its probability, unless another reader gives one."""

    char: str
    score: float
    probability: float


@deferrable("depth", "grade", "no_depth")
@dataclass(frozen=True)
class CharacterReading:
    """One place of the line, mm; depth and grade are measured when they are first read."""

    candidates: tuple[Candidate, ...]
    box: Box
    depth: MarkDepth | None = None
    state: PlaceState | None = None
    grade: MarkGrade | None = None
    no_depth: NoDepth | None = None

    def __repr__(self) -> str:
        return f"CharacterReading({' '.join(f'{c.char} {c.probability:.3f}' for c in self.candidates)})"

    def __post_init__(self) -> None:
        if not self.candidates:
            raise ValueError("a character has at least one candidate")

    @property
    def char(self) -> str:
        """The best candidate."""
        return self.candidates[0].char

    @property
    def confidence(self) -> float:
        """Probability of the best candidate."""
        return self.candidates[0].probability

    @property
    def is_unread(self) -> bool:
        return self.state is not None and self.state.state is CharacterState.NOT_READ

    @property
    def margin(self) -> float:
        """Probability of the first candidate minus that of the second."""
        second = self.candidates[1].probability if len(self.candidates) > 1 else 0.0
        return self.confidence - second


@dataclass(frozen=True)
class OtherLine:
    """Another line of the part; one without a `name` in the request is unassigned text."""

    name: str
    text: str
    confidence: float
    box: Box | None = None
    may_be_serial: bool = True
    line: TextLine | None = field(default=None, compare=False, repr=False)

    @property
    def key(self) -> tuple[str, str]:
        """Its name, or its text if it has none: lines of both senses with one key are one line."""
        return self.name, self.name or self.text


@deferrable("laid", "strokes")
@dataclass(frozen=True, eq=False)
class ReadingTrace:
    """Intermediate results of a reading; None where a step was not reached. Strokes are compared when first read.

    `faces` has the probability of each face of the library and each named font, and under "" of none; empty if unknown.
    """

    edge_map: EdgeMap | None = None
    lattice: Lattice | None = None
    open_lattice: Lattice | None = None
    choice: Choice | None = None
    odds: float | None = None
    evidence: float | None = None
    scan: Scan | None = None
    height_map: HeightMap | None = None
    relief: Relief | None = None
    photo: Photo | None = None
    line: TextLine | None = None
    by_expert: Mapping[str, Lattice] = field(default_factory=lambda: MappingProxyType({}))
    faces: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    laid: LaidText | None = None
    strokes: tuple[PlaceStrokes, ...] = ()
    touch: Reading | None = None
    vision: Reading | None = None
    verification: Verification | None = None

    def __repr__(self) -> str:
        return f"ReadingTrace({', '.join(f.name for f in fields(self) if getattr(self, f.name))})"


_NO_TRACE = ReadingTrace()
Unit = Literal["mm", "px"]


@deferrable("font", "height_mm", "rotation_deg")
@dataclass(frozen=True)
class Reading:
    """The reading of one part; font, height, rotation and measures are determined when they are first read.

    Attributes:
        font: font whose strokes are graded, or else the most probable face (`ReadingTrace.faces`); empty if none fits.
        spaces_after: places, from 0, that a word gap follows.
        unit: unit of height and boxes: "mm", or "px" (pixels of the original photograph) if the scale is unknown.
    """

    characters: tuple[CharacterReading, ...]
    confidence: float
    findings: tuple[Finding, ...] = ()
    font: str = ""
    height_mm: float = 0.0
    rotation_deg: float = 0.0
    raised: bool = False
    box: Box | None = None
    source: str = "tactile"
    spaces_after: frozenset[int] = frozenset()
    seconds: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    notes: tuple[str, ...] = ()
    unit: Unit = "mm"
    others: tuple[OtherLine, ...] = ()
    photos: int = 0
    codes: tuple[Code, ...] = ()
    accept_risk: float | None = None
    threshold: float | None = None
    measures: Mapping[Measure, float] = field(default_factory=dict)
    trace: ReadingTrace = field(default=_NO_TRACE, compare=False, repr=False)
    evidence: Evidence | None = field(default=None, compare=False, repr=False)

    @property
    def flags(self) -> ReadingFlag:
        return flags_of(self.findings)

    @property
    def decision(self) -> Decision:
        """Accept, review or reject."""
        return self._decision_without(ReadingFlag.NONE)

    @property
    def serial_is_sure(self) -> bool:
        """Whether another scan cannot help: accepted but for the rules of its mark and its orientation."""
        return self.is_sure_but_for(BESIDE_SERIAL)

    def is_sure_but_for(self, flags: ReadingFlag) -> bool:
        """Whether it is accepted, or would be without these flags."""
        return self._decision_without(flags) is Decision.ACCEPT

    def _decision_without(self, flags: ReadingFlag) -> Decision:
        states = [place.state for place in self.characters]
        return decision_of(states, score=self.confidence, threshold=self.threshold, flags=self.flags & ~flags)

    @property
    def fields(self) -> Mapping[str, str]:
        """Named fields of the marking, "SER KB74" or "(21)KB74", on the serial's line and on others: SER -> KB74."""
        fields: dict[str, str] = {}
        for text in (self.text, *(line.text for line in self.others)):
            fields = {**named_fields(text), **fields}
        return fields

    @property
    def nats_read(self) -> float:
        """Evidence of the characters against a guess, nats: seven with one in doubt have more than one sure one."""
        return math.fsum(1.0 + max(math.log(max(c.confidence, 1e-9)), -3.0) for c in self.characters)

    @property
    def touch(self) -> Reading | None:
        """The reading of touch: this one, or part of a fused one; None if touch was not used."""
        return self if self.source == "tactile" else self.trace.touch

    @property
    def vision(self) -> Reading | None:
        """The reading of vision: this one, or part of a fused one; None if vision was not used."""
        return self if self.source == "vision" else self.trace.vision

    @property
    def scaled(self) -> bool:
        return self.unit == "mm"

    def __repr__(self) -> str:
        return f"Reading({self.text!r}, {self.decision.value}, {self.confidence:.4f}, {self.source})"

    def __str__(self) -> str:
        if not self.text:
            return "no characters"
        facts = [f"“{self.text}”, {self.decision.value}, confidence {self.confidence:.3f}"]
        facts += [self.font] if self.font else []
        if self.height_mm:
            facts.append(f"{self.height_mm:.2f} mm" if self.scaled else f"{self.height_mm:.0f} pixels high")
            facts += [] if self.touch is None else ["raised" if self.raised else "sunk"]
            facts.append(f"{self.rotation_deg:+z.1f}°")
        if self.depth_min_mm is not None:
            measured = sum(c.depth is not None for c in self.characters)
            facts.append(
                f"{'lowest' if self.raised else 'shallowest'} mark {self.depth_min_mm:.3f} mm"
                + (f" ({measured} of {n} measured)" if measured < (n := len(self.characters)) else "")
            )
        return ", ".join(facts)

    def _repr_html_(self) -> str:
        cell = "text-align:center;padding:1px 8px"
        columns = [
            (
                f"<b style='font-size:150%'>{escape(c.char)}</b>",
                f"{c.confidence:.3f}",
                "<br>".join(f"{escape(o.char)} {o.probability:.3f}" for o in c.candidates[1:3]),
            )
            for c in self.characters
        ]
        body = "".join(
            f"<tr><th style='{cell}'>{name}</th>{''.join(f'<td style={cell!r}>{v}</td>' for v in row)}</tr>"
            for name, row in zip(("character", "confidence", "or"), zip(*columns, strict=True), strict=False)
        )
        notes = "".join(f"<li>{escape(message)}</li>" for message in self.messages())
        return f"<div><p>{escape(str(self))}</p><table>{body}</table><ul>{notes}</ul></div>"

    def plot(self, *, title: str = "") -> Figure:
        """Draw all measurements, boxes and candidates; in a session, `matplotlib.pyplot.show()` displays the figure."""
        import matplotlib.pyplot as plt

        from recognition.decide.picture import reading_figure

        figure = reading_figure(self, title=title, figure=plt.figure())
        if "inline" in plt.get_backend():
            plt.close(figure)  # a notebook shows the returned figure; it would show an open one twice
        return figure

    @property
    def depth_min_mm(self) -> float | None:
        """Least depth of the characters whose depth is known; None without any."""
        known = [c.depth.min_mm for c in self.characters if c.depth is not None]
        return min(known, default=None)

    @property
    def depth_mean_mm(self) -> float | None:
        """Mean depth of the characters whose depth is known; None without any."""
        return mean_depth_mm(self.characters)

    def messages(self) -> tuple[str, ...]:
        """Return the reasons in words, the one or two that decide first (`recognition.decide.reasons`)."""
        from recognition.decide.reasons import reasons_of

        return tuple(reason.text for reason in reasons_of(self))

    @property
    def actions(self) -> tuple[Action, ...]:
        """Action for each character's mark; none if it is accepted, in another layout, or not of the format."""
        # imported here, so that storing or showing readings does not load the libraries that grade marks
        from recognition.marks.grade import Action

        if self.decision is Decision.ACCEPT or self.flags & ReadingFlag.LAYOUT:
            return (Action.NONE,) * len(self.characters)
        # a character that only a wrong format has there lacks its strokes however clean the part is
        misfits = {k for f in self.findings if f.flag & ReadingFlag.FORMAT_NOT_MET for k in f.places}
        return tuple(
            Action.NONE if c.grade is None or k in misfits else c.grade.action
            for k, c in enumerate(self.characters, start=1)
        )

    @property
    def plain_text(self) -> str:
        """The serial without blanks."""
        return "".join(c.char for c in self.characters)

    @property
    def text(self) -> str:
        """The serial; a space where the line has a word gap."""
        return with_spaces(self.plain_text, self.spaces_after)


def characters_of(
    decoding: Choice, lattice: Lattice, *, most_candidates: int = 5
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


def mean_depth_mm(characters: Sequence[CharacterReading]) -> float | None:
    """Mean depth of the characters whose depth is known; None without any."""
    known = [c.depth.mean_mm for c in characters if c.depth is not None]
    return math.fsum(known) / len(known) if known else None


def with_spaces(text: str, spaces: Collection[int]) -> str:
    """Insert a blank after each of these places of a text."""
    return "".join(char + " " * (k in spaces) for k, char in enumerate(text))
