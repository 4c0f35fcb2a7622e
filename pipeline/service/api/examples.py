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
    CharacterRecord((CandidateRecord(char, 0.97), CandidateRecord(rival, 0.02)), box, state="read", grade="A")
    for char, rival, box in (("K", "R", (4.0, 3.0, 7.2, 8.0)), ("X", "Y", (8.2, 3.0, 11.4, 8.0)))
)
_READING = ReadingRecord(
    "vision", "KX", "accept", 0.96, _CHARACTERS, font="gothic", height_mm=5.0, seconds=0.41, at=_AT
)
_UNSURE = replace(_READING, decision="review", confidence=0.41, messages=("low confidence",))
_PLAN = ScanPlanRecord(
    (1.5, 1.0, 22.5, 10.0), (0, 180, 90, 270), passes=44, line_pitch_mm=0.125, sample_pitch_mm=0.0625,
    speed_mm_s=50.0, preload_mm=1.0, seconds=36.0, height_mm=5.0,
    reason="the camera is unsure of KX (confidence 0.41): low confidence",
)  # fmt: skip
_PART = PartRecord(
    "01JD8Z6Y3Q5V7W9X1B2C3D4E5F", "tray-7/part-3", PartState.ACCEPTED, "KX", _AT, _AT, _READING
)
_WAIT = TouchWait(by_stage=False, until=_AT + timedelta(minutes=15))
_TOUCH = replace(_PART, state=PartState.TOUCH_NEEDED, text="", reading=_UNSURE, plan=_PLAN, touch=_WAIT)
_REVIEW = ReviewRecord(ReviewAction.CORRECT, "KX", "KY", "Anna", "line-3", at=_AT)
_PHOTO = EvidenceRecord(EvidenceKind.PHOTO, "0" * 64, 402_113, "part-3.png", "image/png", at=_AT)
_HISTORY = History((EventRecord(_AT, "received"),), (_UNSURE,), (_REVIEW,), (_PHOTO,))
PART_EXAMPLE, TOUCH_EXAMPLE, HISTORY_EXAMPLE = map(to_json, (answer(_PART), answer(_TOUCH), _HISTORY))


def example_answer(status: int, **examples: dict[str, Any]) -> dict[int | str, dict[str, Any]]:
    """The answer of a route with its examples by name, for the description."""
    values = {name: {"value": value} for name, value in examples.items()}
    return {status: {"content": {"application/json": {"examples": values}}}}
