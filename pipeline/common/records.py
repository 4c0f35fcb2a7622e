"""Records of a part in the service: the store keeps them, the workers make them, the pages show them.

    part --- readings (camera, touch, both; never changed)
         --- evidence (photograph, scan, pictures; files named by their hash)
         --- reviews  (a person's answers; never changed)
         --- events   (everything that happened, in order; never changed)

All times are aware and in UTC. Readings are in `reading_records`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date, datetime
from enum import StrEnum
from typing import Any

from pipeline.common.reading_records import ReadingRecord, ScanPlanRecord


class PartState(StrEnum):
    """State of a part."""

    TOUCH_NEEDED = "touch_needed"
    ACCEPTED = "accepted"
    REVIEW = "review"
    REVIEWED = "reviewed"
    SHADOW = "shadow"  # read beside the line's own reader; nothing was decided


class Agreement(StrEnum):
    """Comparison of a part's reading with that of the line's own reader, in shadow mode."""

    SAME = "same"
    OTHER = "other"
    NOTHING = "nothing"  # nothing was read
    ALONE = "alone"  # the line's own reader has sent no answer


class EvidenceKind(StrEnum):
    """Kind of a file kept for a part."""

    PHOTO = "photo"
    SCAN = "scan"
    HEIGHT_MAP = "height_map"
    PHOTO_PICTURE = "photo_picture"
    EDGES_PICTURE = "edges_picture"


class ReviewAction(StrEnum):
    """A person's verdict on a reading."""

    CONFIRM = "confirm"
    CORRECT = "correct"
    UNREADABLE = "unreadable"


class Scope(StrEnum):
    """A right that a token gives."""

    READ = "read"
    WRITE = "write"
    REVIEW = "review"


@dataclass(frozen=True)
class EvidenceRecord:
    """One file kept for a part, under its hash (`sha256`, hexadecimal).

    Attributes:
        name: the sender's name for it; never used as a path.
        meta: for pictures x0_mm, y0_mm (middle of pixel 0, 0), mm_per_pixel, width, height.
        gone: the file has expired and was deleted.
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
    """A review of a part by a person; `token` is empty if none is required, `at` is set by the store."""

    action: ReviewAction
    before: str
    after: str
    who: str
    token: str = ""
    note: str = ""
    at: datetime | None = None


@dataclass(frozen=True)
class EventRecord:
    """An event in the history of a part, with data that depends on its kind: received, read, touch_needed,
    touch_failed, not_felt, compared, reviewed, review_undone, enrolled, serial_alarm, serial_again,
    evidence_expired."""

    at: datetime
    kind: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TouchWait:
    """A part's wait for touch: by the stage of its line in the call that has brought it (`by_stage`), or for a release
    or a scan of the sender's. It goes to review at `until`; None: no limit."""

    by_stage: bool
    until: datetime | None


@dataclass(frozen=True)
class ShadowRecord:
    """Shadow mode: agreement with what the line's own reader says, and the state if the service decided."""

    agreement: Agreement
    would_be: PartState


@dataclass(frozen=True)
class AgreementDay:
    """Parts of one day (UTC) that were read in the shadow of the line's own reader."""

    day: date
    parts: int
    compared: int  # for which the line's own reader has sent a serial
    same: int
    other: int
    nothing: int
    accepted: int  # of those compared, would have been accepted
    accepted_other: int  # of these, were not read the same


@dataclass(frozen=True)
class PartRecord:
    """A part in its present state.

    Attributes:
        id: made by the store; sorts by time.
        name: the line's name for it; not unique.
        text: the current serial: as reviewed, else as last read; empty while touch is needed.
        job: job that it was read by; empty for the service's own settings.
        plan: the scan to make, while touch is needed or after it was missed.
        not_felt: reason why it was not felt though the camera was unsure; empty if it was felt or need not be.
        review: the last review; None before the first.
        shadow: result in shadow mode; None for a part that the service has decided.
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
    line: str = ""
    plan: ScanPlanRecord | None = None
    touch: TouchWait | None = None
    not_felt: str = ""
    review: ReviewRecord | None = None
    shadow: ShadowRecord | None = None


@dataclass(frozen=True)
class TokenRecord:
    """A token, without its secret; `expires_at` None: never; `revoked_at` None: it was not."""

    name: str
    scopes: frozenset[Scope]
    created_at: datetime
    expires_at: datetime | None = None
    revoked_at: datetime | None = None


@dataclass(frozen=True)
class Delivery:
    """A result waiting to be published; its id rises with time."""

    id: int
    target: str
    part_id: str
    payload: Mapping[str, Any]
    attempts: int = 0


@dataclass(frozen=True)
class WaitingResults:
    """Results in the outbox for one target, the oldest since a time."""

    n: int
    since: datetime


@dataclass(frozen=True)
class History:
    """All events of a part, oldest first; they are never changed."""

    events: tuple[EventRecord, ...]
    readings: tuple[ReadingRecord, ...]
    reviews: tuple[ReviewRecord, ...]
    evidence: tuple[EvidenceRecord, ...]


@dataclass(frozen=True)
class PartStory(History):
    """A part and all its events at one moment."""

    part: PartRecord
    opinions: tuple[ReviewRecord, ...]  # each person's latest opinion since the last review, oldest first
    audit: ReviewRecord | None  # its last one, with the accepted text and the person's; None before the first
    awaits_audit: bool  # it was drawn for an audit that is still open


@dataclass(frozen=True)
class TrendStep:
    """Parts received in one hour or day (UTC) from `at`: accepted and not questioned since, reviewed, and rejected."""

    at: datetime
    parts: int = 0
    accepted: int = 0
    review: int = 0
    rejects: int = 0


@dataclass(frozen=True)
class Statistics:
    """The dashboard's numbers for a period.

    Attributes:
        fell_back: sent to touch.
        right_before_review: reading confirmed unchanged.
        seconds: (p50, p99) of the reading time by source; sources without readings are left out.
        trend: the hours or days in order, including those without parts.
        awaiting: parts in the review queue now, whenever they were received.
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
    trend: tuple[TrendStep, ...]
    awaiting: int


@dataclass(frozen=True)
class AlertRecord:
    """A problem, from its start until it is solved."""

    name: str  # reject_rate, review_rate, drift, drift:JOB, bench, watched_folder, golden or golden_overdue
    part_id: str  # the latest part when it was raised
    at: datetime
    message: str
