"""Examples in the description of the interface, made of the very records that are answered."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

from pipeline.common.reading_records import (
    CandidateRecord,
    CharacterRecord,
    ReadingRecord,
    ScanPlanRecord,
    to_json,
)
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ReviewAction,
    ReviewRecord,
    TouchWait,
)

_ID = "01JD8Z6Y3Q5V7W9X1B2C3D4E5F"
_AT = datetime(2026, 11, 2, 9, 30, tzinfo=UTC)
_CHARACTERS = tuple(
    CharacterRecord(
        (CandidateRecord(char, 0.97, 0.9), CandidateRecord(rival, 0.02, 0.6)),
        (4.0 + 4.2 * k, 3.0, 7.2 + 4.2 * k, 8.0),
        state="read",
        grade="A",
    )
    for k, (char, rival) in enumerate(zip("KX40", "RYA8", strict=True))
)
_READING = ReadingRecord(
    "vision", "KX40", "accept", 0.96, _CHARACTERS, font="gothic", height_mm=5.0, seconds=0.41, at=_AT
)
_UNSURE = ReadingRecord(
    "vision",
    "KX4O",
    "review",
    0.41,
    _CHARACTERS,
    ("low confidence",),
    "gothic",
    5.0,
    seconds=0.9,
    at=_AT,
)
_PLAN = ScanPlanRecord(
    region_mm=(1.5, 1.0, 22.5, 10.0),
    directions_deg=(0, 180, 90, 270),
    passes=44,
    line_pitch_mm=0.125,
    sample_pitch_mm=0.0625,
    speed_mm_s=50.0,
    preload_mm=1.0,
    seconds=36.0,
    height_mm=5.0,
    reason="the camera is unsure of KX4O (confidence 0.41): low confidence",
)


def _answered(part: PartRecord) -> dict[str, Any]:
    here = f"/v1/parts/{part.id}"
    links = {"self": here, "history": f"{here}/history", "edges": f"{here}/pictures/edges"}
    return {**to_json(part), "links": links}


_WAITS = TouchWait(by_stage=False, until=_AT + timedelta(minutes=15))

PART_EXAMPLE = _answered(PartRecord(_ID, "tray-7/part-3", PartState.ACCEPTED, "KX40", _AT, _AT, _READING))
TOUCH_EXAMPLE = _answered(
    PartRecord(_ID, "tray-7/part-3", PartState.TOUCH_NEEDED, "", _AT, _AT, _UNSURE, plan=_PLAN, touch=_WAITS)
)
HISTORY_EXAMPLE: dict[str, Any] = {
    "events": [{"at": "2026-11-02T09:30:00Z", "kind": "received", "data": {}}],
    "readings": [to_json(_UNSURE)],
    "reviews": [to_json(ReviewRecord(ReviewAction.CORRECT, "KX4O", "KX40", "Anna", "line-3", at=_AT))],
    "evidence": [
        to_json(EvidenceRecord(EvidenceKind.PHOTO, "0" * 64, 402_113, "part-3.png", "image/png", at=_AT))
    ],
}
