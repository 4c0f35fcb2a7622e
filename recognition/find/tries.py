"""The table of tries: how lines are proposed and refined, when, and from which promise no longer.

If the usual lines are not convincing, proposals follow. The table counts which one gave the best line of 680 parts of
the calibration design (the first pass counts as well):

    usual   faint   whole view   small   slanted   upside down   running down
    felt       617     213      17           3       1         0             0
    photograph 341     307      10          39       2         2             0

No line of these parts runs down, and few are upside down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING

from recognition.find.finder import FoundLine, find_lines
from recognition.find.ink import on_ink
from recognition.find.line_variants import (
    GROWTHS,
    SAGS,
    SIZES,
    anywhere,
    bend,
    lengthen,
    longer,
    move_line,
    variants,
    whole_view,
)
from recognition.find.promise import is_convincing, promise_of
from recognition.find.region import about_region
from recognition.find.tiles import find_in_tiles
from recognition.recogniser.read_line import ReadLine
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import ViewKind

if TYPE_CHECKING:
    from recognition.find.request import SearchLimits
    from recognition.find.search import Search

Lines = Sequence[ReadLine]


class Start(Enum):
    """What a try starts from."""

    VIEW = auto()
    FIRST_LINES = auto()
    BEST_LINE = auto()


@dataclass(frozen=True)
class Try:
    """A way to look for a line.

    Attributes:
        propose: proposes lines to read, from all lines so far or from the one that is refined.
        skip_from: share of the greatest promise from which it is skipped.
        start: what it starts from; what starts from lines refines them.
        applies: whether it is worth a look, of the same lines.
        least_promise: promise from which a proposed line is more than a guess.
        repeats: most refinements of a line.
        gain_nats: least promise that a line must gain each time.
    """

    propose: Callable[[Search, Lines], Sequence[TextLine]]
    skip_from: float
    start: Start = Start.VIEW
    applies: Callable[[Search, Lines], bool] = lambda _search, _lines: True
    least_promise: float = -math.inf
    repeats: int = 1
    gain_nats: Callable[[ReadLine], float] = lambda _line: 0.0


def proposals(search: Search) -> tuple[Try, ...]:
    """Proposals of a view, in the order in which they are tried."""
    limits, unknown = search.request.limits, search.request.height_mm is None
    photo = search.view.kind is ViewKind.PHOTO
    # a line fills much of a scan, but may be small in a photograph. The best of many noisy tiles has a high score by
    # chance: without promise it is only a guess
    small = (
        Try(lambda *_: _in_tiles(search, fine=False), limits.some, least_promise=0.0),
        # a known height is one scale, which the first of these has searched
        Try(
            lambda *_: _in_tiles(search, fine=True), limits.some,
            applies=lambda *_: unknown and not _is_clear(search), least_promise=0.0,
        ),
    )  # fmt: skip
    return (
        Try(lambda *_: whole_view(search.view), limits.plain, applies=lambda *_: unknown),
        Try(_upside_down, limits.plain),
        *(small if photo else ()),
        Try(lambda *_: _faint(search), limits.some if photo else limits.sure),
        Try(lambda *_: _in_directions(search, (90.0,)), limits.some),
        Try(lambda *_: _in_directions(search, _slants_deg(search)), limits.some),
        *(() if photo else small),
    )


def refinements(search: Search) -> tuple[Try, ...]:
    """Refinements of the best lines, in the order in which they are tried."""
    limits, unknown = search.request.limits, search.request.height_mm is None
    photo = search.view.kind is ViewKind.PHOTO
    return (
        Try(
            _on_ink, limits.settled, Start.FIRST_LINES,
            applies=_is_doubtful, repeats=limits.most_refits, gain_nats=lambda line: 0.3 * _doubt_nats(line),
        ),
        # without a format the length is unknown, so another word may follow after a gap
        Try(
            lambda _, lines: longer(lines[0].line), math.inf, Start.BEST_LINE,
            applies=lambda _, lines: search.request.grammar is None and is_convincing(lines, limits.sure),
        ),
        Try(lambda _, lines: variants(lines[0].line), limits.sure, Start.FIRST_LINES),
        Try(
            lambda _, lines: [move_line(lines[0].line, 0.0, size) for size in SIZES], limits.settled,
            Start.BEST_LINE, applies=lambda _, lines: photo and unknown and _is_doubtful(search, lines), repeats=2,
        ),
        Try(_longer_at_ends, math.inf, Start.BEST_LINE, repeats=3),
    )  # fmt: skip


def with_sags(limits: SearchLimits, line: TextLine) -> Try:
    """Bend a line, if the best one is doubtful."""
    return Try(
        lambda *_: [bend(line, sag) for sag in SAGS], limits.sure, Start.BEST_LINE,
        gain_nats=lambda _: limits.chance_gain,
    )  # fmt: skip


def straight_and_bent(found: Sequence[FoundLine]) -> list[TextLine]:
    """The positions of found lines, straight and as arcs."""
    return [line for each in found for line in (each.line, each.bent) if line is not None]


def _is_clear(search: Search) -> bool:
    return max((found.score for found in search.found), default=0.0) >= search.request.limits.clear_heights


def _upside_down(search: Search, lines: Lines) -> list[TextLine]:
    return [read.line.reversed for read in lines[: search.request.limits.most_turned]]


def _faint(search: Search) -> list[TextLine]:
    height_mm = search.request.height_mm
    faint = find_lines(search.view, height_mm=height_mm, faint=True)[: search.request.limits.most_lines]
    return [*(found.line for found in faint), *anywhere(search.view, height_mm=height_mm)]


def _in_tiles(search: Search, *, fine: bool, most_small: int = 16, most_reversed: int = 4) -> list[TextLine]:
    # most_small: number of small lines that are read; many of those found are only edges of a machine. In 24
    # cluttered frames the serial was among the first ten, and if it was read, among the first four
    # most_reversed: number of these that are also read upside down
    near = about_region(search.request.region, search.view)
    small = find_in_tiles(near, height_mm=search.request.height_mm, fine=fine)
    lines = [found.line for found in small[:most_small]]
    return [*lines, *(line.reversed for line in lines[:most_reversed])]


def _slants_deg(
    search: Search, *, slants_deg: Sequence[float] = (30.0, -30.0, 60.0, -60.0), slanted_sides: float = 2.5
) -> Sequence[float]:
    # slanted_sides: ratio of the view's sides from which there is no room for a slanted line
    short, long = sorted(search.view.size_mm)
    return slants_deg if long < slanted_sides * short else ()


def _in_directions(search: Search, turns_deg: Sequence[float]) -> list[TextLine]:
    turned = [
        found
        for turn in turns_deg
        for found in find_lines(search.view, height_mm=search.request.height_mm, turned_deg=turn)
    ]
    best = sorted(turned, key=lambda found: -found.score)[: search.request.limits.most_turned]
    lines = [*straight_and_bent(best[:1]), *(found.line for found in best[1:])]
    return [*lines, *(line.reversed for line in lines)]


def _on_ink(search: Search, lines: Lines) -> Sequence[TextLine]:
    known = search.request.height_mm is not None
    return on_ink(search.view, lines[0].line, lines[0].columns, height_known=known)


def _is_doubtful(search: Search, lines: Lines) -> bool:
    return not is_convincing(lines, search.request.limits.settled)


def _doubt_nats(read: ReadLine) -> float:
    return read.lattice.n_places - promise_of(read)


def _longer_at_ends(_: Search, lines: Lines, *, end_heights: float = 0.55) -> list[TextLine]:
    """Lengthen a line where a character lies at its end: others may follow beyond.

    Args:
        end_heights: distance from a strip's end within which a character may have a neighbour beyond it, character
            heights.
    """
    line, columns = lines[0].line, lines[0].columns
    near = (end_heights + MARGIN) * HEIGHT_ROWS
    first, last = (
        (bool(columns[0] < near), bool(columns[-1] > line.columns() - near))
        if columns.size
        else (False, False)
    )
    return [lengthen(line, first * far, last * far) for far in GROWTHS] if first or last else []
