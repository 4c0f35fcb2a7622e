"""Look whether the marks can also be read upside down or mirrored.

    text, ways possible --other text? (language.orientation)--> none
                        \\--exact images--------------------->  OtherWay: "809006" upside down
                        \\--likely images --a look that way-->  OtherWay, if it reads about as well

Orientations are excluded by what is known: how parts lie (the settings), the order of a map's rows (its file),
another line on the part that can be read one way only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from recognition.combine.read_line import ReadLine
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation, Way, other_text, readable
from recognition.search.line_reader import LineReader
from recognition.search.line_search import UPSIDE_DOWN_DEG
from recognition.search.part_lines import PartLines
from recognition.views.text_line import TextLine
from recognition.views.view import View

LEAST_LEAD_NATS = 4.0
"""Least lead, in log probability, of a text over that of another orientation. If a plate is shown the wrong way and
read with certainty, the true text is at most 1.5 behind (python tests/benchmarks/orientation.py plates)."""


@dataclass(frozen=True, eq=False)
class OtherWay:
    """Another orientation in which the marks of the serial can be read.

    Attributes:
        way: the orientation.
        text: what they read in it.
        excluded_by: other lines of the part that cannot be read in it: it is out of the question if one is sure.
    """

    way: Way
    text: str
    excluded_by: tuple[TextLine, ...] = ()


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


def other_ways(
    part: PartLines, view: View, lines: LineReader, *, rows_known: bool = True
) -> tuple[OtherWay, ...]:
    """Read the serial's line in the other orientations that give another possible text.

    Args:
        part: lines that were read.
        view: view on which they were read.
        lines: reader of lines on such views.
        rows_known: whether the order of the map's rows is known; of a photograph it is.
    """
    main = part.main
    if main is None:
        return ()
    text = choose(main.lattice, lines.grammar).text
    return tuple(_other_ways(text, main.line, part, view, lines, rows_known=rows_known))


def _other_ways(
    text: str, line: TextLine, part: PartLines, view: View, lines: LineReader, *, rows_known: bool
) -> Iterator[OtherWay]:
    ways = ways_possible(lines.search.orientation, rows_known=rows_known, turned_deg=line.turned_deg)
    for way in ways if text else ():
        other = other_text(text, way, lines.grammar)
        if other is None:
            continue
        words, lead = (other.text, 0.0) if other.exact else _read_that_way(text, line, view, lines, way)
        if words not in ("", text) and lead < LEAST_LEAD_NATS:
            yield OtherWay(way, words, tuple(_one_way_lines(way, line, part, view, lines)))


def lead_nats(part: PartLines, view: View, lines: LineReader, way: Way) -> float:
    """Log probability by which the serial leads the best text in another orientation; -inf without a line."""
    if part.main is None:
        return -math.inf
    text = choose(part.main.lattice, lines.grammar).text
    return _read_that_way(text, part.main.line, view, lines, way)[1]


def _one_way_lines(
    way: Way, serial: TextLine, part: PartLines, view: View, lines: LineReader
) -> Iterator[TextLine]:
    """Other lines with the serial's direction that cannot be read in the other orientation."""
    named: list[tuple[ReadLine, Grammar | None]] = [
        (read, lines.lines[name].grammar) for name, read in part.named.items() if read.is_text
    ]
    for read, grammar in (*named, *((read, None) for read in part.others)):
        if math.cos(math.radians(read.line.turned_deg - serial.turned_deg)) <= 0.0:
            continue
        text = read.open_places[0].text if grammar is None else choose(read.lattice, grammar).text
        if readable(text, way, grammar, exact=True):
            continue
        lead = math.inf
        if readable(text, way, grammar):
            lead = _read_that_way(text, read.line, view, lines.under(grammar), way)[1]
        if lead >= LEAST_LEAD_NATS:
            yield read.line


def _read_that_way(text: str, line: TextLine, view: View, lines: LineReader, way: Way) -> tuple[str, float]:
    """Text read in the other orientation, empty if none, and the lead of the given text in nats."""
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
