"""Records of a reading by camera, touch or both, and of the scan to make if the camera is unsure.

Boxes are in mm of the frame of what was read: the plate's for touch, the photograph's for the camera; of a photograph
whose scale is unknown they are in its pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeVar

from pydantic import TypeAdapter

Box = tuple[float, float, float, float]
T = TypeVar("T")
_ADAPTERS: dict[type[Any], TypeAdapter[Any]] = {}


@dataclass(frozen=True)
class CandidateRecord:
    """One candidate for one place.

    Attributes:
        char: the character.
        probability: share of belief, 0 to 1.
        score: fit of its template, 1 is perfect; 0 without a template.
    """

    char: str
    probability: float
    score: float = 0.0


@dataclass(frozen=True)
class CharacterRecord:
    """One place of a reading.

    Attributes:
        candidates: best first.
        box_mm: x0, y0, x1, y1; None in a photograph whose scale is unknown.
        state: read, confused, not read or mismatch; empty where it was not judged.
        grade: grade of the mark, A to F, "?" where too little was scanned; empty where it was not graded.
        box_px: as box_mm, in the photograph's own pixels where that is None.
        state_chars: with "confused" the two characters; with "mismatch" the one that stands there and the one expected.
        action: action for the mark; empty if none is needed, or it was not graded.
        depth_min_mm: depth of the mark where it is least, height of a raised one; None if unknown.
        depth_mean_mm: likewise, on average.
        depth_sd_mm: standard deviation of that average.
        burr_mm: height of the rim beside its strokes above the land; None if unknown.
    """

    candidates: tuple[CandidateRecord, ...]
    box_mm: Box | None
    state: str = ""
    grade: str = ""
    box_px: Box | None = None
    state_chars: tuple[str, ...] = ()
    action: str = ""
    depth_min_mm: float | None = None
    depth_mean_mm: float | None = None
    depth_sd_mm: float | None = None
    burr_mm: float | None = None

    @property
    def char(self) -> str:
        """The best candidate; empty without one."""
        return self.candidates[0].char if self.candidates else ""

    @property
    def box(self) -> Box:
        """In the unit of the picture: mm where its scale is known, else pixels."""
        return self.box_mm or self.box_px or (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ReasonRecord:
    """One thing to know about a reading, for programs; `ReadingRecord.messages` say it to people.

    Attributes:
        code: which, such as low_confidence, too_shallow, senses_disagree, not_in_order.
        places: places that it is about, from 1.
    """

    code: str
    places: tuple[int, ...] = ()


@dataclass(frozen=True)
class RivalRecord:
    """Another serial that the format allows.

    Attributes:
        text: the serial.
        probability: probability that it is the right one.
    """

    text: str
    probability: float


@dataclass(frozen=True)
class LineRecord:
    """Another line of the part than its serial.

    Attributes:
        name: its name in the settings; empty for a line that the settings do not name.
        text: text of the line.
        confidence: probability that all of it is right, 0 to 1.
        box_mm: x0, y0, x1, y1; None in a photograph whose scale is unknown, and where its place is not.
        box_px: as box_mm, in the pixels of a photograph whose scale is unknown; else None.
    """

    name: str
    text: str
    confidence: float
    box_mm: Box | None = None
    box_px: Box | None = None


@dataclass(frozen=True)
class FieldRecord:
    """A named field of a marking.

    Attributes:
        name: text element or application identifier: SER, 21.
        value: value of the field.
    """

    name: str
    value: str


@dataclass(frozen=True)
class CodeRecord:
    """A Data Matrix or QR code in a part's photograph.

    Attributes:
        kind: Data Matrix, QR Code or Micro QR Code.
        text: its text; GS1 codes with identifiers in brackets, control characters as their pictures (␝).
        same: whether it holds the serial that was read; None if it has no serial, or none was read.
        box_mm: x0, y0, x1, y1; None in a photograph whose scale is unknown, and where its place is not.
        box_px: as box_mm, in the pixels of a photograph whose scale is unknown; else None.
    """

    kind: str
    text: str
    same: bool | None = None
    box_mm: Box | None = None
    box_px: Box | None = None


@dataclass(frozen=True)
class PassRecord:
    """One pass of the whiskers, and the posterior after it.

    Attributes:
        direction_deg: direction of travel, 0, 90, 180, 270.
        line_mm: position of each whisker's line: y of passes along x, x of passes along y.
        along_mm: (least, greatest) place along the lines.
        speed_mm_s: speed of the stage.
        preload_mm: depth below the land at which the free tip ran.
        stage_s: stage seconds spent up to its end, from the first pass on.
        why: the reason for choosing it, in words; empty if none is known.
        text: most probable text after it.
        confidence: probability that the whole text is right, 0 to 1.
    """

    direction_deg: int
    line_mm: tuple[float, ...]
    along_mm: tuple[float, float]
    speed_mm_s: float
    preload_mm: float
    stage_s: float
    why: str = ""
    text: str = ""
    confidence: float = 0.0


@dataclass(frozen=True)
class ReadingRecord:
    """One reading of a part, as it is kept and sent: in the store, by the service, and in tables.

    Fields that a reader does not fill have their defaults.

    Attributes:
        source: vision, tactile or fused; empty with an error.
        text: the serial; empty where nothing was found.
        decision: accept, review or reject; empty with an error.
        confidence: probability that the whole text is right, 0 to 1.
        characters: place by place.
        messages: messages about it, in words.
        font: font whose shapes answered best.
        height_mm: character height; None where it is unknown, or the photograph's scale is.
        rotation_deg: rotation of the line, from +x towards +y.
        verdict: confirmed, refuted or undecided; empty where no text was expected.
        database: glyph database it was read with; empty for the built-in fonts.
        seconds: it took to read, loading included.
        at: time of the reading; the store puts its own time.
        part: name of the part.
        error: why there is no reading; empty where there is one.
        height_px: character height in pixels of a photograph whose scale is unknown; else None.
        raised: raised marks.
        expected: text that the part should read; empty if none is known.
        verify_probability: probability that the part has the expected text; None where no text was expected.
        rivals: other serials with some belief, most first.
        lines: the part's other lines: those that the settings name first, then the rest.
        codes: Data Matrix and QR codes in its photographs.
        fields: named fields of the marking, such as SER KB74 or (21)KB74, on any of its lines.
        program: version of the program that read it.
        settings: hash of the settings that it was read with.
        photos: photographs that it is of; 0 of touch alone.
        passes: passes of a part that was felt pass by pass, in their order; boxes and lines share a frame.
        stage_s: stage seconds that they took; None where the part was not felt so.
        stopped: why no more were felt: sure, no gain, budget, all felt, nothing found, stage failed.
        faults: faults of whiskers and bench in the recording, in words.
        reasons: `messages` for programs: why it is not accepted, and what else was found, with places.
    """

    source: str
    text: str
    decision: str
    confidence: float
    characters: tuple[CharacterRecord, ...] = ()
    messages: tuple[str, ...] = ()
    font: str = ""
    height_mm: float | None = None
    rotation_deg: float = 0.0
    verdict: str = ""
    database: str = ""
    seconds: float = 0.0
    at: datetime | None = None
    part: str = ""
    error: str = ""
    height_px: float | None = None
    raised: bool = False
    expected: str = ""
    verify_probability: float | None = None
    rivals: tuple[RivalRecord, ...] = ()
    lines: tuple[LineRecord, ...] = ()
    codes: tuple[CodeRecord, ...] = ()
    fields: tuple[FieldRecord, ...] = ()
    program: str = ""
    settings: str = ""
    photos: int = 0
    passes: tuple[PassRecord, ...] = ()
    stage_s: float | None = None
    stopped: str = ""
    faults: tuple[str, ...] = ()
    reasons: tuple[ReasonRecord, ...] = ()

    @classmethod
    def failed(cls, part: str, error: str, *, seconds: float = 0.0) -> ReadingRecord:
        """The record of a part that could not be read."""
        return cls("", "", "", 0.0, part=part, error=error, seconds=seconds)


@dataclass(frozen=True)
class ScanPlanRecord:
    """The scan that the whisker stage must make.

    Attributes:
        region_mm: x0, y0, x1, y1 in the plate frame (of the photograph, where its scale is known).
        directions_deg: directions of travel, 0, 180, 90, 270.
        passes: passes of the array.
        line_pitch_mm: between neighbouring traces.
        sample_pitch_mm: between samples of a trace.
        speed_mm_s: speed of the stage.
        preload_mm: depth below the land at which the free tip runs.
        seconds: the scan takes.
        height_mm: character height that it is made for.
        reason: why touch is needed, in words.
        middle_mm: x, y in the region's frame of what lies under the middle of the photograph, by which a stage
            finds the region; None where the scale is not known: the region is then the stage's whole field.
    """

    region_mm: tuple[float, float, float, float]
    directions_deg: tuple[int, ...]
    passes: int
    line_pitch_mm: float
    sample_pitch_mm: float
    speed_mm_s: float
    preload_mm: float
    seconds: float
    height_mm: float
    reason: str
    middle_mm: tuple[float, float] | None = None


def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    # kept, for to make one takes milliseconds
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def to_json(record: Any) -> dict[str, Any]:
    """The record as JSON values: enums and times as text, tuples as lists."""
    made: dict[str, Any] = _adapter(type(record)).dump_python(record, mode="json")
    return made


def to_json_bytes(record: Any) -> bytes:
    """The record as JSON in UTF-8."""
    return _adapter(type(record)).dump_json(record)


def from_json(kind: type[T], data: Any) -> T:
    """Make a record from the result of `to_json`, or from its JSON text.

    Raises:
        ValueError: data that are no such record.
    """
    adapter = _adapter(kind)
    made: T = adapter.validate_json(data) if isinstance(data, str) else adapter.validate_python(data)
    return made
