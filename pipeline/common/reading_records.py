"""Records of a reading by camera, touch or both, and of the scan to make if the camera is unsure.

Boxes (x0, y0, x1, y1) are in mm, in the plate's frame for touch and in the photograph's for the camera (`box_mm`), and
in pixels (`box_px`) for a photograph whose scale is unknown. The other field is None.
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
    """One candidate for one place: its posterior, and the fit of its template, 1 at best; 0 without a template."""

    char: str
    probability: float
    score: float = 0.0


@dataclass(frozen=True)
class CharacterRecord:
    """One place of a reading.

    Attributes:
        state: read, confused, not read or mismatch; empty if it was not judged.
        grade: A to F, or "?" if too little was scanned; empty if it was not graded.
        state_chars: if confused, the two characters; if mismatched, the one that is there and the one expected.
        depth_min_mm: least depth of the mark, or height of a raised one; None if unknown.
        burr_mm: height of the rim beside its strokes above the land; None if unknown.
        no_depth: why touch measured no depth: "font" (name it), "not felt" or "saturated"; else empty.
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
    no_depth: str = ""

    @property
    def char(self) -> str:
        return self.candidates[0].char if self.candidates else ""

    @property
    def box(self) -> Box:
        return self.box_mm or self.box_px or (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ReasonRecord:
    """A reason or remark for programs, and its places from 1; `ReadingRecord.messages` has the same for people."""

    code: str
    places: tuple[int, ...] = ()


@dataclass(frozen=True)
class RivalRecord:
    """Another serial that the format allows, with the probability that it is the right one."""

    text: str
    probability: float


@dataclass(frozen=True)
class LineRecord:
    """A line of the part other than its serial; its name is empty if the settings do not name it."""

    name: str
    text: str
    confidence: float
    box_mm: Box | None = None
    box_px: Box | None = None


@dataclass(frozen=True)
class FieldRecord:
    """A named field of a marking; the name is a text element or application identifier: SER, 21."""

    name: str
    value: str


@dataclass(frozen=True)
class CodeRecord:
    """A Data Matrix or QR code in a part's photograph.

    Attributes:
        kind: Data Matrix, QR Code or Micro QR Code.
        text: GS1 codes with identifiers in brackets, control characters as their pictures (␝).
        same: whether it holds the serial that was read; None if it has no serial, or none was read.
    """

    kind: str
    text: str
    same: bool | None = None
    box_mm: Box | None = None
    box_px: Box | None = None


@dataclass(frozen=True)
class PassRecord:
    """One pass of the whiskers, and the most probable text after it.

    Attributes:
        direction_deg: of travel, 0, 90, 180, 270.
        line_mm: position of each whisker's line: y for passes along x, x for passes along y.
        along_mm: (least, greatest) coordinate along the lines.
        preload_mm: depth below the land at which the free tip ran.
        stage_s: stage seconds from the start of the first pass to the end of this one.
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
    """One reading of a part, as the store keeps it and as the service and tables show it.

    Attributes:
        source: vision, tactile or fused; empty with an error.
        decision: accept, review or reject; empty with an error.
        confidence: probability that the whole text is right, 0 to 1.
        height_mm: character height; None if it or the photograph's scale is unknown (`height_px` then).
        rotation_deg: of the line, from +x towards +y.
        verdict: confirmed, refuted or undecided; empty if no text was expected.
        database: glyph database it was read with; empty for the built-in fonts.
        seconds: from the opening of the files to the decision: with the download of URLs, without the making
            of the reader and the time on a stage.
        error: why there is no reading; empty if there is one.
        rivals: other possible serials, the most probable first.
        lines: the part's other lines: those that the settings name first, then the rest.
        fields: named fields of the marking, such as SER KB74 or (21)KB74, on any of its lines.
        settings: hash of the settings that it was read with.
        passes: of active touch, in the frame of the boxes; `stage_s` are their stage seconds.
        stopped: why touch stopped: sure, no gain, budget, all felt, nothing found or stage failed.
        reasons: `messages` for programs: why it is not accepted, and what else was found, with places.
        accept_risk: greatest share of wrong readings among those accepted of this sense; None without a reading.
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
    accept_risk: float | None = None

    @classmethod
    def failed(cls, part: str, error: str, *, seconds: float = 0.0) -> ReadingRecord:
        return cls("", "", "", 0.0, part=part, error=error, seconds=seconds)


@dataclass(frozen=True)
class ScanPlanRecord:
    """The scan that the whisker stage must make.

    Attributes:
        region_mm: x0, y0, x1, y1 in the plate frame (of the photograph, where its scale is known).
        directions_deg: of travel, 0, 180, 90, 270.
        preload_mm: depth below the land at which the free tip runs.
        middle_mm: x, y of the photograph's middle in the region's frame, by which a stage finds the region; None if
            the scale is unknown: the region is then the stage's whole field.
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
    # cached: making one takes milliseconds
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def to_json(record: Any) -> dict[str, Any]:
    """The record as JSON values: enums and times as text, tuples as lists."""
    values: dict[str, Any] = _adapter(type(record)).dump_python(record, mode="json")
    return values


def to_json_bytes(record: Any) -> bytes:
    """The record as JSON in UTF-8."""
    return _adapter(type(record)).dump_json(record)


def from_json(kind: type[T], data: Any) -> T:
    """Make a record from the result of `to_json`, or from its JSON text. Raises ValueError: it is no such record."""
    adapter = _adapter(kind)
    record: T = adapter.validate_json(data) if isinstance(data, str) else adapter.validate_python(data)
    return record
