"""From what the senses say to the record that the service keeps of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pipeline.common.records import CandidateRecord, CharacterRecord, ReadingRecord

if TYPE_CHECKING:
    from pipeline.reading.part_reader import Sensed
    from recognition.reading import CharacterReading


def reading_record(sensed: Sensed, *, seconds: float, database: str = "") -> ReadingRecord:
    """The record of a reading, with the verdict on the text expected if there was one.

    Args:
        sensed: as read.
        seconds: it took.
        database: glyph database it was read with.
    """
    reading, verification = sensed.reading, sensed.verification
    more = verification.messages() if verification is not None else ()
    return ReadingRecord(
        source=reading.source,
        text=reading.text,
        decision=reading.decision.value,
        confidence=_share(reading.confidence),
        characters=tuple(_character(c) for c in reading.characters),
        messages=tuple(dict.fromkeys((*reading.messages(), *more))),
        font=reading.font,
        height_mm=_finite(reading.height_mm),
        rotation_deg=_finite(reading.rotation_deg),
        verdict="" if verification is None else verification.verdict.value,
        database=database,
        seconds=round(seconds, 4),
    )


def _character(character: CharacterReading) -> CharacterRecord:
    box = character.box
    return CharacterRecord(
        candidates=tuple(
            CandidateRecord(c.char, _share(c.probability), _finite(c.score)) for c in character.candidates
        ),
        box_mm=(_finite(box.x0_mm), _finite(box.y0_mm), _finite(box.x1_mm), _finite(box.y1_mm)),
        state="" if character.state is None else character.state.state.value,
        grade="" if character.grade is None else character.grade.letter,
    )


def _share(value: float) -> float:
    return min(1.0, max(0.0, _finite(value)))


def _finite(value: float) -> float:
    """As JSON has numbers: no infinities, and no more digits than mean anything."""
    number = float(value)
    return round(number, 6) if math.isfinite(number) else 0.0
