"""What the service remembers of a part: values that the store keeps, the workers make and the pages show.

    part --- readings (camera, touch, both; never changed)
         --- evidence (photograph, scan, pictures; files named by what they hold)
         --- reviews  (what a person said; never changed)
         --- events   (everything that happened, in order; never changed)

All times are aware and in UTC. Boxes are in mm of the frame of what was read: the plate's for touch, the
photograph's for the camera; of a photograph whose scale is not known they are in its pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date, datetime
from enum import StrEnum
from typing import Any

Box = tuple[float, float, float, float]


class PartState(StrEnum):
    """How far a part has come."""

    TOUCH_NEEDED = "touch_needed"
    ACCEPTED = "accepted"
    REVIEW = "review"
    REVIEWED = "reviewed"
    SHADOW = "shadow"
    """Read beside the line's own reader; nothing was decided."""


class Agreement(StrEnum):
    """What a part that was read in the shadow of the line's own reader says of it."""

    SAME = "same"
    OTHER = "other"
    NOTHING = "nothing"
    """Nothing was read."""
    ALONE = "alone"
    """The line's own reader has said nothing."""


class EvidenceKind(StrEnum):
    """What a file kept for a part is."""

    PHOTO = "photo"
    SCAN = "scan"
    HEIGHT_MAP = "height_map"
    VISION = "sight"
    """What the camera's reader believed: of earlier versions, as is `VISION_EDGES_PICTURE`; not written any more."""
    PHOTO_PICTURE = "photo_picture"
    EDGES_PICTURE = "edges_picture"
    VISION_EDGES_PICTURE = "sight_edges_picture"


class ReviewAction(StrEnum):
    """What a person did with a reading."""

    CONFIRM = "confirm"
    CORRECT = "correct"
    UNREADABLE = "unreadable"


class Scope(StrEnum):
    """What a token allows."""

    READ = "read"
    WRITE = "write"
    REVIEW = "review"


@dataclass(frozen=True)
class CandidateRecord:
    """One answer for one place.

    Attributes:
        char: the character.
        probability: share of belief, 0 to 1.
        score: how well its template fits, 1 is perfectly; 0 where no template was asked.
    """

    char: str
    probability: float
    score: float = 0.0


