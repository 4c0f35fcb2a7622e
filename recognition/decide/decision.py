"""Accept, review or reject: one pure function decides everywhere; with its flags and findings.

    score: probability that the whole serial is right ---- at least the threshold ----+
    contracts: rules that hold whatever the score is ----- none broken ---------------+--> accept; else review
    places: half of them cannot be read -------------------------------------------------> reject

Accept means that nothing is left to do: an accepted part asks for no action (`Reading.actions`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum, Flag, StrEnum, auto
from functools import reduce
from operator import or_
from typing import Self

from recognition.language.confusions import CharacterState, PlaceState


class Decision(StrEnum):
    """Accept, review or reject."""

    ACCEPT = "accept"
    REVIEW = "review"
    REJECT = "reject"


def decision_of(
    places: Sequence[PlaceState | None],
    *,
    score: float,
    threshold: float | None,
    flags: ReadingFlag,
    hopeless_share: float = 0.5,
) -> Decision:
    """Accept, review or reject; parts of whose places `hopeless_share` cannot be read are rejected."""
    unread = sum(state is not None and state.state is CharacterState.NOT_READ for state in places)
    if unread >= hopeless_share * len(places):
        return Decision.REJECT
    if flags & BROKEN or (threshold is not None and score < threshold):
        return Decision.REVIEW
    return Decision.ACCEPT


class Kind(Enum):
    """Effect of a flag; those of broken rules and of the stage send a part to review whatever its score."""

    CONTRACT = auto()  # a rule about the serial is broken
    SCORE = auto()
    EXPLANATION = auto()  # why a score is low; breaks no contract by itself
    MARK = auto()  # a rule that the user set for the mark is broken
    SCAN = auto()
    BENCH = auto()
    STAGE = auto()  # not all that was requested could be scanned


class ReadingFlag(Flag):
    """Doubts about a reading, most important first; a reading without doubts has no flag."""

    kind: Kind | None
    text: str

    def __new__(cls, kind: Kind | None, text: str) -> Self:
        flag = object.__new__(cls)
        flag._value_ = 1 << (len(cls.__members__) - 1) if kind else 0
        flag.kind, flag.text = kind, text
        return flag

    NONE = None, ""
    MISMATCH = Kind.CONTRACT, "this is not the expected serial (check the part and the order)"
    LAYOUT = Kind.EXPLANATION, "the marks are in a layout that is not read (look at the part)"
    NO_CONTRAST = Kind.SCORE, "no contrast: the photograph shows nothing (uncover the lens, light the part)"
    OVEREXPOSED = Kind.SCORE, "overexposed: the photograph is white (expose shorter, turn the light down)"
    OUT_OF_FOCUS = (
        Kind.SCORE,
        "out of focus: the photograph has no sharp edge (focus the camera, check that the part is in view)",
    )
    NO_EDGES = Kind.SCORE, "no edges: the map is flat (measure the side with the marks)"
    NO_CHARACTERS = Kind.SCORE, "no characters found (check that the serial is in view)"
    FORMAT_NOT_MET = Kind.CONTRACT, "the marks do not fit the format (check the part and the format)"
    SENSES_DISAGREE = Kind.CONTRACT, "touch and camera read different serials (look at the part)"
    CODE_DISAGREES = Kind.CONTRACT, "a code on the part holds another serial (look at the part)"
    ORIENTATION_UNKNOWN = (
        Kind.CONTRACT,
        "the serial can be read differently with the part turned (set the orientation)",
    )
    RISK_NOT_KEPT = Kind.CONTRACT, "this sense cannot promise the accepted risk (allow more risk)"
    LOW_CONFIDENCE = Kind.SCORE, "low confidence"
    CASE_UNKNOWN = Kind.CONTRACT, "a letter may be a lower-case one (set a format)"
    LINE_MISSING = Kind.CONTRACT, "a requested line was not found (check the part)"
    STRUCK_OUT = Kind.CONTRACT, "a line runs through the serial, as if it were struck out (look at the part)"
    SPOT = Kind.CONTRACT, "a glint or a spot lies on a character (move the lamp, or clean the part)"
    COVERED = Kind.CONTRACT, "something lies on a character (clean the part and scan it again)"
    NOT_WHOLE = Kind.CONTRACT, "a character was not felt from edge to edge (scan a longer or wider stretch)"
    TOO_FEW_LINES = Kind.CONTRACT, "too few lines were felt to distinguish two characters (feel more lines)"
    BELIEVED_OTHERWISE = Kind.CONTRACT, "an earlier look read another text (look at the part)"
    STROKES_MISSING = Kind.EXPLANATION, "most strokes of a character are missing (clean it and scan it again)"
    STROKES_UNDECIDED = (
        Kind.EXPLANATION,
        "the strokes that distinguish two characters were not felt (clean it)",
    )
    UNREAD_MARKS = Kind.CONTRACT, "there are marks beside the serial (check that all of it was read)"
    FORMAT_OVERRULED = Kind.CONTRACT, "the format changed what was read (compare it with the part)"
    CHECK_BLIND = (
        Kind.CONTRACT,
        "the check digit cannot distinguish the most likely serials (look at the part)",
    )
    SEARCH_EXHAUSTED = Kind.CONTRACT, "too many possible serials to try them all (look at the part)"
    SEARCH_STOPPED = Kind.CONTRACT, "the time limit ended the search (allow more time)"
    FOREIGN_SHAPES = Kind.CONTRACT, "the font may lack a character of the part (look at the part)"
    NOT_CERTIFIED = Kind.CONTRACT, "not covered by the certificate (look at the part)"
    TOO_SHALLOW = Kind.MARK, "the mark is too shallow"
    TOO_DEEP = Kind.MARK, "the mark is too deep"
    BURR_TOO_HIGH = Kind.MARK, "the burr beside the mark is too high"
    TOO_SMALL = Kind.MARK, "the characters are too small"
    NO_DEPTH_RULE = Kind.MARK, "the rule has no depth for characters of this height"
    DEPTH_UNKNOWN = Kind.MARK, "the depth of a character could not be measured (scan it again)"
    CONTACT_LOST = Kind.SCAN, "the whisker lost contact in places (raise the preload)"
    JAMMED = Kind.SCAN, "the whisker jammed on walls in places (lower k = l2/l1)"
    OUT_OF_RANGE = Kind.SCAN, "the signal left the converter's range in places (lower the gain)"
    DROPOUTS = Kind.SCAN, "parts of the map are missing (measure it again if they hide characters)"
    WHISKER_FAULTY = Kind.BENCH, "a whisker is worn, loose or faulty (inspect it)"
    BENCH_FAULTY = (
        Kind.BENCH,
        "something is wrong with the stage, the plate's seat or the wiring (inspect them)",
    )
    STAGE_FAILED = Kind.STAGE, "the stage failed between passes (inspect it)"
    CHANNELS_MIXED = Kind.BENCH, "channels are exchanged or recorded twice (check plugs and their order)"

    @classmethod
    def of(cls, *kinds: Kind) -> ReadingFlag:
        return reduce(or_, (flag for flag in cls if flag.kind in kinds))


CHECK_FORMAT = "(check the part and the format)"
"""End of the messages about a text that is clear but not of the format; `pipeline.runs.summary` counts them."""
BROKEN = ReadingFlag.of(Kind.CONTRACT, Kind.MARK, Kind.STAGE) | ReadingFlag.CHANNELS_MIXED
"""Flags that send a reading to review whatever its score."""
MEASURE_FLAGS = ReadingFlag.of(Kind.MARK)
BESIDE_SERIAL = MEASURE_FLAGS | ReadingFlag.ORIENTATION_UNKNOWN
"""Flags that no further touch can clear; without them the serial is sure."""
EXPLANATIONS = ReadingFlag.of(Kind.EXPLANATION)


@dataclass(frozen=True)
class CertifiedAcceptance:
    """Limits of a certificate for acceptance; readings of other `sources` are not accepted."""

    confidence: float
    sources: tuple[str, ...]


@dataclass(frozen=True)
class Finding:
    """A flag on one part, none for a note, in words: "too shallow for R: 7 at place 2 0.06 mm"."""

    flag: ReadingFlag
    text: str
    places: tuple[int, ...] = ()

    @classmethod
    def of(cls, flag: ReadingFlag) -> Finding:
        """The finding of a single flag in general words."""
        return cls(flag, flag.text)

    @property
    def code(self) -> str:
        """Name of the flag for programs, such as low_confidence; empty for a note."""
        return (self.flag.name or "").lower() if self.flag else ""

    def __str__(self) -> str:
        return self.text


def bench_faults(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the faults of whiskers and bench, in words."""
    return tuple(finding.text for finding in findings if finding.flag & ReadingFlag.of(Kind.BENCH))


def flags_of(findings: Iterable[Finding]) -> ReadingFlag:
    """Combine the flags of all findings."""
    return reduce(or_, (finding.flag for finding in findings), ReadingFlag.NONE)
