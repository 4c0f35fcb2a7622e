"""The table of tries: how lines are proposed and refined, when, and from which promise no longer.

If the usual lines are not convincing, proposals follow. The table counts which one gave the best line of 680 parts of
the calibration design (the first pass counts as well):

                usual   faint   whole view   small   slanted   upside down   running down
    felt          617     213           17       3         1             0              0
    photograph    341     307           10      39         2             2              0

No line of these parts runs down, and few are upside down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

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
from recognition.find.request import LineRequest
from recognition.find.tiles import find_in_tiles
from recognition.recogniser.read_line import ReadLine
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import View, ViewKind

Lines = Sequence[ReadLine]


class Start(Enum):
    """Start of a try."""

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
        applies: whether a line is worth a refinement.
        replaces_next: whether the next row is skipped where this one applies.
        least_promise: promise from which a proposed line is more than a guess.
        repeats: most refinements of a line.
        gain_nats: least promise that a line must gain each time.
    """

    propose: Callable[[Lines], Sequence[TextLine]]
    skip_from: float
    start: Start = Start.VIEW
    applies: Callable[[Lines], bool] = lambda _: True
    replaces_next: bool = False
    least_promise: float = -math.inf
    repeats: int = 1
    gain_nats: Callable[[ReadLine], float] = lambda _: 0.0


def proposals(view: View, request: LineRequest, candidates: Sequence[FoundLine]) -> tuple[Try, ...]:
    """Proposals of a view whose usual lines are not convincing, in the order in which they are tried."""
    limits, height_mm, photo = request.limits, request.height_mm, view.kind is ViewKind.PHOTO
    clear = max((each.score for each in candidates), default=0.0) >= limits.clear_heights
    # a line fills much of a scan, but may be small in a photograph. The best of many noisy tiles has a high score by
    # chance: without promise it is only a guess
    small = [Try(lambda _: _in_tiles(view, request, fine=False), limits.some, least_promise=0.0)]
    # a known height is one scale, which the first of these has searched
    if height_mm is None and not clear:
        small.append(Try(lambda _: _in_tiles(view, request, fine=True), limits.some, least_promise=0.0))
    return (
        Try(lambda _: [] if height_mm is not None else whole_view(view), limits.plain),
        Try(lambda lines: [read.line.reversed for read in lines[: limits.most_turned]], limits.plain),
        *(small if photo else ()),
        Try(lambda _: _faint(view, request), limits.some if photo else limits.sure),
        Try(lambda _: _in_directions(view, request, (90.0,)), limits.some),
        Try(lambda _: _in_directions(view, request, _slants_deg(view)), limits.some),
        *(() if photo else small),
    )


def refinements(view: View, request: LineRequest) -> tuple[Try, ...]:
    """Refinements of the best lines, in the order in which they are tried."""
    limits, known = request.limits, request.height_mm is not None

    def is_doubtful(lines: Lines) -> bool:
        return not is_convincing(lines, limits.settled)

    def on_its_ink(lines: Lines) -> Sequence[TextLine]:
        return on_ink(view, lines[0].line, lines[0].columns, height_known=known)

    def at_other_heights(lines: Lines) -> Sequence[TextLine]:
        return [move_line(lines[0].line, 0.0, size) for size in SIZES]

    resize = Try(at_other_heights, limits.settled, Start.BEST_LINE, is_doubtful, repeats=2)
    return (
        Try(
            on_its_ink, limits.settled, Start.FIRST_LINES, is_doubtful,
            repeats=limits.most_refits, gain_nats=_much_of_doubt,
        ),
        # without a format the length is unknown, so another word may follow after a gap
        Try(
            lambda lines: longer(lines[0].line), math.inf, Start.BEST_LINE,
            lambda lines: request.grammar is None and is_convincing(lines, limits.sure), replaces_next=True,
        ),
        Try(lambda lines: variants(lines[0].line), limits.sure, Start.FIRST_LINES),
        *((resize,) if view.kind is ViewKind.PHOTO and not known else ()),
        Try(_longer_at_ends, math.inf, Start.BEST_LINE, repeats=3),
    )  # fmt: skip


def with_sags(request: LineRequest, line: TextLine) -> Try:
    """Bend a line, if the best one is doubtful."""
    gain = request.limits.chance_gain
    bends = [bend(line, sag) for sag in SAGS]
    return Try(lambda _: bends, request.limits.sure, Start.BEST_LINE, gain_nats=lambda _: gain)


def straight_and_bent(candidates: Sequence[FoundLine]) -> list[TextLine]:
    """The positions of found lines, straight and as arcs."""
    return [line for each in candidates for line in (each.line, each.bent) if line is not None]


def _faint(view: View, request: LineRequest) -> list[TextLine]:
    faint = find_lines(view, height_mm=request.height_mm, faint=True)[: request.limits.most_lines]
    return [*(candidate.line for candidate in faint), *anywhere(view, height_mm=request.height_mm)]


def _in_tiles(
    view: View, request: LineRequest, *, fine: bool, most_small: int = 16, most_reversed: int = 4
) -> list[TextLine]:
    # most_small: number of small lines that are read; many of those found are only edges of a machine. In 24
    # cluttered frames the serial was among the first ten, and if it was read, among the first four
    # most_reversed: number of these that are also read upside down
    small = find_in_tiles(about_region(request.region, view), height_mm=request.height_mm, fine=fine)
    lines = [candidate.line for candidate in small[:most_small]]
    return [*lines, *(line.reversed for line in lines[:most_reversed])]


def _slants_deg(
    view: View, *, slants_deg: Sequence[float] = (30.0, -30.0, 60.0, -60.0), slanted_sides: float = 2.5
) -> Sequence[float]:
    # slanted_sides: ratio of the view's sides from which there is no room for a slanted line
    short, long = sorted(view.size_mm)
    return slants_deg if long < slanted_sides * short else ()


def _in_directions(view: View, request: LineRequest, turns_deg: Sequence[float]) -> list[TextLine]:
    turned = [c for turn in turns_deg for c in find_lines(view, height_mm=request.height_mm, turned_deg=turn)]
    best = sorted(turned, key=lambda candidate: -candidate.score)[: request.limits.most_turned]
    lines = [*straight_and_bent(best[:1]), *(candidate.line for candidate in best[1:])]
    return [*lines, *(line.reversed for line in lines)]


def _much_of_doubt(read: ReadLine, *, share: float = 0.3) -> float:
    return share * (read.lattice.n_places - promise_of(read))


def _longer_at_ends(lines: Lines, *, end_heights: float = 0.55) -> list[TextLine]:
    """Lengthen a line where a character lies at its end: others may follow beyond.

    Args:
        end_heights: distance from a strip's end within which a character may have a neighbour beyond it, character
            heights.
    """
    line, columns = lines[0].line, lines[0].columns
    near = (end_heights + MARGIN) * HEIGHT_ROWS
    first, last = bool((columns[:1] < near).any()), bool((columns[-1:] > line.columns() - near).any())
    return [lengthen(line, first * far, last * far) for far in GROWTHS] if first or last else []
