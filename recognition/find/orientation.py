"""Read a line in the other orientations in which its marks may be text.

    line, ways possible --other text by likely images? (language.orientation)--> a look that way --> its lead

Orientations are excluded by what is known: how parts lie (the settings), the order of a map's rows (its file).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from recognition.find.promise import is_convincing
from recognition.find.search import UPSIDE_DOWN_DEG, Search
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation, Way, other_text, readable
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.views.text_line import TextLine
from recognition.views.view import View

LEAST_LEAD_NATS = 4.0
"""Least lead, in log probability, of a text over that of another orientation. If a plate is shown the wrong way and
read with certainty, the true text is at most 1.5 behind (python tests/benchmarks/orientation.py plates)."""


@dataclass(frozen=True)
class OtherReading:
    """The best text of a line in another orientation, and the log probability by which the line's own text leads it."""

    text: str
    lead_nats: float


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


def other_reading(line: ReadLine, way: Way, text: str, grammar: Grammar | None) -> OtherReading | None:
    """Compare a line's text with the best one in another orientation; None if none was read there.

    Args:
        line: the line, read in both orientations.
        way: the other orientation.
        text: text of the line, without blanks.
        grammar: format of the line.
    """
    there = line.other_ways.get(way)
    here = combine_looks(line.line, line.looks[:1], grammar)
    if there is None or here is None:
        return None
    other = choose(there.lattice, grammar, k=1).text
    if not other:
        return None
    lead = here.evidence_of(Grammar(sets=tuple(text))) - there.evidence_of(Grammar(sets=tuple(other)))
    # what the recogniser cannot read becomes blank: a text with fewer characters leaves marks unexplained
    return OtherReading(other, lead + max(here.promise - there.promise, 0.0))


def read_main_ways(search: Search, line: ReadLine, *, least_places: int = 4, sure: float = 0.9) -> ReadLine:
    """Read the serial's line in each other orientation in which its text can be read.

    Args:
        search: search of the view in which the line was read, under its format.
        line: the line.
        least_places: length from which a line without a format is text even if it is unsure.
        sure: probability from which a shorter one is.
    """
    request, choice = search.request, choose(line.lattice, search.request.grammar, k=1)
    short = request.grammar is None and len(choice.text) < least_places and choice.probability < sure
    if not choice.text or not line.is_text or short:
        return line
    possible = ways_possible(
        request.orientation, rows_known=request.rows_known, turned_deg=line.line.turned_deg
    )
    ways = [
        way
        for way in possible
        if (other := other_text(choice.text, way, request.grammar)) is not None and not other.exact
    ]
    # an unsure part is read in a mirror as well, unless that line is far less likely
    if Way.ROWS_REVERSED in possible and not is_convincing([line], request.limits.settled):
        ways = sorted({*ways, Way.ROWS_REVERSED})
    return _with_ways(search, line, ways)


def read_other_ways(search: Search, line: ReadLine, main: ReadLine, grammar: Grammar | None) -> ReadLine:
    """Read another line of the part in the orientations in which the serial can be read: it may exclude them.

    Args:
        search: search of the view in which the lines were read.
        line: the other line.
        main: the serial's line, read in its other orientations.
        grammar: format of the other line.
    """
    if math.cos(math.radians(line.line.turned_deg - main.line.turned_deg)) <= 0.0:
        return line
    serial = choose(main.lattice, search.request.grammar, k=1).text
    text = choose(line.lattice, grammar, k=1).text if grammar is not None else line.open_places[0].text
    possible = ways_possible(
        search.request.orientation, rows_known=search.request.rows_known, turned_deg=main.line.turned_deg
    )
    ways = [
        way
        for way in possible
        if _is_contested(main, way, serial, search.request.grammar)
        and readable(text, way, grammar)
        and not readable(text, way, grammar, exact=True)
    ]
    return _with_ways(search.under(grammar), line, ways)


def _is_contested(main: ReadLine, way: Way, text: str, grammar: Grammar | None) -> bool:
    other = other_text(text, way, grammar)
    if other is None or other.exact:
        return other is not None
    reading = other_reading(main, way, text, grammar)
    return reading is not None and reading.text != text and reading.lead_nats < LEAST_LEAD_NATS


def _with_ways(search: Search, line: ReadLine, ways: Iterable[Way]) -> ReadLine:
    there = {way: _read_way(search, line.line, way) for way in ways}
    seen = {way: lines[0] for way, lines in there.items() if lines}
    return replace(line, other_ways=MappingProxyType(seen)) if seen else line


def _read_way(search: Search, line: TextLine, way: Way) -> Sequence[ReadLine]:
    view = search.view.mirrored if way.mirrors else search.view
    return search.on(view).read([_line_in_view(line, search.view, way)])


def _line_in_view(line: TextLine, view: View, way: Way) -> TextLine:
    """The line in the coordinates of the rotated or mirrored view."""
    points = line.centre_mm
    if way.mirrors:
        top, height = view.origin_mm[1], view.size_mm[1]
        points = points * (1.0, -1.0) + (0.0, 2.0 * top + height)
    return TextLine(points[::-1] if way.reverses else points, line.height_mm)
