"""Line search: find candidate lines, run the recogniser once along each, and refine the best.

view --find_lines--> lines --read once each--> most promising first --moved, lengthened--> best line
                       ^--none convincing: upside down, fainter, slanted, smaller--/
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from glyphs.fonts.glyph import Font
from glyphs.fonts.serials import SIGNS
from recognition.combine.read_line import ReadLine, combine_looks
from recognition.experts.recogniser import WIDER, steps_of, wider_for, wider_of
from recognition.experts.steps import Steps
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.lines.find import FoundLine, find_lines, overlap
from recognition.lines.ink import on_ink
from recognition.lines.moves import (
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
from recognition.lines.tiles import find_in_tiles
from recognition.search.part_lines import Region, about_region, stands_in
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import Layers, View, ViewKind

Try: TypeAlias = tuple[Callable[[], list[TextLine]], float]
"""A function that proposes lines, and the share of the greatest promise from which it is not called."""
Move: TypeAlias = tuple[float, float, int]
"""Shift down, character heights; factor of the height; columns skipped at the start."""
UPSIDE_DOWN_DEG = 105.0
"""Rotation from level beyond which a line is upside down. One that runs about straight up or down is not."""


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """Limits of a line search: number of lines, their moves, and the promise at which it stops.

    Attributes:
        most_lines: lines that are read, most promising first.
        most_turned: lines that are also read upside down, or running down or up.
        most_moved: lines that are moved and lengthened if they are not convincing.
        slants_deg: angles at which slanted lines are searched.
        plain: share of the greatest promise from which the whole view and upside-down lines are not searched.
        sure: share of the greatest promise from which a line is convincing, and fainter lines are not searched.
        some: share of the greatest promise from which rotated and small lines are not searched.
        settled: share of the greatest promise above which a line is not refitted to its ink.
        hopeless: promise per place below which a line is not refined. Of 90 photographs of the calibration design 39
            searches ended below it; refining gave one of these a text, which was wrong.
        clear_heights: finder's score from which a line is not clutter, and much smaller ones are not searched. On 24
            cluttered frames the clutter reached 1.1.
        most_refits: most refits of a line to its ink.
        refit_gain: least share of a line's doubt that a refit must remove.
        most_resized: greatest number of times that a doubtful line of a photograph is resized.
        growths: character heights by which a line is lengthened if a character lies at its end.
        most_growths: greatest number of times that a line is lengthened.
        chance_gain: least promise that a line must gain by being bent or read at another width, nats: of two readings
            the wrong one is often a little more promising by chance.
        rewidened: ratio of the usual and the fitting width of a strip from which a doubtful line is read at both.
        narrowest: advance below which a line probably crosses its characters; the narrowest of 494 faces has 0.38.
    """

    most_lines: int = 6
    most_turned: int = 3
    most_moved: int = 2
    slants_deg: tuple[float, ...] = (30.0, -30.0, 60.0, -60.0)
    plain: float = 0.9
    sure: float = 0.7
    some: float = 0.4
    settled: float = 0.9975
    hopeless: float = -1.0
    clear_heights: float = 1.2
    most_refits: int = 3
    refit_gain: float = 0.3
    most_resized: int = 2
    growths: tuple[float, ...] = (1.0, 2.2)
    most_growths: int = 3
    chance_gain: float = 1.0
    rewidened: float = 1.3
    narrowest: float = 0.32


@dataclass(frozen=True)
class LineSearch:
    """Search for lines in views, by the format and the characters that may occur.

    Attributes:
        grammar: format of the serial's line.
        chars: characters to search for.
        height_mm: height of the characters, if known.
        region: region that holds the middle of the serial's line (default: the whole view).
        orientation: possible orientations of the parts.
        limits: limits of the search.
    """

    grammar: Grammar | None
    chars: str
    height_mm: float | None = None
    region: Region | None = None
    orientation: Orientation = Orientation.ANY
    limits: SearchLimits = SearchLimits()

    @property
    def rare(self) -> str:
        """Signs that are rare on parts; none if there is a format."""
        return SIGNS if self.grammar is None else ""

    def chars_of(self, font: Font) -> str:
        """Characters to search for that a font has."""
        return "".join(c for c in self.chars if c in font.glyphs)

    def heights_mm(self, view: View) -> list[float]:
        """Estimate the character heights at which a scan of the part is worth its time, most promising first."""
        return of_other_scales(one.line.height_mm for one in self.lines(view))

    def lines(self, view: View) -> list[ReadLine]:
        """Read the lines of a view, most promising first; small lines that are only a guess come last.

        If the usual lines are not convincing, other searches follow. The table counts which search gave the best line
        of 680 parts of the calibration design (the first pass counts as well):

            usual   faint   whole view   small   slanted   upside down   running down
        felt       617     213      17           3       1         0             0
        photograph 341     307      10          39       2         2             0

        No line of these parts runs down, and few are upside down.
        """
        found = self._usual(view)
        seen = self.read_once(view, _straight_and_bent(found[:1]))
        if self.grammar is not None and is_convincing(self.in_region(view, seen), self.limits.plain):
            # reading the same ink in another way adds nothing, but the part may have other lines. Without a format
            # the length of the line is unknown
            rest = _other_text(found, seen[0].line)
            return rank([*seen, *self.read_once(view, rest)])
        # the two best lines are also read as arcs
        others = [*_straight_and_bent(found[1:2]), *(one.line for one in found[2:])]
        seen = rank([*seen, *self.read_once(view, others)])
        limits, known = self.limits, self.height_mm is not None
        tries: list[Try] = [
            (lambda: [] if known else whole_view(view), limits.plain),
            (lambda: [one.line.reversed for one in seen[: limits.most_turned]], limits.plain),
            (lambda: self._faint(view), limits.sure),
            (lambda: self._in_directions(view, (90.0,)), limits.some),
            (lambda: self._in_directions(view, self._slants_deg(view)), limits.some),
        ]
        # a line fills much of a scan, but may be small in a photograph
        small: list[Try] = [(lambda: self._in_tiles(view, fine=False), limits.some)]
        # a known height is one scale, which the first of these has searched
        if not known and max((one.score for one in found), default=0.0) < limits.clear_heights:
            # a line may be promising although it is read at twice its height
            small.append((lambda: self._in_tiles(view, fine=True), limits.plain))
        at = 2 if view.kind is ViewKind.PHOTO else len(tries)
        tries[at:at] = small
        guesses: list[ReadLine] = []
        for propose, enough in tries:
            if is_convincing(self.in_region(view, seen), enough):
                break
            looked = self.read_once(view, propose())
            if (propose, enough) in small:
                # the best of many noisy tiles has a high score by chance: without promise it is only a guess
                promising = sum(promise_of(one) > 0.0 for one in looked)
                guesses += looked[promising:]
                looked = looked[:promising]
            seen = rank([*seen, *looked])
        # on a scan, a guess would cause a blank plate to be scanned as finely as small marks
        return [*seen, *guesses] if view.kind is ViewKind.PHOTO else seen

    def candidates(self, view: View) -> list[TextLine]:
        """Propose lines, most promising first, without reading them."""
        return [one.line for one in find_lines(view)]

    def in_region(self, view: View, seen: Sequence[ReadLine]) -> list[ReadLine]:
        """Keep the lines whose middle lies in the serial's region."""
        return [one for one in seen if stands_in(self.region, one.line, view)]

    def _usual(self, view: View) -> list[FoundLine]:
        """Find the lines of the region, then those of the whole view, each most promising first."""
        whole = find_lines(view, height_mm=self.height_mm)[: self.limits.most_lines]
        near = about_region(self.region, view)
        if near is view:
            return whole
        inside = find_lines(near, height_mm=self.height_mm)[: self.limits.most_lines]
        return [*inside, *(one for one in whole if not any(overlap(one.line, o.line) for o in inside))]

    def _faint(self, view: View) -> list[TextLine]:
        found = find_lines(view, height_mm=self.height_mm, faint=True)[: self.limits.most_lines]
        return [*(one.line for one in found), *anywhere(view, height_mm=self.height_mm)]

    def _in_tiles(
        self, view: View, *, fine: bool, most_small: int = 16, most_reversed: int = 4
    ) -> list[TextLine]:
        # most_small: number of small lines that are read; many of those found are only edges of a machine. In 24
        # cluttered frames the serial was among the first ten, and if it was read, among the first four
        # most_reversed: number of these that are also read upside down
        found = find_in_tiles(about_region(self.region, view), height_mm=self.height_mm, fine=fine)
        lines = [one.line for one in found[:most_small]]
        return [*lines, *(line.reversed for line in lines[:most_reversed])]

    def _slants_deg(self, view: View, *, slanted_sides: float = 2.5) -> tuple[float, ...]:
        # slanted_sides: ratio of the view's sides from which there is no room for a slanted line
        short, long = sorted(view.size_mm)
        return self.limits.slants_deg if long < slanted_sides * short else ()

    def _in_directions(self, view: View, turns_deg: Sequence[float]) -> list[TextLine]:
        found = [
            one for turn in turns_deg for one in find_lines(view, height_mm=self.height_mm, turned_deg=turn)
        ]
        best = sorted(found, key=lambda one: -one.score)[: self.limits.most_turned]
        lines = [*_straight_and_bent(best[:1]), *(one.line for one in best[1:])]
        return [*lines, *(line.reversed for line in lines)]

    def read_once(self, view: View, lines: Sequence[TextLine]) -> list[ReadLine]:
        """Read each line; read a doubtful one again at the width of its characters. The most promising comes first."""
        lines = [line for line in lines if _shows_shapes(view, line) and self.may_run(line)]
        read = [self._read_line(view, line) for line in lines]
        return rank([one for one in read if one is not None])

    def _read_line(self, view: View, line: TextLine) -> ReadLine | None:
        strip = view.strip(line)
        read = combine_looks(line, [self._steps(strip)], self.grammar)
        if read is None or read.advance < self.limits.narrowest or is_convincing([read], self.limits.settled):
            return read
        fitting = wider_for(read.advance)
        if max(fitting / WIDER, WIDER / fitting) < self.limits.rewidened:
            return read
        again = combine_looks(line, [self._steps(strip, wider=fitting)], self.grammar)
        return read if again is None or again.promise < read.promise + self.limits.chance_gain else again

    def _read_inside(self, view: View, lines: Sequence[TextLine]) -> list[ReadLine]:
        """Read each line once; drop those that a move has taken out of the region."""
        return self.in_region(view, self.read_once(view, lines))

    def _steps(self, strip: Layers, *, wider: float = WIDER, skip_columns: int = 0) -> Steps:
        return steps_of(strip, chars=self.chars, rare=self.rare, skip_columns=skip_columns, wider=wider)

    def more_looks(self, view: View, read: ReadLine, moves: Sequence[Move]) -> list[Steps]:
        """Run the recogniser again along a line: shifted down, scaled in height, and with its first columns skipped."""
        wider = wider_of(read.looks[0])
        return [
            self._steps(view.strip(move_line(read.line, down, size)), wider=wider, skip_columns=skip)
            for down, size, skip in moves
        ]

    def may_run(self, line: TextLine) -> bool:
        """Whether the parts' orientation allows a line's direction; one that runs up or down is always allowed."""
        return self.orientation is Orientation.ANY or abs(line.turned_deg) < UPSIDE_DOWN_DEG

    def refine(self, view: View, seen: Sequence[ReadLine]) -> ReadLine:
        """Refine the best line: move, lengthen and bend it where that makes it more promising."""
        best = self._settle(view, seen)
        if is_convincing([best], self.limits.sure):
            return best
        bent = self._read_inside(view, [bend(seen[0].line, sag) for sag in SAGS])
        if not bent or promise_of(bent[0]) < promise_of(best) + self.limits.chance_gain:
            return best
        return self._settle(view, bent[:1])

    def _settle(self, view: View, seen: Sequence[ReadLine]) -> ReadLine:
        """Move and lengthen the best line where that makes it more promising."""
        best = seen[0]
        if promise_of(best) < self.limits.hopeless * best.lattice.n_places:
            return best
        for one in seen[: self.limits.most_moved]:
            best = rank([best, self._refit_to_ink(view, one)])[0]
            if is_convincing([best], self.limits.settled):
                break
        if not is_convincing([best], self.limits.sure):
            for one in seen[: self.limits.most_moved]:
                best = rank([best, *self._read_inside(view, variants(one.line))])[0]
                if is_convincing([best], self.limits.sure):
                    break
        elif self.grammar is None:
            # the length is unknown, so another word may follow after a gap
            best = rank([best, *self._read_inside(view, longer(best.line))])[0]
        if self.height_mm is None and view.kind is ViewKind.PHOTO:
            best = self._resize(view, best)
        for _ in range(self.limits.most_growths):
            first, last = _touches_ends(best)
            if not (first or last):
                break
            tried = [lengthen(best.line, first * far, last * far) for far in self.limits.growths]
            looked = self._read_inside(view, tried)
            if not looked or promise_of(looked[0]) <= promise_of(best):
                break
            best = looked[0]
        return best

    def _resize(self, view: View, best: ReadLine) -> ReadLine:
        """Make a doubtful line higher or lower, as long as that makes it more promising."""
        for _ in range(self.limits.most_resized):
            if is_convincing([best], self.limits.settled):
                break
            looked = self._read_inside(view, [move_line(best.line, 0.0, size) for size in SIZES])
            if not looked or promise_of(looked[0]) <= promise_of(best):
                break
            best = looked[0]
        return best

    def _refit_to_ink(self, view: View, one: ReadLine) -> ReadLine:
        """Refit a doubtful line to its ink, if that removes much of the doubt."""
        for _ in range(self.limits.most_refits):
            doubt = one.lattice.n_places - promise_of(one)
            if is_convincing([one], self.limits.settled):
                break
            known = self.height_mm is not None
            looked = self._read_inside(view, on_ink(view, one.line, one.columns, height_known=known))
            if not looked or promise_of(looked[0]) < promise_of(one) + self.limits.refit_gain * doubt:
                break
            one = looked[0]
        return one


