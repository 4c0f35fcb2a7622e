"""Check whether the marks can also be read upside down or mirrored.

    reading, ways possible --other text? (language.orientation)--> none: as it is
                           \\--exact images------------------------> review: "also readable upside down: 809006"
                           \\--likely images --a look that way-----> review, if it reads about as well

Orientations are excluded by what is known: how parts lie (the settings), the order of a map's rows (its file),
another line on the part that can be read one way only.
"""

from __future__ import annotations

import math

from recognition.decision.decide import Finding, ReadingFlag
from recognition.decision.reading import OtherLine, Reading
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation, Way, other_text, readable
from recognition.search.line_reader import LineReader
from recognition.search.line_search import UPSIDE_DOWN_DEG
from recognition.views.text_line import TextLine
from recognition.views.view import View

LEAST_LEAD_NATS = 4.0
"""Least lead, in log probability, of a text over that of another orientation. If a plate is shown the wrong way and
read with certainty, the true text is at most 1.5 behind (python tests/benchmarks/orientation.py plates)."""
_SET = {
    Way.UPSIDE_DOWN: "set orientation = upright if parts lie so",
    Way.ROWS_REVERSED: "set rows if their order is known",
    Way.LEFT_RIGHT: "set rows if their order is known",
}


def ways_possible(
    orientation: Orientation, *, rows_known: bool = True, turned_deg: float = 0.0
) -> tuple[Way, ...]:
    """Orientations other than upright that the settings do not exclude.

    Args:
        orientation: possible orientations of the parts.
        rows_known: whether the order of the map's rows is known; of a photograph it is.
        turned_deg: rotation of the line that was read; one that runs up or down may be read from either end.
    """
    either_end = orientation is Orientation.ANY or abs(turned_deg) > 180.0 - UPSIDE_DOWN_DEG
    ways = (
        (Way.UPSIDE_DOWN, either_end),
        (Way.ROWS_REVERSED, not rows_known),
        (Way.LEFT_RIGHT, not rows_known and either_end),
    )
    return tuple(way for way, possible in ways if possible)


def weigh_orientation(reading: Reading, view: View, lines: LineReader, *, rows_known: bool = True) -> Reading:
    """Send a reading to review if another orientation gives another possible text.

    Args:
        reading: with its line in the trace.
        view: view that was read.
        lines: reader of lines on such views.
        rows_known: whether the order of the map's rows is known; of a photograph it is.
    """
    text, line = plain_text(reading), reading.trace.line
    if not text or line is None:
        return reading
    orientation, found = lines.search.orientation, []
    for way in ways_possible(orientation, rows_known=rows_known, turned_deg=reading.rotation_deg):
        other = other_text(text, way, lines.grammar)
        if other is None:
            continue
        words, lead = (other.text, 0.0) if other.exact else _seen_other_way(text, line, view, lines, way)
        if words in ("", text) or lead >= LEAST_LEAD_NATS:
            continue
        sure = (one for one in reading.others if one.confidence >= (reading.threshold or 0.0))
        if not any(_excludes(way, one, line, view, lines) for one in sure):
            found.append(also_readable(way, words))
    return reading.with_findings(*found) if found else reading


def lead_nats(reading: Reading, view: View, lines: LineReader, way: Way) -> float:
    """Log probability by which the text leads the best text in the other orientation; -inf without a line.

    Args:
        reading: with its line in the trace.
        view: view that was read.
        lines: reader of lines on such views.
        way: the other orientation.
    """
    line = reading.trace.line
    return -math.inf if line is None else _seen_other_way(plain_text(reading), line, view, lines, way)[1]


def also_readable(way: Way, text: str) -> Finding:
    """Finding that the marks can also be read in another orientation."""
    return Finding(ReadingFlag.ORIENTATION_UNKNOWN, f"also readable {way}: {text} ({_SET[way]})")


def plain_text(reading: Reading) -> str:
    """The serial without blanks."""
    return "".join(reading.text.split())


def _excludes(way: Way, other: OtherLine, serial: TextLine, view: View, lines: LineReader) -> bool:
    """Whether another line with the serial's direction cannot be read in the other orientation."""
    if other.line is None or math.cos(math.radians(other.line.turned_deg - serial.turned_deg)) <= 0.0:
        return False
    asked = lines.lines.get(other.name)
    grammar, text = (None if asked is None else asked.grammar), "".join(other.text.split())
    if readable(text, way, grammar, exact=True):
        return False
    if not readable(text, way, grammar):
        return True
    return _seen_other_way(text, other.line, view, lines.under(grammar), way)[1] >= LEAST_LEAD_NATS


def _seen_other_way(text: str, line: TextLine, view: View, lines: LineReader, way: Way) -> tuple[str, float]:
    """Text read in the other orientation, empty if none, and the lead of the reading's text in nats."""
    there_view = view.mirrored if way.mirrors else view
    here = lines.search.read_once(view, [line])
    there = lines.search.read_once(there_view, [_line_in_view(line, view, way)])
    if not here:
        return "", -math.inf
    other = choose(there[0].lattice, lines.grammar).text if there else ""
    if not other:
        return "", math.inf
    read, otherwise = here[0], there[0]
    lead = read.evidence_of(Grammar(sets=tuple(text))) - otherwise.evidence_of(Grammar(sets=tuple(other)))
    # what the recogniser cannot read becomes blank: a text with fewer characters leaves marks unexplained
    return other, lead + max(read.promise - otherwise.promise, 0.0)


def _line_in_view(line: TextLine, view: View, way: Way) -> TextLine:
    """The line in the coordinates of the rotated or mirrored view."""
    points = line.centre_mm
    if way.mirrors:
        top, height = view.origin_mm[1], view.size_mm[1]
        points = points * (1.0, -1.0) + (0.0, 2.0 * top + height)
    return TextLine(points[::-1] if way.reverses else points, line.height_mm)
