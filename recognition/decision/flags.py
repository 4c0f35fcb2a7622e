"""Flags of a reading, and what a flag means on one part."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Flag, auto
from functools import reduce
from operator import or_


class ReadingFlag(Flag):
    """Doubts about a reading; no flag is set on a plain one."""

    NONE = 0
    NO_CHARACTERS = auto()
    FORMAT_NOT_MET = auto()
    LOW_CONFIDENCE = auto()
    CASE_UNKNOWN = auto()
    CONTACT_LOST = auto()
    JAMMED = auto()
    OUT_OF_RANGE = auto()
    DROPOUTS = auto()
    FOREIGN_SHAPES = auto()
    UNREAD_MARKS = auto()
    TOO_SHALLOW = auto()
    TOO_SMALL = auto()
    DEPTH_UNKNOWN = auto()
    FORMAT_OVERRULED = auto()
    CHECK_BLIND = auto()
    SEARCH_EXHAUSTED = auto()
    MISMATCH = auto()
    SENSES_DISAGREE = auto()
    LINE_MISSING = auto()
    TOO_DEEP = auto()
    BURR_TOO_HIGH = auto()
    NO_DEPTH_RULE = auto()
    NOT_CERTIFIED = auto()
    STROKES_MISSING = auto()
    STROKES_UNDECIDED = auto()
    CODE_DISAGREES = auto()
    WHISKER_FAULTY = auto()
    BENCH_FAULTY = auto()
    ORIENTATION_UNKNOWN = auto()
    NOT_WHOLE = auto()
    UNTOLD = auto()
    BELIEVED_OTHERWISE = auto()
    STAGE_FAILED = auto()

    def messages(self) -> tuple[str, ...]:
        """The flags in words."""
        return tuple(finding.text for finding in self.findings())

    def findings(self) -> tuple[Finding, ...]:
        """The flags in their general words."""
        return tuple(Finding(flag, text) for flag, text in _MESSAGES.items() if flag in self)


_MESSAGES = {
    ReadingFlag.NO_CHARACTERS: "no characters found (check that the serial is in view)",
    ReadingFlag.FORMAT_NOT_MET: "the marks do not fit the format (check the part and the format)",
    ReadingFlag.LOW_CONFIDENCE: "low confidence",
    ReadingFlag.CASE_UNKNOWN: "a letter may be a small one (a format says which)",
    ReadingFlag.CONTACT_LOST: "the whisker lost contact in places (raise the preload)",
    ReadingFlag.JAMMED: "the whisker jammed on walls in places (lower k = l2/l1)",
    ReadingFlag.OUT_OF_RANGE: "the signal left the converter's range in places (lower the gain)",
    ReadingFlag.DROPOUTS: "parts of the map are missing (measure it again if they hide characters)",
    ReadingFlag.FOREIGN_SHAPES: "the font may lack a character that stands there (look at the part)",
    ReadingFlag.UNREAD_MARKS: "there are marks beside the serial (check that all of it was read)",
    ReadingFlag.TOO_SHALLOW: "the mark is too shallow",
    ReadingFlag.TOO_DEEP: "the mark is too deep",
    ReadingFlag.BURR_TOO_HIGH: "the burr beside the mark is too high",
    ReadingFlag.TOO_SMALL: "the characters are too small",
    ReadingFlag.NO_DEPTH_RULE: "the rule names no depth for characters of this height",
    ReadingFlag.DEPTH_UNKNOWN: "the depth of a character could not be measured (scan it again)",
    ReadingFlag.FORMAT_OVERRULED: "the format changed what was read (compare it with the part)",
    ReadingFlag.CHECK_BLIND: "the check digit cannot tell the likeliest serials apart (look at the part)",
    ReadingFlag.SEARCH_EXHAUSTED: "too many possible serials to try them all (look at the part)",
    ReadingFlag.MISMATCH: "this is not the expected serial (check the part and the order)",
    ReadingFlag.LINE_MISSING: "a line that was asked for was not found (check the part)",
    ReadingFlag.NOT_CERTIFIED: "not covered by the certificate (look at the part)",
    ReadingFlag.STROKES_MISSING: "most strokes of a character are missing (clean it and scan it again)",
    ReadingFlag.STROKES_UNDECIDED: "the strokes that tell two characters apart were not felt (clean it)",
    ReadingFlag.CODE_DISAGREES: "a code on the part holds another serial (look at the part)",
    ReadingFlag.WHISKER_FAULTY: "a whisker is worn, loose or faulty (see to it)",
    ReadingFlag.BENCH_FAULTY: "something is wrong with the stage, the plate's seat or the wiring (see to it)",
    ReadingFlag.ORIENTATION_UNKNOWN: "the serial can be read otherwise with the part turned (set the orientation)",
    ReadingFlag.SENSES_DISAGREE: "touch and camera read different serials (look at the part)",
    ReadingFlag.NOT_WHOLE: "a character was not felt from edge to edge (scan a longer or wider stretch)",
    ReadingFlag.UNTOLD: "too few lines were felt to tell two characters apart (feel more lines)",
    ReadingFlag.BELIEVED_OTHERWISE: "another text was believed before (look at the part)",
    ReadingFlag.STAGE_FAILED: "the stage failed between passes (see to it)",
}
MEASURE_FLAGS = (
    ReadingFlag.TOO_SHALLOW
    | ReadingFlag.TOO_DEEP
    | ReadingFlag.BURR_TOO_HIGH
    | ReadingFlag.TOO_SMALL
    | ReadingFlag.DEPTH_UNKNOWN
    | ReadingFlag.NO_DEPTH_RULE
)
"""Rules for the mark that are broken; findings give places and numbers."""
EXPLANATIONS = ReadingFlag.STROKES_MISSING | ReadingFlag.STROKES_UNDECIDED
"""Why a score is low: they break no contract by themselves."""


@dataclass(frozen=True)
class Finding:
    """A flag on one part.

    Attributes:
        flag: what is the matter; none of a note.
        text: in words, with places and numbers: "too shallow for R: 7 at place 2 0.06 mm".
        places: that it is about, from 1.
    """

    flag: ReadingFlag
    text: str
    places: tuple[int, ...] = ()

    @property
    def code(self) -> str:
        """Name of the flag for programs: low_confidence; empty of a note."""
        return (self.flag.name or "").lower() if self.flag else ""

    def __str__(self) -> str:
        return self.text


BENCH_FLAGS = ReadingFlag.WHISKER_FAULTY | ReadingFlag.BENCH_FAULTY


def bench_faults(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the faults of whiskers and bench, in words."""
    return tuple(finding.text for finding in findings if finding.flag & BENCH_FLAGS)


def flags_of(findings: Iterable[Finding]) -> ReadingFlag:
    """Combine the flags of all findings."""
    return reduce(or_, (finding.flag for finding in findings), ReadingFlag.NONE)
