"""Evidence of a part: what each sense has seen, found and measured; the decision rests on it alone.

    see --> views   find --> lines   measure --> marks   log --\\
                                                                SenseEvidence --\\
                                                                                 Evidence --decide--> Reading
                                                    (the other sense likewise) --/
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, Protocol

from glyphs.surface.display import OneLine
from recognition.decide.decision import CertifiedAcceptance, Finding

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import HeightMap
    from recognition.decide.depth_rules import DepthRule
    from recognition.find.layouts import Layout
    from recognition.find.part_lines import PartLines
    from recognition.find.request import LineFormat
    from recognition.language.grammar import Grammar
    from recognition.language.orientation import Orientation
    from recognition.marks.measure import Marks
    from recognition.recogniser.read_line import ReadLine
    from recognition.see.codes import Code
    from recognition.see.view import View
    from whisker_array.scan.scan import Scan

EVEN = 0.5
"""Score above which the text of another look is more likely right than wrong, so that it counts."""
Source = Literal["tactile", "vision"]


class DecisionSettings(Protocol):
    """Settings that a decision needs, as `recognition.settings.ReaderSettings` has them."""

    @property
    def fonts(self) -> Sequence[object]: ...

    @property
    def grammar(self) -> Grammar | None: ...

    @property
    def line_formats(self) -> Mapping[str, LineFormat]: ...

    @property
    def orientation(self) -> Orientation: ...

    @property
    def depth_rules(self) -> Sequence[DepthRule]: ...

    @property
    def certified(self) -> CertifiedAcceptance | None: ...

    def risk_of(self, source: str) -> float: ...

    def least_score(self, source: str) -> float: ...


@dataclass(frozen=True, eq=False, repr=False)
class Log(OneLine):
    """Notes, seconds and faults of a sense; `other_texts` of other looks were more likely right than wrong."""

    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    surface: HeightMap | None = None
    scan: Scan | None = None
    rows_known: bool = True
    chosen_passes: bool = False
    photo: Photo | None = None
    whole_photo: Photo | None = None
    photos: int = 0
    codes: tuple[Code, ...] = ()
    other_texts: frozenset[str] = frozenset()
    stopped: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class SenseEvidence(OneLine):
    """Evidence of one sense; of its views, the one that counts comes first."""

    source: Source
    views: tuple[View, ...] = ()
    lines: PartLines | None = None
    marks: Marks | None = None
    log: Log = Log()

    def logged(self, **fields: object) -> SenseEvidence:
        return replace(self, log=replace(self.log, **fields))  # type: ignore[arg-type]

    @property
    def main(self) -> ReadLine | None:
        return None if self.lines is None else self.lines.main

    @property
    def layout(self) -> Layout | None:
        return None if self.lines is None else self.lines.layout

    @property
    def scaled(self) -> bool:
        """Whether lengths are mm, not pixels of a photograph of unknown scale."""
        return self.log.photo is None or self.log.photo.pitch_mm is not None


@dataclass(frozen=True, eq=False, repr=False)
class Evidence(OneLine):
    """Evidence of a part from one sense or both, with texts that its earlier readings gave."""

    touch: SenseEvidence | None = None
    vision: SenseEvidence | None = None
    expected: str = ""
    notes: tuple[str, ...] = ()
    other_texts: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not self.senses:
            raise ValueError("evidence comes from touch, from the camera, or from both")

    @classmethod
    def of(cls, sense: SenseEvidence) -> Evidence:
        return cls(touch=sense) if sense.source == "tactile" else cls(vision=sense)

    @property
    def senses(self) -> tuple[SenseEvidence, ...]:
        return tuple(sense for sense in (self.touch, self.vision) if sense is not None)

    @property
    def source(self) -> str:
        """Source of the reading: "tactile", "vision" or "fused"."""
        return self.senses[0].source if len(self.senses) == 1 else "fused"

    @property
    def seconds(self) -> Mapping[str, float]:
        """Time of each step; with both senses, the camera's are named so."""
        if self.touch is None or self.vision is None:
            return self.senses[0].log.seconds
        seen = {f"vision {step}": seconds for step, seconds in self.vision.log.seconds.items()}
        return {**self.touch.log.seconds, **seen}

    def codes(self, *, scaled: bool) -> tuple[Code, ...]:
        """Codes of the photographs, for a text whose lengths are mm or not; without a position in another frame."""
        if self.vision is None:
            return ()
        codes = self.vision.log.codes
        return codes if self.vision.scaled == scaled else tuple(replace(code, corners=()) for code in codes)

    def joined(self, other: Evidence) -> Evidence:
        return Evidence(
            self.touch or other.touch, self.vision or other.vision, self.expected or other.expected,
            (*self.notes, *other.notes), self.other_texts | other.other_texts,
        )  # fmt: skip
