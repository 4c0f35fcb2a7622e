"""How far a reading takes a part: done, to be scanned, or to be looked at by a person.

camera sure -----------------------------> accepted
camera unsure --> touch needed --> sure --> accepted
                               \\-> unsure, nothing read, or another text than expected --> review

In shadow mode a part is done with as it comes: it is compared with what the line's own reader says, and nothing is
decided.
"""

from __future__ import annotations

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import Agreement, PartState, ShadowRecord
from pipeline.common.texts import same_text


def state_after(reading: ReadingRecord) -> PartState:
    """Where a part stands after a reading.

    The reader's own decision holds the thresholds of confidence and margin; with a text expected, only a part that
    bears it is accepted.
    """
    sure = reading.decision == "accept" and reading.verdict in ("", "confirmed")
    if sure:
        return PartState.ACCEPTED
    return PartState.TOUCH_NEEDED if reading.source == "vision" else PartState.REVIEW


def compared(reading: ReadingRecord, expected: str) -> ShadowRecord:
    """What comes of a part in shadow mode.

    Args:
        reading: made without knowing the text expected, so that the two readers know nothing of each other.
        expected: what the line's own reader has said; empty where it has said nothing.
    """
    if not expected.strip():
        agreement = Agreement.ALONE
    elif not reading.text:
        agreement = Agreement.NOTHING
    else:
        agreement = Agreement.SAME if same_text(reading.text, expected) else Agreement.OTHER
    return ShadowRecord(agreement, state_after(reading))


def why_touch(reading: ReadingRecord) -> str:
    """Why the camera's word is not enough, for the person at the line."""
    if not reading.text:
        return "the camera has found no characters"
    if reading.verdict in ("refuted", "undecided"):
        return f"the camera reads {reading.text}, which leaves the text expected {reading.verdict}"
    reasons = "; ".join(reading.messages) or "its thresholds are not met"
    return f"the camera is unsure of {reading.text} (confidence {reading.confidence:.2f}): {reasons}"
