"""Check whether the marks can also be read upside down or mirrored.

    reading, ways possible --other text? (language.orientation)--> none: as it is
                           \\--exact images------------------------> review: "also readable upside down: 809006"
                           \\--likely images, as read that way-----> review, if it reads about as well

Another line on the part that can be read one way only excludes an orientation, too.
"""

from __future__ import annotations

import math

from recognition.decision.decide import Finding, ReadingFlag
from recognition.decision.reading import OtherLine, Reading
from recognition.find.orientation import LEAST_LEAD_NATS, other_reading, ways_possible
from recognition.find.part_lines import PartLines
from recognition.find.request import LineRequest
from recognition.language.orientation import Way, other_text, readable
from recognition.views.text_line import TextLine

_SET = {
    Way.UPSIDE_DOWN: "set orientation = upright if parts lie so",
    Way.ROWS_REVERSED: "set rows if their order is known",
    Way.LEFT_RIGHT: "set rows if their order is known",
}


def weigh_orientation(reading: Reading, part: PartLines, request: LineRequest) -> Reading:
    """Send a reading to review if another orientation gives another possible text.

    Args:
        reading: the decided reading.
        part: lines of the part, read in their other orientations.
        request: lines that were looked for.
    """
    text, main = plain_text(reading), part.main
    if not text or main is None:
        return reading
    findings = []
    for way in ways_possible(
        request.orientation, rows_known=request.rows_known, turned_deg=reading.rotation_deg
    ):
        other = other_text(text, way, request.grammar)
        if other is None:
            continue
        words = other.text
        if not other.exact:
            there = other_reading(main, way, text, request.grammar)
            if there is None or there.text == text or there.lead_nats >= LEAST_LEAD_NATS:
                continue
            words = there.text
        sure = (line for line in reading.others if line.confidence >= (reading.threshold or 0.0))
        if not any(_excludes(way, line, main.line, part, request) for line in sure):
            findings.append(also_readable(way, words))
    return reading.with_findings(*findings) if findings else reading


def also_readable(way: Way, text: str) -> Finding:
    """Finding that the marks can also be read in another orientation."""
    return Finding(ReadingFlag.ORIENTATION_UNKNOWN, f"also readable {way}: {text} ({_SET[way]})")


def plain_text(reading: Reading) -> str:
    """The serial without blanks."""
    return plain(reading.text)


def plain(text: str) -> str:
    """A text without blanks."""
    return "".join(text.split())


def _excludes(way: Way, other: OtherLine, serial: TextLine, part: PartLines, request: LineRequest) -> bool:
    """Whether another line with the serial's direction cannot be read in the other orientation."""
    if other.line is None or math.cos(math.radians(other.line.turned_deg - serial.turned_deg)) <= 0.0:
        return False
    line_format = request.lines.get(other.name)
    grammar, text = (None if line_format is None else line_format.grammar), plain(other.text)
    if readable(text, way, grammar, exact=True):
        return False
    if not readable(text, way, grammar):
        return True
    lines = (*part.named.values(), *part.others)
    line = next((line for line in lines if line.line is other.line), None)
    there = None if line is None else other_reading(line, way, text, grammar)
    return there is None or there.lead_nats >= LEAST_LEAD_NATS