def _shows_shapes(
    view: View,
    line: TextLine,
    *,
    most_columns: int = 4000,
    least_pixels: float = 4.0,
    most_sides: float = 1.4,
) -> bool:
    """Whether the characters of a line are large enough to be seen, and the line fits the view.

    Args:
        view: view to be read.
        line: line in the view.
        most_columns: columns of the longest strip, some 200 characters.
        least_pixels: fewest pixels for each character height.
        most_sides: largest ratio of the character height to the view's smaller side.
    """
    least_mm, most_mm = least_pixels * view.pitch_mm, most_sides * min(view.size_mm)
    return line.columns() <= most_columns and least_mm <= line.height_mm <= most_mm


def _other_text(found: Sequence[FoundLine], best: TextLine, *, text_share: float = 0.15) -> list[TextLine]:
    """Lines besides the best one that are probably text: with at least about three characters' share of its score."""
    return [
        one.line
        for one in found[1:]
        if one.score > text_share * found[0].score and not overlap(one.line, best, band_mm=best.height_mm)
    ]


def of_other_scales(heights_mm: Iterable[float], *, ratio: float = 1.2) -> list[float]:
    """Keep the heights that differ from all earlier ones by more than this ratio: each is worth its own scan."""
    kept: list[float] = []
    for one in heights_mm:
        if all(abs(math.log(one / other)) > math.log(ratio) for other in kept):
            kept.append(one)
    return kept