@dataclass(frozen=True)
class CharacterRecord:
    """One place of a reading.

    Attributes:
        candidates: best first.
        box_mm: x0, y0, x1, y1; None in a photograph whose scale is not known.
        state: read, confused, not read or mismatch; empty where nobody asked.
        grade: of the mark, A to F, "?" where too little was scanned; empty where it was not graded.
        box_px: as box_mm, in the photograph's own pixels where that is None.
        state_chars: of "confused" the two characters; of "mismatch" the one that stands there and the one expected.
        action: what to do about the mark; empty where nothing is to be done, or it was not graded.
        depth_min_mm: depth of the mark where it is least, height of a raised one; None where it is not known.
        depth_mean_mm: likewise, on average.
        burr_mm: height of the rim beside its strokes above the land; None where it is not known.
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
class RivalRecord:
    """Another serial that the format allows.

    Attributes:
        text: the serial.
        probability: that it is the right one.
    """

    text: str
    probability: float


@dataclass(frozen=True)
class LineRecord:
    """Another line of the part than its serial.

    Attributes:
        name: as it was asked for; empty of one that nobody has asked for.
        text: what it reads.
        confidence: probability that all of it is right, 0 to 1.
        box_mm: x0, y0, x1, y1; None in a photograph whose scale is not known, and where its place is not.
        box_px: as box_mm, in the pixels of a photograph whose scale is not known; else None.
    """

    name: str
    text: str
    confidence: float
    box_mm: Box | None = None
    box_px: Box | None = None


@dataclass(frozen=True)
class FieldRecord:
    """A field of a marking that says what it is.

    Attributes:
        name: text element or application identifier: SER, 21.
        value: what it holds.
    """

    name: str
    value: str


@dataclass(frozen=True)
class CodeRecord:
    """A Data Matrix or QR code in a part's photograph.

    Attributes:
        kind: Data Matrix, QR Code or Micro QR Code.
        text: what it says; of GS1 codes with identifiers in brackets, control characters as their pictures (␝).
        same: whether it holds the serial that was read; None where it speaks of no serial, or none was read.
        box_mm: x0, y0, x1, y1; None in a photograph whose scale is not known, and where its place is not.
        box_px: as box_mm, in the pixels of a photograph whose scale is not known; else None.
    """

    kind: str
    text: str
    same: bool | None = None
    box_mm: Box | None = None
    box_px: Box | None = None


@dataclass(frozen=True)
class PassRecord:
    """One pass of the whiskers, and what was believed after it.

    Attributes:
        direction_deg: of travel, 0, 90, 180, 270.
        line_mm: where each whisker's line lies: y of passes along x, x of passes along y.
        along_mm: (least, greatest) place along the lines.
        speed_mm_s: of the stage.
        preload_mm: how far below the land the free tip ran.
        stage_s: stage seconds spent up to its end, from the first pass on.
        why: what it was chosen for, in words; empty where nobody said.
        text: what was believed to stand there after it.
        confidence: that all of it is right, 0 to 1.
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

    What a reader does not know of older records has its default.

    Attributes:
        source: vision, tactile or fused; empty with an error.
        text: the serial; empty where nothing was found.
        decision: accept, review or reject; empty with an error.
        confidence: probability that the whole text is right, 0 to 1.
        characters: place by place.
        messages: what to know about it, in words.
        font: font whose shapes answered best.
        height_mm: character height; None where it is unknown, or the photograph's scale is.
        rotation_deg: of the line, from +x towards +y.
        verdict: confirmed, refuted or undecided; empty where no text was expected.
        database: glyph database it was read with; empty for the built-in fonts.
        seconds: it took to read, loading included.
        at: when it was read; the store puts its own time.
        part: name of the part.
        error: why there is no reading; empty where there is one.
        height_px: character height in pixels of a photograph whose scale is not known; else None.
        raised: raised marks.
        expected: text that the part should read; empty where none is known.
        verify_probability: that the part bears the text expected; None where none was.
        rivals: other serials with some belief, most first.
        lines: the part's other lines: those asked for, then those that nobody has asked for.
        codes: Data Matrix and QR codes in its photographs.
        fields: what the marking says by name, SER KB74 or (21)KB74, on any of its lines.
        program: version of the program that read it.
        settings: hash of the settings that it was read with.
        photos: photographs that it is of; 0 of touch alone.
        passes: of a part that was felt pass by pass, in their order; boxes and lines share a frame.
        stage_s: stage seconds that they took; None where the part was not felt so.
        stopped: why no more were felt: sure, no gain, budget, all felt, nothing found, stage failed.
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

    @classmethod
    def failed(cls, part: str, error: str, *, seconds: float = 0.0) -> ReadingRecord:
        """The record of a part that could not be read."""
        return cls("", "", "", 0.0, part=part, error=error, seconds=seconds)


