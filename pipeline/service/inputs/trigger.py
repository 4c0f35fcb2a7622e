"""Common code of the ports at the line: triggers, decisions in one word, and error messages."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from enum import StrEnum

from glyphs.plain_text import is_hidden
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord, PartState
from pipeline.service.web.problem import problem_of

NO_READING = ReadingRecord("", "", "", 0.0)
_MOST_WORDS = 200
Trigger = Callable[[str, str], Awaitable[PartRecord]]
"""Photograph the part with a name, read it by a job (both may be empty), and return it once it is stored."""


class LineDecision(StrEnum):
    """Decisions about a part, for a controller."""

    ACCEPT = "ACCEPT"
    REVIEW = "REVIEW"
    REJECT = "REJECT"
    TOUCH = "TOUCH"
    SHADOW = "SHADOW"


def decision_of(part: PartRecord) -> LineDecision:
    """Decision about a part.

    ACCEPT: read with certainty, or a person has entered its text. REVIEW: a person has to look. REJECT: a person has to
    look and nothing could be read, or a person found it unreadable. TOUCH: the camera is unsure and there is no scan
    yet. SHADOW: nothing was decided; the line uses its own reader.
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


def in_words(error: BaseException) -> str:
    """Error message for the caller: one short line without control characters."""
    plain = "".join(" " if is_hidden(char) else char for char in problem_of(error).detail)
    words = " ".join(plain.split())
    return words if len(words) <= _MOST_WORDS else words[: _MOST_WORDS - 3] + "..."
