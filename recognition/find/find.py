"""Find and read the lines of a part: which one is the serial, and the posteriors of each.

    views --search--> the most promising line --more looks--> main, other lines --other orientations--> PartLines

The format decides which of several lines is the serial; other text stays unassigned (`PartLines.others`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from types import MappingProxyType

import numpy as np

from recognition.find.finder import overlap
from recognition.find.layouts import other_layout
from recognition.find.line_variants import lengthen
from recognition.find.looks import Looks
from recognition.find.orientation import LEAST_LEAD_NATS, other_reading, read_ways, ways_possible
from recognition.find.part_lines import PartLines
from recognition.find.promise import is_convincing, promise_of
from recognition.find.region import stands_in
from recognition.find.request import LineFormat, LineRequest
from recognition.find.search import Move, Search
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.orientation import readable
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.see.text_line import TextLine
from recognition.see.view import View, ViewKind

MOVES: tuple[Move, ...] = ((0.08, 1.0, 2), (-0.08, 1.0, 5), (0.0, 1.1, 3), (0.0, 0.91, 2))
BETWEEN: Move = (0.0, 1.0, 3)
"""The move of a look whose steps fall halfway between those of the first."""


def search_of(view: View, request: LineRequest, looks: Looks | None = None) -> Search:
    """Search for lines of a view by the networks, or by templates if the request names their fonts."""
    looks = looks or Looks(most=request.limits.most_looks, deadline=request.deadline)
    if request.templates is None:
        return Search(view, request, looks)
    from recognition.find.template_lines import TemplateSearch

    return TemplateSearch(view, request, looks)


def within_area(views: Sequence[View], request: LineRequest) -> tuple[Sequence[View], LineRequest]:
    """Crop views of one part to the area of the request's regions, and the request to these."""
    area = request.area
    return (views, request) if area is None else ([view.cut(area) for view in views], request.inside(area))


@dataclass(frozen=True, eq=False)
class FoundLines:
    """Lines of a part, and the search that found them."""

    lines: PartLines
    _search: Search

    def with_layout(self, lines: PartLines | None = None) -> PartLines:
        """Look for another layout of a doubtful part (a fifth of a search); `lines` replace those found."""
        lines, looks, limits = lines or self.lines, self._search.looks, self._search.request.limits
        before = looks.count
        if limits.most_looks is not None:
            looks.most = before + limits.layout_looks
        layout = other_layout(self._search, self.lines.main, self.lines.candidates)
        count = lines.looks + looks.count - before
        return replace(lines, layout=layout, looks=count, stopped=looks.deadline.stopped)


def find(
    views: Sequence[View], request: LineRequest, *, about: Sequence[TextLine] = (), twice: bool = False
) -> PartLines:
    """Find and read the lines of a part, and another layout of a doubtful one; see `read_lines`."""
    return read_lines(views, request, about=about, twice=twice).with_layout()


def read_lines(
    views: Sequence[View], request: LineRequest, *, about: Sequence[TextLine] = (), twice: bool = False
) -> FoundLines:
    """Find and read the lines of a part; views are in one frame, under different lights.

    Later views are read if earlier ones are not enough. `twice` looks again even if one look is sure: templates need
    accurate places.
    """
    views, request = within_area(views, request)
    limits = request.limits
    looks = Looks(deadline=request.deadline)
    searched: list[tuple[Search, list[ReadLine]]] = []
    for view in views:
        if searched and looks.deadline.is_over():
            break
        # each light may be looked at as often
        looks.most = None if limits.most_looks is None else looks.count + limits.most_looks
        search = search_of(view, request, looks)
        searched.append((search, search.lines(about)))
        # if only a later light is sure, that may be chance: then the line is read under all lights
        if is_convincing(search.in_region(searched[-1][1]), limits.sure):
            break
    search, lines = max(
        searched, key=lambda each: max(map(promise_of, each[0].in_region(each[1])), default=-np.inf)
    )
    candidates, part = search.in_region(lines), PartLines(None)
    if candidates:
        others = [search.on(view) for view in views if view is not search.view]
        finalists = candidates[: 1 if is_convincing(candidates, limits.settled) else 2]
        best, *_ = [*search.read(read.line for read in finalists), candidates[0]]
        best, longer = _at_its_ends(search, best)
        main = _read_closely(
            search, best, grammar=request.grammar, others=others, always=len(searched) > 1, twice=twice
        )
        part = _with_other_lines(search, main, [line for line in lines if apart(line, main)])
        part = replace(part, candidates=_places(search.view, candidates), longer=longer)
    return FoundLines(replace(part, looks=looks.count), search)


