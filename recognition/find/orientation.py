"""Read a line in the other orientations in which its marks may be text.

    line, ways possible --other text by likely images? (language.orientation)--> a look that way --> its lead

Orientations are excluded by what is known: how parts lie (the settings), the order of a map's rows (its file).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
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


def read_ways(
    search: Search,
    main: ReadLine,
    others: Iterable[tuple[ReadLine, Grammar | None]],
    *,
    least_places: int = 4,
    sure: float = 0.9,
) -> tuple[ReadLine, list[ReadLine]]:
    """Read the serial's line in each other orientation in which its text can be read.

    Where that leaves a doubt, read the part's other lines too: one that can be read one way only excludes the other.

    Args:
        search: search of the view in which the lines were read, under the serial's format.
        main: the serial's line.
        others: the other lines and their formats.
        least_places: length from which a line without a format is text even if it is unsure.
        sure: probability from which a shorter one is.
    """
    request, grammar = search.request, search.request.grammar
    choice, lines = choose(main.lattice, grammar, k=1), list(others)
    short = grammar is None and len(choice.text) < least_places and choice.probability < sure
    if not choice.text or not main.is_text or short:
        return main, [line for line, _ in lines]
    possible = ways_possible(
        request.orientation, rows_known=request.rows_known, turned_deg=main.line.turned_deg
    )
    images = {way: image for way in possible if (image := other_text(choice.text, way, grammar)) is not None}
    # an unsure part is read in a mirror as well, whatever its text is
    unsure = not is_convincing([main], request.limits.settled)
    unlike = [way for way in possible if way in images and not images[way].exact]
    if unsure and Way.ROWS_REVERSED in possible and Way.ROWS_REVERSED not in unlike:
        unlike.append(Way.ROWS_REVERSED)
    main = _with_ways(search, main, unlike)
    doubtful = [
        way for way, image in images.items() if image.exact or _leaves_doubt(main, way, choice.text, grammar)
    ]
    read = []
    for line, line_format in lines:
        ways = [way for way in doubtful if _may_exclude(line, way, line_format, main)]
        read.append(_with_ways(search.under(line_format), line, ways))
    return main, read


def _leaves_doubt(line: ReadLine, way: Way, text: str, grammar: Grammar | None) -> bool:
    other = other_reading(line, way, text, grammar)
    return other is not None and other.text != text and other.lead_nats < LEAST_LEAD_NATS


def _may_exclude(line: ReadLine, way: Way, grammar: Grammar | None, main: ReadLine) -> bool:
    """Whether a line runs as the serial does, and a look is needed to tell if it can be read in another orientation."""
    text = line.open_places[0].text if grammar is None else choose(line.lattice, grammar, k=1).text
    along = math.cos(math.radians(line.line.turned_deg - main.line.turned_deg)) > 0.0
    return along and readable(text, way, grammar) and not readable(text, way, grammar, exact=True)


def _with_ways(search: Search, line: ReadLine, ways: Iterable[Way]) -> ReadLine:
    """The line with a look at it in each of these orientations in which it can be read."""
    seen = {}
    for way in ways:
        there = search.on(search.view.mirrored if way.mirrors else search.view)
        if read := there.read([_line_in_view(line.line, search.view, way)]):
            seen[way] = read[0]
    return replace(line, other_ways=MappingProxyType(seen))


def _line_in_view(line: TextLine, view: View, way: Way) -> TextLine:
    """The line in the coordinates of the rotated or mirrored view."""
    points = line.centre_mm
    if way.mirrors:
        top, height = view.origin_mm[1], view.size_mm[1]
        points = points * (1.0, -1.0) + (0.0, 2.0 * top + height)
    return TextLine(points[::-1] if way.reverses else points, line.height_mm)
