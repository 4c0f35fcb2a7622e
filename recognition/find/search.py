"""Search for the lines of a view: the try that gains most for its time comes next, until none is worth its price.

    view --finder--> first line --a full look--> settled: done
                                \\-> tries (recognition.find.tries) --cheap looks--> lines, most promising first

A cheap look sees the line hardly widened; only the line that is decided on is read at full width.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import chain
from typing import Self

from recognition.find.finder import Finder, FoundLine, overlap
from recognition.find.line_variants import is_same_place, move_line
from recognition.find.looks import Looks
from recognition.find.promise import is_convincing, promise_of, rank, share_of
from recognition.find.region import stands_in
from recognition.find.request import LineRequest
from recognition.find.tries import TRIES, Try
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.recogniser.recogniser import CHEAP, WIDER, steps_of, wider_for, wider_of
from recognition.recogniser.steps import Steps
from recognition.see.text_line import TextLine
from recognition.see.view import View, ViewKind

Move = tuple[float, float, int]
"""Shift down, character heights; factor of the height; columns skipped at the start."""
UPSIDE_DOWN_DEG = 105.0
"""Rotation from level beyond which a line is upside down. One that runs about straight up or down is not."""


@dataclass(frozen=True, eq=False)
class Search:
    """Search for lines in a view, after some looks at the part's others."""

    view: View
    request: LineRequest
    looks: Looks = field(default_factory=Looks)

    def on(self, view: View) -> Self:
        return replace(self, view=view)

    def under(self, grammar: Grammar | None) -> Self:
        return replace(self, request=replace(self.request, grammar=grammar))

    @cached_property
    def finder(self) -> Finder:
        return Finder(self.view, self.request.height_mm)

    @cached_property
    def finder_lines(self) -> Sequence[FoundLine]:
        return self.finder.lines()[: self.request.limits.most_lines]

    def candidates(self) -> list[TextLine]:
        """Propose lines, most promising first, without reading them."""
        return [candidate.line for candidate in self.finder_lines]

    def turned_candidates(self, *turns_deg: float) -> list[TextLine]:
        """Propose lines turned by about these angles, clockwise as seen, most promising first."""
        candidates = chain(*map(self.finder.turned, turns_deg))
        return [candidate.line for candidate in sorted(candidates, key=lambda candidate: -candidate.score)]

    def heights_mm(self) -> list[float]:
        """Estimate the character heights at which a scan of the part is worth its time, most promising first."""
        return [read.line.height_mm for read in self.lines()]

    def lines(self, about: Sequence[TextLine] = ()) -> list[ReadLine]:
        """Read the lines of the view, or those at known positions, most promising first."""
        lines = self.read(about[:1] or self.candidates()[:1])
        cheap = not is_convincing(self.in_region(lines), self.request.limits.settled)
        if cheap:
            lines = self.read([read.line for read in lines], cheap=True)
        tries = [row for row in TRIES if row.refines or not about]
        for _, more_lines in self.walk(lines, tries, cheap=cheap):
            lines = more_lines
        if not about and lines:
            about = (lines[0].line, *self._other_text(lines[0].line))
        return rank([*lines, *self.read(about[1:], cheap=True)])

    def walk(
        self, lines: Sequence[ReadLine], tries: Iterable[Try] = TRIES, *, cheap: bool = True
    ) -> Iterator[tuple[Try, list[ReadLine]]]:
        """Try what gains most for its time; yield it with all lines after it, most promising first."""
        limits, lines, known = self.request.limits, list(lines), [read.line for read in lines]
        times, left = Counter[str](), dict[tuple[str, int], list[TextLine]]()
        while True:
            best = self.in_region(lines)[:1]
            share = share_of(best[0]) if best else -1.0
            room = self._room(best[0]) if best else -math.inf
            rows = {
                row: (row.name, id(best[0]) if row.refines else 0)
                for row in tries
                if not row.refines or row.nats <= room
            }
            worth = {
                row: row.gain_per_ms(self.view.kind, share, times=times[row.name])
                for row, key in rows.items()
                if left.get(key, [None])
            }
            row = max(worth, key=lambda row: worth[row], default=None)
            if row is None or worth[row] < limits.least_gain_per_ms:
                return
            if not self.looks.may_look(spared=limits.spared_looks):
                return
            if rows[row] not in left:
                left[rows[row]] = list(row.propose(self, best if row.refines else lines))
            times[row.name] += 1
            new = [line for line in left[rows[row]] if not any(map(partial(is_same_place, line), known))]
            left[rows[row]] = new[row.few :]
            known += new[: row.few]
            like = best[0] if row.refines else None
            seen = self.read(new[: row.few], cheap=cheap, like=like)
            if like is not None:
                seen = [read for read in seen if promise_of(read) > promise_of(like) + row.nats]
            lines = rank([*lines, *seen])
            yield row, lines

    def read(
        self, lines: Iterable[TextLine], *, cheap: bool = False, like: ReadLine | None = None
    ) -> list[ReadLine]:
        """Read each line, and a doubtful one again at the width of its characters or `like`; `cheap` ranks them."""
        wider = (CHEAP if cheap else WIDER) if like is None else wider_of(like.looks[0])
        each = (self._read(line, wider, fit=like is None) for line in lines if self._may_read(line))
        return rank(read for read in each if read is not None)

    def _read(self, line: TextLine, wider: float, *, fit: bool) -> ReadLine | None:
        limits, grammar = self.request.limits, self.request.grammar
        read = combine_looks(line, [self._steps(line, wider=wider)], grammar)
        unfit = read is None or read.advance < limits.narrowest or is_convincing([read], limits.settled)
        hopeless = self.view.kind is ViewKind.PHOTO and read is not None and share_of(read) < limits.hopeless
        if read is None or unfit or hopeless or not fit:
            return read
        fitting = wider_for(read.advance) * wider / WIDER
        if max(fitting / wider, wider / fitting) < limits.rewidened or not self.looks.may_look():
            return read
        again = combine_looks(line, [self._steps(line, wider=fitting)], grammar)
        return read if again is None or again.promise < read.promise + limits.chance_gain else again

    def _room(self, read: ReadLine) -> float:
        """Nats by which another line can be more promising: none exceeds the most places that the format allows."""
        grammar = self.request.grammar
        lengths = None if grammar is None else grammar.lengths()
        return max(lengths) - promise_of(read) if lengths else math.inf

    def _steps(self, line: TextLine, *, wider: float, skip_columns: int = 0) -> Steps:
        return steps_of(
            self.looks.posteriors(self.view, line, wider=wider, skip_columns=skip_columns),
            chars=self.request.chars, rare=self.request.rare, skip_columns=skip_columns, wider=wider,
        )  # fmt: skip

    def more_looks(self, read: ReadLine, moves: Iterable[Move]) -> list[Steps]:
        """Run the recogniser again along a line: shifted down, scaled in height, and with its first columns skipped."""
        wider = wider_of(read.looks[0])
        return [
            self._steps(move_line(read.line, down, size), wider=wider, skip_columns=skip)
            for down, size, skip in moves
            if self.looks.may_look()
        ]

    def in_region(self, lines: Iterable[ReadLine]) -> list[ReadLine]:
        return [read for read in lines if stands_in(self.request.region, read.line, self.view)]

    def may_run(self, line: TextLine) -> bool:
        """Whether the parts' orientation allows a line's direction; one that runs up or down is always allowed."""
        return self.request.orientation is Orientation.ANY or abs(line.turned_deg) < UPSIDE_DOWN_DEG

    def _may_read(
        self, line: TextLine, *, most_columns: int = 4000, least_pixels: float = 4.0, most_sides: float = 1.4
    ) -> bool:
        least_mm, most_mm = least_pixels * self.view.pitch_mm, most_sides * min(self.view.size_mm)
        fits = line.columns() <= most_columns and least_mm <= line.height_mm <= most_mm
        return fits and self.may_run(line) and self.looks.may_look()

    def _other_text(self, best: TextLine, *, text_share: float = 0.15) -> list[TextLine]:
        return [
            candidate.line
            for candidate in self.finder_lines[1:]
            if candidate.score > text_share * self.finder_lines[0].score
            and not overlap(candidate.line, best, band_mm=best.height_mm)
        ]
