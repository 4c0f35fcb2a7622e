"""The table of tries: what each way to look for a line gains, what it costs, and when it pays no more.

A try proposes lines, most promising first, which are looked at a few at a time. Its gain is the number of characters
that become right with the first few of them, by the promise of the best line so far; its cost is processor time. The
next few gain `FADES` times as much. `SearchLimits.least_gain_per_ms` is the price below which nothing is tried.

A log of searches without a price gives gains and costs (its table: `tests/benchmarks/search_log.txt`, 66 parts)::

    python tests/benchmarks/search_log.py FONTS OTHER_GENERATORS --out searches.csv

So few parts fill few bands: gains here are rounded, smoothed between neighbours, and chosen by hand where hardly any
search was logged. None of those parts lay turned and few lines were small, so the gains of "vertical", "slanted",
"reversed", "small" and "smallest" are chosen as well. The cost of "smallest" is that of a photograph, in which it
looks only at tiles that are like text.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Protocol, TypeAlias

from recognition.find.finder import Finder, FoundLine
from recognition.find.ink import on_ink
from recognition.find.line_variants import (
    CROPS,
    SAGS,
    across,
    anywhere,
    bend,
    lengthen,
    longer,
    move_line,
)
from recognition.find.request import LineRequest
from recognition.find.tiles import find_in_tiles
from recognition.recogniser.read_line import ReadLine
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import View, ViewKind

BANDS = (-1.0, -0.5, 0.0, 0.4, 0.7, 0.9, 0.9975)
"""Shares of the greatest promise between which gains are counted."""
FADES = 0.5
"""Ratio of the gains of the next few lines of a try and of those before."""
LOOK_MS = 9.0
"""Processor time of a look at a usual line, ms."""


class Searched(Protocol):
    """What a search knows before it reads."""

    @property
    def request(self) -> LineRequest:
        """What is looked for."""

    @property
    def view(self) -> View:
        """The view that is searched."""

    @property
    def finder(self) -> Finder:
        """Finds lines of the view."""

    @property
    def finder_lines(self) -> Sequence[FoundLine]:
        """The finder's lines, most promising first."""

    def turned_candidates(self, *turns_deg: float) -> list[TextLine]:
        """Propose lines turned by about these angles."""


Gains: TypeAlias = tuple[float, ...]
Propose: TypeAlias = Callable[[Searched, Sequence[ReadLine]], Sequence[TextLine]]


@dataclass(frozen=True)
class Try:
    """A way to look for a line."""

    name: str
    propose: Propose  # lines to look at, from all lines so far, most promising first
    _: KW_ONLY
    felt: Gains  # characters that become right on a scan and in a photograph, for each of the `BANDS`
    seen: Gains
    ms: float = 0.0
    few: int = 2
    refines: bool = False
    # least promise by which a refined line must exceed the best one: of two readings the wrong one is often a
    # little more promising by chance, and so is a longer line
    nats: float = 0.0

    def gain_per_ms(self, kind: ViewKind, share: float, *, times: int) -> float:
        """Expected gain for each ms after some times, of a line with this share of the greatest promise."""
        gains = self.seen if kind is ViewKind.PHOTO else self.felt
        cost_ms = self.few * LOOK_MS + (0.0 if times else self.ms)
        return gains[bisect_right(BANDS, share)] * FADES**times / cost_ms