def _straight_and_bent(found: Sequence[FoundLine]) -> list[TextLine]:
    return [line for one in found for line in (one.line, one.bent) if line is not None]


def is_convincing(seen: Sequence[ReadLine], enough: float) -> bool:
    """Whether the first line is convincing: it reaches this share of the greatest promise that its places allow."""
    if not seen:
        return False
    best, places = seen[0], seen[0].lattice.n_places
    return best.promise > enough * places and places > 1


def rank(seen: Sequence[ReadLine]) -> list[ReadLine]:
    """Sort lines, most promising first."""
    return sorted(seen, key=promise_of, reverse=True)


def promise_of(one: ReadLine, *, turned_cost: float = 1.5, bent_cost: float = 0.05) -> float:
    """Line score minus penalties for rotation and for an arc.

    Args:
        turned_cost: nats that a line which is upside down or runs down the plate must gain over a level line.
        bent_cost: nats that an arc must gain over a straight line.
    """
    turned, bent = abs(one.line.turned_deg) > 45.0, len(one.line.centre_mm) > 2
    return one.promise - turned_cost * turned - bent_cost * bent


def _touches_ends(one: ReadLine, *, end_heights: float = 0.55) -> tuple[bool, bool]:
    """Whether a character lies at the strip's start, and whether one lies at its end: others may follow beyond.

    Args:
        one: line as read.
        end_heights: distance from a strip's end within which a character may have a neighbour beyond it, character
            heights.
    """
    columns = one.columns
    if columns.size == 0:
        return False, False
    near = (end_heights + MARGIN) * HEIGHT_ROWS
    return float(columns[0]) < near, float(columns[-1]) > one.line.columns() - near
