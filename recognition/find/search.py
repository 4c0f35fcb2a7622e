"""Search for a line in a view: try one row of a table after the other until a line is convincing.

    view --find_lines--> lines --a look at each--> most promising first
    lines --proposals of the view: upside down, fainter, slanted, smaller--> more lines
    best line --refinements: to its ink, longer, higher, bent--> a more promising line

The tables are in `recognition.find.tries`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

from recognition.find.finder import FoundLine, find_lines, overlap
from recognition.find.line_variants import move_line
from recognition.find.looks import Looks
from recognition.find.promise import is_convincing, promise_of, rank
from recognition.find.region import about_region, stands_in
from recognition.find.request import LineRequest
from recognition.find.tries import Start, Try, proposals, refinements, straight_and_bent, with_sags
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.recogniser.recogniser import WIDER, steps_of, wider_for, wider_of
from recognition.recogniser.steps import Steps
from recognition.see.text_line import TextLine
from recognition.see.view import View, ViewKind

Move = tuple[float, float, int]
"""Shift down, character heights; factor of the height; columns skipped at the start."""
UPSIDE_DOWN_DEG = 105.0
"""Rotation from level beyond which a line is upside down. One that runs about straight up or down is not."""


@dataclass(frozen=True, eq=False)
class Search:
    """Search for lines in a view.

    Attributes:
        view: view that is searched.
        request: what is looked for.
        looks: looks at the part's views so far.
    """

    view: View
    request: LineRequest
    looks: Looks = field(default_factory=Looks)

    def on(self, view: View) -> Self:
        """The same search in another view of the part."""
        return replace(self, view=view)

    def under(self, grammar: Grammar | None) -> Self:
        """The same search for another format."""
        return replace(self, request=replace(self.request, grammar=grammar))

    @cached_property
    def finder_lines(self) -> Sequence[FoundLine]:
        """The finder's lines in the region, then those in the whole view, each most promising first."""
        request = self.request

        def first_lines(view: View) -> list[FoundLine]:
            return find_lines(view, height_mm=request.height_mm)[: request.limits.most_lines]

        near, whole = about_region(request.region, self.view), first_lines(self.view)
        if near is self.view:
            return whole
        inside = first_lines(near)
        return [*inside, *(f for f in whole if not any(overlap(f.line, other.line) for other in inside))]

    def candidates(self) -> list[TextLine]:
        """Propose lines, most promising first, without reading them."""
        return [candidate.line for candidate in find_lines(self.view)]

    def heights_mm(self) -> list[float]:
        """Estimate the character heights at which a scan of the part is worth its time, most promising first."""
        return [read.line.height_mm for read in self.lines()]

    def lines(self) -> list[ReadLine]:
        """Read the lines of the view, most promising first; small lines that are only a guess come last."""
        lines = self.read(straight_and_bent(self.finder_lines[:1]))
        if self.request.grammar is not None and self._reaches(lines, self.request.limits.plain):
            # reading the same ink in another way adds nothing, but the part may have other lines. Without a format
            # the length of the line is unknown
            return rank([*lines, *self.read(self._other_text(lines[0].line))])
        # the two best lines are also read as arcs
        others = [
            *straight_and_bent(self.finder_lines[1:2]),
            *(candidate.line for candidate in self.finder_lines[2:]),
        ]
        return self.walk(
            proposals(self.view, self.request, self.finder_lines), rank([*lines, *self.read(others)])
        )

    def walk(self, tries: Iterable[Try], lines: Sequence[ReadLine]) -> list[ReadLine]:
        """Try each row of a table, and return all lines, most promising first.

        Args:
            tries: rows of the table.
            lines: lines so far, most promising first.
        """
        first, lines, guesses, rows = lines, list(lines), list[ReadLine](), iter(tries)
        for row in rows:
            for start in _starts(row, first[: self.request.limits.most_refined], lines):
                if self._reaches(lines, row.skip_from) or not self.looks.may_look():
                    break
                if row.start is Start.VIEW:
                    seen = self.read(row.propose(start))
                    promising = [line for line in seen if promise_of(line) > row.least_promise]
                    guesses += seen[len(promising) :]
                    lines = rank([*lines, *promising])
                else:
                    if row.replaces_next and row.applies(start):
                        next(rows)
                    lines = rank([*lines, self._improved(row, start[0])])
        # on a scan, a guess would cause a blank plate to be scanned as finely as small marks
        return [*lines, *guesses] if self.view.kind is ViewKind.PHOTO else lines

    def _improved(self, row: Try, line: ReadLine) -> ReadLine:
        """Change a line as a row proposes, as long as that makes it more promising."""
        for _ in range(row.repeats):
            if not row.applies([line]):
                break
            seen = self.in_region(self.read(row.propose([line])))
            if not seen or promise_of(seen[0]) <= promise_of(line) + row.gain_nats(line):
                break
            line = seen[0]
        return line

    def refine(self, lines: Sequence[ReadLine]) -> ReadLine:
        """Refine the best line: move, lengthen and bend it where that makes it more promising."""
        best = self._settled(lines)
        bent = self.walk([with_sags(self.request, lines[0].line)], [best])[0]
        return best if bent is best else self._settled([bent])

    def _settled(self, lines: Sequence[ReadLine]) -> ReadLine:
        if promise_of(lines[0]) < self.request.limits.hopeless * lines[0].lattice.n_places:
            return lines[0]
        return self.walk(refinements(self.view, self.request), lines)[0]

    def read(self, lines: Iterable[TextLine]) -> list[ReadLine]:
        """Read each line; read a doubtful one again at the width of its characters. The most promising comes first."""
        return rank(
            [read for line in lines if self._may_read(line) and (read := self._read(line)) is not None]
        )

    def _read(self, line: TextLine) -> ReadLine | None:
        limits, grammar = self.request.limits, self.request.grammar
        read = combine_looks(line, [self._steps(line)], grammar)
        if read is None or read.advance < limits.narrowest or is_convincing([read], limits.settled):
            return read
        fitting = wider_for(read.advance)
        if max(fitting / WIDER, WIDER / fitting) < limits.rewidened or not self.looks.may_look():
            return read
        again = combine_looks(line, [self._steps(line, wider=fitting)], grammar)
        return read if again is None or again.promise < read.promise + limits.chance_gain else again

    def _steps(self, line: TextLine, *, wider: float = WIDER, skip_columns: int = 0) -> Steps:
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
        """Keep the lines whose middle lies in the serial's region."""
        return [read for read in lines if stands_in(self.request.region, read.line, self.view)]

    def is_plain(self, line: ReadLine, *, plain_evidence: float = -0.5) -> bool:
        """Whether a line is of the format without doubt.

        Args:
            plain_evidence: log probability of the format above which there is none.
        """
        return is_convincing([line], self.request.limits.plain) and line.evidence > plain_evidence

    def may_run(self, line: TextLine) -> bool:
        """Whether the parts' orientation allows a line's direction; one that runs up or down is always allowed."""
        return self.request.orientation is Orientation.ANY or abs(line.turned_deg) < UPSIDE_DOWN_DEG

    def _may_read(
        self, line: TextLine, *, most_columns: int = 4000, least_pixels: float = 4.0, most_sides: float = 1.4
    ) -> bool:
        """Whether more looks are allowed, and a line's direction and size: it shows its characters and fits the view.

        Args:
            most_columns: columns of the longest strip, some 200 characters.
            least_pixels: fewest pixels for each character height.
            most_sides: largest ratio of the character height to the view's smaller side.
        """
        least_mm, most_mm = least_pixels * self.view.pitch_mm, most_sides * min(self.view.size_mm)
        fits = line.columns() <= most_columns and least_mm <= line.height_mm <= most_mm
        return fits and self.may_run(line) and self.looks.may_look()

    def _reaches(self, lines: Iterable[ReadLine], share: float) -> bool:
        return is_convincing(self.in_region(lines), share)

    def _other_text(self, best: TextLine, *, text_share: float = 0.15) -> list[TextLine]:
        """Lines besides the best one that are probably text: with about three characters' share of its score."""
        return [
            candidate.line
            for candidate in self.finder_lines[1:]
            if candidate.score > text_share * self.finder_lines[0].score
            and not overlap(candidate.line, best, band_mm=best.height_mm)
        ]


def _starts(row: Try, first: Sequence[ReadLine], lines: Sequence[ReadLine]) -> list[Sequence[ReadLine]]:
    """Lines from which a row starts, each time."""
    if row.start is Start.FIRST_LINES:
        return [[line] for line in first]
    return [lines if row.start is Start.VIEW else lines[:1]]
