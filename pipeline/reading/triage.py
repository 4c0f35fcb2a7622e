"""State of a part after a reading: accepted, touch needed, or review by a person.

camera sure -----------------------------> accepted
camera unsure --> touch needed --> sure --> accepted
                               \\-> unsure, nothing read, or another text than expected --> review

In shadow mode a part is finished as soon as it is read: nothing is decided.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pipeline.common.reading_records import ReadingRecord, ScanPlanRecord
from pipeline.common.records import Agreement, PartState
from pipeline.common.texts import same_text

if TYPE_CHECKING:
    from pipeline.reading.part_pictures import Picture
    from recognition.decide.score import Measure
else:  # slow to import; a journal reads them in the form in which they are written
    Measure, Picture = str, dict


@dataclass(frozen=True)
class ReadPart:
    """A part that a worker has read; what was not requested is empty."""

    # in the order they were made, the last one counts; or one with the error
    readings: tuple[ReadingRecord, ...]
    pictures: tuple[Picture, ...] = ()
    plan: ScanPlanRecord | None = None  # for touch; None if touch is not needed
    measures: Mapping[Measure, float] = field(default_factory=dict)
    sha256: str = ""  # of its files and of its entry in the list of parts
    unverified: bool = False  # the text expected of it could not be looked for: a person decides

    @property
    def record(self) -> ReadingRecord:
        return self.readings[-1]

    @property
    def state(self) -> PartState:
        return PartState.REVIEW if self.unverified else state_after(self.record)


def state_after(reading: ReadingRecord) -> PartState:
    """State of a part after a reading, whose own decision applies the thresholds. If a text is expected, only a part
    with that text is accepted. Files that could not be read are for a person."""
    if reading.decision == "accept" and reading.verdict in ("", "confirmed"):
        return PartState.ACCEPTED
    by_camera = reading.source == "vision" and not reading.error
    return PartState.TOUCH_NEEDED if by_camera else PartState.REVIEW


def agreement_of(reading: ReadingRecord, expected: str) -> Agreement:
    """Agreement in shadow mode of an independent reading with that of the line's own reader, empty if it has none."""
    if not expected.strip():
        return Agreement.ALONE
    if not reading.text:
        return Agreement.NOTHING
    return Agreement.SAME if same_text(reading.text, expected) else Agreement.OTHER


def why_touch(reading: ReadingRecord) -> str:
    """Reason why the camera's reading is not accepted, for the operator."""
    if not reading.text:
        return "the camera has found no characters"
    if reading.verdict == "refuted":
        return f"the camera reads {reading.text}, which is not the expected serial"
    if reading.verdict == "undecided":
        return f"the camera reads {reading.text}; the expected serial is not confirmed beyond doubt"
    reasons = "; ".join(reading.messages) or "its thresholds are not met"
    return f"the camera is unsure of {reading.text} (confidence {reading.confidence:.2f}): {reasons}"
