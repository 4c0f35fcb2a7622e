"""Examples in the description of the interface, made of the very records that are answered."""

from __future__ import annotations

from dataclasses import replace
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
    EventRecord,
    EvidenceKind,
    EvidenceRecord,
    History,
    PartRecord,
    PartState,
    ReviewAction,
    ReviewRecord,
    TouchWait,
)
from pipeline.service.api.answers import answer

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
_UNSURE = replace(_READING, text="KX4O", decision="review", confidence=0.41, messages=("low confidence",))
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
_PART = PartRecord(
    "01JD8Z6Y3Q5V7W9X1B2C3D4E5F", "tray-7/part-3", PartState.ACCEPTED, "KX40", _AT, _AT, _READING
)
_WAITS = replace(
    _PART,
    state=PartState.TOUCH_NEEDED,
    text="",
    reading=_UNSURE,
    plan=_PLAN,
    touch=TouchWait(by_stage=False, until=_AT + timedelta(minutes=15)),
)
PART_EXAMPLE, TOUCH_EXAMPLE, HISTORY_EXAMPLE = (
    to_json(one)
    for one in (
        answer(_PART),
        answer(_WAITS),
        History(
            (EventRecord(_AT, "received"),),
            (_UNSURE,),
            (ReviewRecord(ReviewAction.CORRECT, "KX4O", "KX40", "Anna", "line-3", at=_AT),),
            (EvidenceRecord(EvidenceKind.PHOTO, "0" * 64, 402_113, "part-3.png", "image/png", at=_AT),),
        ),
    )
)


def answered(status: int, **examples: dict[str, Any]) -> dict[int | str, dict[str, Any]]:
    """The answer of a route with its examples by name, for the description."""
    values = {name: {"value": value} for name, value in examples.items()}
    return {status: {"content": {"application/json": {"examples": values}}}}