@dataclass(frozen=True)
class ScanPlanRecord:
    """What the whisker stage is asked to feel.

    Attributes:
        region_mm: x0, y0, x1, y1 in the plate frame (of the photograph, where its scale is known).
        directions_deg: of travel, 0, 180, 90, 270.
        passes: of the array.
        line_pitch_mm: between neighbouring traces.
        sample_pitch_mm: between samples of a trace.
        speed_mm_s: of the stage.
        preload_mm: how far below the land the free tip runs.
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


@dataclass(frozen=True)
class EvidenceRecord:
    """One file kept for a part.

    Attributes:
        kind: what it is.
        sha256: of what it holds, hexadecimal; it is kept under that name.
        n_bytes: its length.
        name: what the sender called it; never used as a path.
        media_type: for the browser.
        meta: of pictures x0_mm, y0_mm (middle of pixel 0, 0), mm_per_pixel, width, height.
        at: when; set by the store.
        gone: whether its time was up and the file is no longer kept.
    """

    kind: EvidenceKind
    sha256: str
    n_bytes: int
    name: str = ""
    media_type: str = "application/octet-stream"
    meta: Mapping[str, float] = field(default_factory=dict)
    at: datetime | None = None
    gone: bool = False


@dataclass(frozen=True)
class ReviewRecord:
    """What a person said of a part.

    Attributes:
        action: confirm, correct or unreadable.
        before: the text as it stood.
        after: the text as it is.
        who: name of the person, as given.
        token: name of the token that was used; empty where none is asked for.
        note: anything the person wants to say.
        at: when; set by the store.
    """

    action: ReviewAction
    before: str
    after: str
    who: str
    token: str = ""
    note: str = ""
    at: datetime | None = None


@dataclass(frozen=True)
class EventRecord:
    """One thing that happened to a part.

    Attributes:
        at: when.
        kind: received, read, touch_needed, compared, reviewed, enrolled, evidence_expired.
        data: more, by kind.
    """

    at: datetime
    kind: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ShadowRecord:
    """What came of a part that was read in the shadow of the line's own reader.

    Attributes:
        agreement: of the last reading with the text expected, which is what the line's own reader has said.
        would_be: where the part would stand if the service decided.
    """

    agreement: Agreement
    would_be: PartState


@dataclass(frozen=True)
class AgreementDay:
    """Parts of one day that were read in the shadow of the line's own reader.

    Attributes:
        day: by UTC.
        accepted: of each agreement, parts that would have been accepted.
        all_parts: of each agreement, all.
    """

    day: date
    accepted: Mapping[Agreement, int]
    all_parts: Mapping[Agreement, int]


@dataclass(frozen=True)
class PartRecord:
    """A part as it stands.

    Attributes:
        id: made by the store; sorts by time.
        name: what the line calls it; not unique.
        state: how far it has come.
        text: the serial as it stands: as reviewed, else as last read.
        created_at: when it was accepted.
        changed_at: when anything was last added.
        reading: the last one; None before any.
        expected: text it should read; empty where none is.
        database: glyph database asked for; empty for the built-in fonts.
        job: that it was read by; empty for the service's own settings.
        plan: what to feel, while touch is needed.
        review: the last one; None before any.
        shadow: what came of it in shadow mode; None of a part that the service has decided.
    """

    id: str
    name: str
    state: PartState
    text: str
    created_at: datetime
    changed_at: datetime
    reading: ReadingRecord | None = None
    expected: str = ""
    database: str = ""
    job: str = ""
    plan: ScanPlanRecord | None = None
    review: ReviewRecord | None = None
    shadow: ShadowRecord | None = None


@dataclass(frozen=True)
class TokenRecord:
    """A token, without its secret.

    Attributes:
        name: unique.
        scopes: what it allows.
        created_at: when.
        expires_at: from when on it is refused; None: never.
        revoked_at: when it was taken back; None: it was not.
    """

    name: str
    scopes: frozenset[Scope]
    created_at: datetime
    expires_at: datetime | None = None
    revoked_at: datetime | None = None


@dataclass(frozen=True)
class Delivery:
    """A result waiting to be published.

    Attributes:
        id: rises with time.
        target: webhook or mqtt.
        part_id: whose.
        payload: what is sent.
        attempts: so far in vain.
    """

    id: int
    target: str
    part_id: str
    payload: Mapping[str, Any]
    attempts: int = 0


@dataclass(frozen=True)
class History:
    """All that happened to a part, oldest first; nothing of it is ever changed."""

    events: tuple[EventRecord, ...]
    readings: tuple[ReadingRecord, ...]
    reviews: tuple[ReviewRecord, ...]
    evidence: tuple[EvidenceRecord, ...]


@dataclass(frozen=True)
class Statistics:
    """The dashboard's numbers of a stretch of time.

    Attributes:
        since: its beginning.
        parts: accepted by the service.
        by_camera: of them, accepted on the camera's word alone.
        fell_back: of them, sent to touch.
        by_state: parts by how far they have come.
        rejects: parts whose last reading was a reject.
        reviewed: parts that a person looked at.
        right_before_review: of them, those whose reading was confirmed as it was.
        characters_reviewed, characters_right: of the reviewed parts' texts.
        seconds: (p50, p99) of reading by source; sources without any are left out.
        per_hour: (start of the hour, parts) in order, hours without any included.
        awaiting: parts in the review queue now, whatever their time.
    """

    since: datetime
    parts: int
    by_camera: int
    fell_back: int
    by_state: Mapping[PartState, int]
    rejects: int
    reviewed: int
    right_before_review: int
    characters_reviewed: int
    characters_right: int
    seconds: Mapping[str, tuple[float, float]]
    per_hour: tuple[tuple[datetime, int], ...]
    awaiting: int