def _at_its_ends(
    search: Search, best: ReadLine, *, add_heights: float = 2.2, sure: float = 0.5, nats: float = 0.5
) -> tuple[ReadLine, ReadLine | None]:
    """The line, or one made longer at an end that is better by `nats`; and one that is worse by no more.

    Where the format allows longer serials, nothing else shows that a sure text is only a piece. Of 91 such texts of
    photographs without a format this finds all four pieces, and doubts none of 80 right ones.
    """
    grammar, photograph = search.request.grammar, search.view.kind is ViewKind.PHOTO
    lengths = None if grammar is None else grammar.lengths()
    whole = lengths is not None and best.lattice.n_places >= max(lengths)
    if whole or not photograph or not is_convincing([best], sure):
        return best, None
    ends = ((add_heights, 0.0), (0.0, add_heights))
    more = [
        read
        for read in search.in_region(search.read(lengthen(best.line, *end) for end in ends))
        if read.lattice.n_places > best.lattice.n_places and promise_of(read) > promise_of(best) - nats
    ]
    if more and promise_of(more[0]) > promise_of(best) + nats:
        return more[0], more[1] if len(more) > 1 else None
    return best, more[0] if more else None


def _read_closely(
    search: Search,
    best: ReadLine,
    *,
    grammar: Grammar | None,
    others: Sequence[Search] = (),
    always: bool = False,
    twice: bool = False,
) -> ReadLine:
    if not best.is_text:
        looks = []
    elif always or not best.is_agreed:
        looks = search.more_looks(best, (BETWEEN, *MOVES))
        for number, other in enumerate(others, start=1):
            # under another light, look first without a move
            looks += [replace(s, view=number) for s in other.more_looks(best, ((0.0, 1.0, 0), *MOVES))]
    else:
        looks = search.more_looks(best, (BETWEEN,)) if twice else []
    return (combine_looks(best.line, (*best.looks, *looks), grammar) if looks else None) or best


def _with_other_lines(search: Search, main: ReadLine, others: Iterable[ReadLine]) -> PartLines:
    named: dict[str, ReadLine] = {}
    for name, wanted in search.request.lines.items():
        line = _line_named(search, others, wanted)
        if line is not None:
            named[name] = line
            others = [other for other in others if apart(other, line)]
    unassigned: list[ReadLine] = []
    for line in others:
        if is_clear_text(line) and all(apart(line, other) for other in unassigned):
            unassigned += search.read([line.line])
    request, serial = search.request, _serial_of(main, search.request.grammar)
    ways = ways_possible(request.orientation, rows_known=request.rows_known, turned_deg=main.line.turned_deg)
    unsure = not is_convincing([main], request.limits.settled)
    main = read_ways(search, main, serial, ways, in_mirror=unsure)
    # another line may exclude an orientation in which the serial reads about as well
    lead_nats = {
        way: other.lead_nats for way in ways if (other := other_reading(main, way, serial, request.grammar))
    }
    doubtful = [
        way
        for way in ways
        if readable(serial, way, request.grammar) and lead_nats.get(way, 0.0) < LEAST_LEAD_NATS
    ]
    for name, line in named.items():
        grammar = request.lines[name].grammar
        text = choose(line.lattice, grammar, k=1).text
        named[name] = read_ways(search.under(grammar), line, text, doubtful)
    return PartLines(
        main,
        MappingProxyType(named),
        tuple(read_ways(search.under(None), line, line.open_places[0].text, doubtful) for line in unassigned),
    )


def _serial_of(main: ReadLine, grammar: Grammar | None, *, least_places: int = 4, sure: float = 0.9) -> str:
    choice = choose(main.lattice, grammar, k=1)
    short = grammar is None and len(choice.text) < least_places and choice.probability < sure
    return choice.text if main.is_text and not short else ""


def _line_named(
    search: Search, lines: Iterable[ReadLine], wanted: LineFormat, *, least_evidence: float = -4.0
) -> ReadLine | None:
    fits = [
        read
        for line in lines
        if stands_in(wanted.region, line.line, search.view)
        and (read := combine_looks(line.line, line.looks, wanted.grammar)) is not None
    ]
    if not fits:
        return None
    best = _read_closely(search, max(fits, key=promise_of), grammar=wanted.grammar)
    return best if best.evidence > least_evidence else None


def _places(
    view: View, candidates: Iterable[ReadLine], *, most_candidates: int = 4, most_across: float = 0.9
) -> tuple[TextLine, ...]:
    places: list[ReadLine] = []
    for line in candidates:
        across = line.line.length_mm > most_across * view.size_mm[0]
        if not across and len(places) < most_candidates and all(apart(line, other) for other in places):
            places.append(line)
    return tuple(line.line for line in places)


def apart(line: ReadLine, other: ReadLine, *, room: float = 0.45) -> bool:
    """Whether two lines are different ink: `room` of both heights lies between their middles."""
    band_mm = room * (line.line.height_mm + other.line.height_mm)
    return not any(overlap(a, b, band_mm=band_mm) for a, b in permutations((line.line, other.line)))


def is_clear_text(line: ReadLine, *, least_belief: float = 0.8, least_places: int = 3) -> bool:
    """Whether a line can be read as any text."""
    lattice, _ = line.open_places
    best = np.exp(lattice.log_belief.max(axis=1, initial=-np.inf))
    return lattice.n_places >= least_places and float(best.mean()) > least_belief
