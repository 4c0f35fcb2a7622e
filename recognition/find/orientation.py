"""Read a line in the other orientations in which its marks may be text.

    line, ways possible --other text by likely images? (language.orientation)--> a look that way --> its lead

Orientations are excluded by what is known: how parts lie (the settings), the order of a map's rows (its file).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import MappingProxyType

from recognition.find.search import UPSIDE_DOWN_DEG, Search
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation, Way, readable
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.see.text_line import TextLine
from recognition.see.view import View

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
    """Orientations that the settings do not exclude; a line that runs up or down may be read from either end."""
    either_end = orientation is Orientation.ANY or abs(turned_deg) > 180.0 - UPSIDE_DOWN_DEG
    ways = (
        (Way.UPSIDE_DOWN, either_end),
        (Way.ROWS_REVERSED, not rows_known),
        (Way.LEFT_RIGHT, not rows_known and either_end),
    )
    return tuple(way for way, possible in ways if possible)


def other_reading(line: ReadLine, way: Way, text: str, grammar: Grammar | None) -> OtherReading | None:
    """Compare a line's text with the best one in another orientation; None without a text here or there."""
    there = line.other_ways.get(way)
    if there is None or not text:
        return None
    here, other = combine_looks(line.line, line.looks[:1], grammar), choose(there.lattice, grammar, k=1).text
    if here is None or not other:
        return None
    lead = here.evidence_of(Grammar(sets=tuple(text))) - there.evidence_of(Grammar(sets=tuple(other)))
    # what the recogniser cannot read becomes blank: a text with fewer characters leaves marks unexplained
    return OtherReading(other, lead + max(here.promise - there.promise, 0.0))


def read_ways(
    search: Search, line: ReadLine, text: str, ways: Iterable[Way], *, in_mirror: bool = False
) -> ReadLine:
    """Read a line in each other orientation in which its text can be read, but not by characters of the same shape.

    With `in_mirror` it is read with the rows in the other order whatever its text is: their order is unknown.
    """
    grammar, seen = search.request.grammar, {}
    for way in ways:
        by_likely_images = readable(text, way, grammar) and not readable(text, way, grammar, exact=True)
        if by_likely_images or (in_mirror and way is Way.ROWS_REVERSED):
            if not search.looks.may_look():
                break  # an orientation that was not looked at stays possible
            there = search.on(search.view.mirrored if way.mirrors else search.view)
            seen[way] = next(iter(there.read([line_in_view(line.line, search.view, way)])), None)
    return replace(line, other_ways=MappingProxyType(seen))


def line_in_view(line: TextLine, view: View, way: Way) -> TextLine:
    """The line in the coordinates of the rotated or mirrored view."""
    points = line.centre_mm
    if way.mirrors:
        top, height = view.origin_mm[1], view.size_mm[1]
        points = points * (1.0, -1.0) + (0.0, 2.0 * top + height)
    return TextLine(points[::-1] if way.reverses else points, line.height_mm)