def _further(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    first = [line for each in search.finder_lines[:2] for line in (each.line, each.bent) if line is not None]
    return [*first, *(each.line for each in search.finder_lines[2:])]


def _faint(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return [each.line for each in search.finder.lines(faint=True)]


def _blind(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return anywhere(search.view, height_mm=search.request.height_mm)


def _whole_view(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return [] if search.request.height_mm is not None else across(search.view, CROPS)


def _reversed(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return [lines[0].line.reversed] if lines else []


def _small(search: Searched, lines: Sequence[ReadLine], *, fine: bool = False) -> list[TextLine]:
    height_mm = search.request.height_mm
    return [each.line for each in find_in_tiles(search.view, height_mm=height_mm, fine=fine)]


def _smallest(search: Searched, lines: Sequence[ReadLine], *, clear_heights: float = 1.2) -> list[TextLine]:
    # clear_heights: finder's score from which a line is not clutter. On 24 cluttered frames the clutter reached 1.1
    clear = bool(search.finder_lines) and search.finder_lines[0].score >= clear_heights
    # a known height is one scale, which the larger tiles have searched
    return [] if clear or search.request.height_mm is not None else _small(search, lines, fine=True)


def _vertical(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return [way for line in search.turned_candidates(90.0) for way in (line, line.reversed)]


def _slanted(search: Searched, lines: Sequence[ReadLine], *, slanted_sides: float = 2.5) -> list[TextLine]:
    # slanted_sides: ratio of the view's sides from which there is no room for a slanted line
    short, long = sorted(search.view.size_mm)
    turns_deg = (30.0, -30.0, 60.0, -60.0) if long < slanted_sides * short else ()
    return [way for line in search.turned_candidates(*turns_deg) for way in (line, line.reversed)]


def _on_ink(search: Searched, lines: Sequence[ReadLine]) -> Sequence[TextLine]:
    known = search.request.height_mm is not None
    return on_ink(search.view, lines[0].line, lines[0].columns, height_known=known)


def _resized(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    sizes = () if search.request.height_mm is not None else (0.83, 1.2)
    return [move_line(lines[0].line, 0.0, size) for size in sizes]


def _moved(*moves: tuple[float, float, float]) -> Propose:
    return lambda _, lines: [move_line(lines[0].line, *move) for move in moves]


def _bent(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return [bend(lines[0].line, sag) for sag in SAGS]


def _longer(search: Searched, lines: Sequence[ReadLine]) -> list[TextLine]:
    return longer(lines[0].line)


def _next_word(search: Searched, lines: Sequence[ReadLine], *, add_heights: float = 3.0) -> list[TextLine]:
    if search.request.grammar is not None:
        return []
    return [lengthen(lines[0].line, *ends) for ends in ((add_heights, 0.0), (0.0, add_heights))]


def _longer_at_ends(
    search: Searched, lines: Sequence[ReadLine], *, end_heights: float = 0.55, add_heights: float = 2.2
) -> list[TextLine]:
    line, columns = lines[0].line, lines[0].columns
    near = (end_heights + MARGIN) * HEIGHT_ROWS
    first, last = bool((columns[:1] < near).any()), bool((columns[-1:] > line.columns() - near).any())
    return [lengthen(line, first * add_heights, last * add_heights)] if first or last else []


TRIES = (
    Try("further", _further,
        felt=(3.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.0, 0.0), seen=(0.8, 0.8, 0.8, 0.5, 0.2, 0.1, 0.0, 0.0)),
    Try("faint", _faint, ms=12.0,
        felt=(1.0, 1.0, 0.5, 0.3, 0.1, 0.05, 0.0, 0.0), seen=(0.7, 0.6, 0.5, 0.3, 0.1, 0.05, 0.0, 0.0)),
    Try("blind", _blind,
        felt=(0.7, 0.5, 0.3, 0.1, 0.0, 0.0, 0.0, 0.0), seen=(0.3, 0.3, 0.2, 0.1, 0.0, 0.0, 0.0, 0.0)),
    Try("whole view", _whole_view,
        felt=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0), seen=(0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)),
    Try("small", _small, ms=30.0, few=3,
        felt=(0.2, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0), seen=(0.7, 0.5, 0.5, 0.3, 0.0, 0.0, 0.0, 0.0)),
    Try("smallest", _smallest, ms=40.0, few=3,
        felt=(0.2, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0), seen=(1.2, 1.1, 0.8, 0.3, 0.0, 0.0, 0.0, 0.0)),
    Try("vertical", _vertical, ms=12.0,
        felt=(0.4, 0.4, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0), seen=(0.4, 0.4, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0)),
    Try("slanted", _slanted, ms=40.0,
        felt=(0.7, 0.7, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0), seen=(0.7, 0.7, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0)),
    Try("reversed", _reversed, few=1, refines=True,
        felt=(0.3, 0.3, 0.3, 0.2, 0.03, 0.0, 0.0, 0.0), seen=(0.3, 0.3, 0.3, 0.2, 0.03, 0.0, 0.0, 0.0)),
    Try("resized", _resized, refines=True, nats=0.2,
        felt=(0.0, 0.2, 0.3, 0.3, 0.3, 0.3, 0.05, 0.0), seen=(0.2, 0.3, 0.4, 0.3, 0.3, 0.3, 0.07, 0.0)),
    Try("on ink", _on_ink, refines=True, nats=0.2,
        felt=(0.1, 0.2, 0.3, 0.3, 0.2, 0.1, 0.05, 0.0), seen=(0.1, 0.2, 0.3, 0.3, 0.2, 0.1, 0.05, 0.0)),
    Try("shifted", _moved((0.2, 1.0, 0.0), (-0.2, 1.0, 0.0)), refines=True, nats=0.2,
        felt=(0.0, 0.1, 0.2, 0.2, 0.2, 0.2, 0.04, 0.0), seen=(0.0, 0.05, 0.05, 0.05, 0.05, 0.05, 0.0, 0.0)),
    Try("turned", _moved((0.0, 1.0, 5.0), (0.0, 1.0, -5.0)), refines=True, nats=0.2,
        felt=(0.0, 0.05, 0.05, 0.05, 0.05, 0.0, 0.0, 0.0), seen=(0.0, 0.05, 0.05, 0.05, 0.05, 0.0, 0.0, 0.0)),
    Try("bent", _bent, few=4, refines=True, nats=1.0,
        felt=(0.0, 0.1, 0.1, 0.1, 0.05, 0.0, 0.0, 0.0), seen=(0.0, 0.1, 0.2, 0.2, 0.05, 0.0, 0.0, 0.0)),
    Try("longer", _longer, refines=True, nats=0.5,
        felt=(0.0, 0.1, 0.2, 0.2, 0.1, 0.05, 0.0, 0.0), seen=(0.0, 0.1, 0.2, 0.2, 0.1, 0.05, 0.0, 0.0)),
    # without a format the length is unknown, so another word may follow after a gap
    Try("words", _next_word, refines=True, nats=0.5,
        felt=8 * (0.2,), seen=8 * (0.2,)),
    Try("at its ends", _longer_at_ends, few=1, refines=True, nats=0.5,
        felt=8 * (0.5,), seen=8 * (0.5,)),
)  # fmt: skip
