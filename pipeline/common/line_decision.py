"""A part's result for a controller: its decision in one word, and the few fields that matter."""

from __future__ import annotations

from enum import StrEnum

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord, PartState

NO_READING = ReadingRecord("", "", "", 0.0)


class LineDecision(StrEnum):
    """Decisions about a part, for a controller."""

    ACCEPT = "ACCEPT"
    REVIEW = "REVIEW"
    REJECT = "REJECT"
    TOUCH = "TOUCH"
    SHADOW = "SHADOW"


def decision_of(part: PartRecord) -> LineDecision:
    """Decision about a part.

    ACCEPT: read with certainty, or entered by a person. REVIEW: a person has to look. REJECT: also, but nothing could
    be read, or a person found it unreadable. TOUCH: the camera is unsure and there is no scan yet. SHADOW: nothing was
    decided.
    """
    if part.state is PartState.SHADOW:
        return LineDecision.SHADOW
    if part.state is PartState.TOUCH_NEEDED:
        return LineDecision.TOUCH
    if part.state is PartState.ACCEPTED:
        return LineDecision.ACCEPT
    if part.state is PartState.REVIEWED:
        return LineDecision.ACCEPT if part.text else LineDecision.REJECT
    rejected = part.reading is None or part.reading.decision == "reject" or not part.reading.text
    return LineDecision.REJECT if rejected else LineDecision.REVIEW


def short_result(part: PartRecord) -> dict[str, str | float]:
    """The few fields of a part that a controller needs; a text that awaits a person is only a candidate."""
    reading, in_review = part.reading or NO_READING, part.state is PartState.REVIEW
    return {
        "id": part.id,
        "name": part.name,
        "state": part.state.value,
        "decision": decision_of(part).value,
        "text": "" if in_review else part.text,
        "candidate": part.text if in_review else "",
        "confidence": reading.confidence,
        "source": reading.source,
    }
