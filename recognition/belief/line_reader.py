"""Whatever can be looked at, read: the lines of a view, and what is believed of each.

    view --LineSearch--> the line that says most --more looks, more experts--> LineBelief

The format decides which of several lines is meant. What else can be read on the part is kept, for nobody has claimed
it (`PartLines.others`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from types import MappingProxyType

import numpy as np

from recognition.belief.line_belief import LineBelief, believed, pooled
from recognition.belief.line_search import PLAIN, UPSIDE_DOWN_DEG, LineSearch, promise_of, says_much
from recognition.belief.part_lines import (
    NO_LINES,
    Judge,
    LineFormat,
    PartLines,
    Place,
    ReadLine,
    Region,
    stands_in,
)
from recognition.belief.weights import EXPERTS, weights_of
from recognition.experts import generic, recogniser
from recognition.experts.steps import Steps
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.lines.find import overlap
from recognition.lines.moves import moved
from recognition.views.text_line import TextLine
from recognition.views.view import View

JITTERS: tuple[tuple[float, float], ...] = ((0.08, 1.0), (-0.08, 1.0), (0.0, 1.1), (0.0, 0.91))
"""More looks of our own recogniser at a line: moved down and higher, character heights."""
HERE = (0.0, 1.0)
RIVALS = 2
"""Lines of those seen from which who knows shapes may choose, beside the best."""
MOST_PRINT = 2
"""Looks of the generic one."""
AGREED, AGREED_EVIDENCE = 0.99, -1.0
"""Belief in every place, and log probability of all that the format allows, from which a look each is enough."""
PLAIN_EVIDENCE = -0.5
"""Log probability of all that the format allows, of our own recogniser, from which a line is not heard upside down."""
ASKED_EVIDENCE = -4.0
"""Log probability of all that a format allows, from which a line is the one that was asked for, and no other."""
ROOM = 0.45
"""Of the heights of two lines together, that their middles must lie apart: below, one is the other, seen askew."""
OTHER_BELIEF, OTHER_PLACES = 0.8, 3
"""Mean belief, and places, from which another line on the part is text that nobody has claimed."""


MOST_CANDIDATES, MOST_ACROSS = 4, 0.9
"""Lines that are named to a person where none was read, and share of the view's width that they may take."""


class LineReader:
    """Reads views; knows the format and the characters that may occur."""

    def __init__(
        self,
        grammar: Grammar | None,
        chars: str,
        *,
        height_mm: float | None = None,
        experts: Sequence[str] = (),
        region: Region | None = None,
        lines: Mapping[str, LineFormat] = NO_LINES,
        orientation: Orientation = Orientation.ANY,
    ) -> None:
        """Prepare.

        Args:
            grammar: what the serial's line may be.
            chars: all that is looked for.
            height_mm: of the characters, if known.
            experts: whose belief counts, of those there are; all unless given.
            region: where the middle of the serial's line lies; anywhere unless given.
            lines: others that stand on the part, by name.
            orientation: which way up parts lie.
        """
        self.lines, self.region, self.grammar, self.chars = lines, region, grammar, chars
        self.search = LineSearch(grammar, chars, height_mm=height_mm, region=region, orientation=orientation)
        self.experts = frozenset(experts or EXPERTS)
        self.print_too = "print" in self.experts and generic.is_installed()

    def read(
        self,
        view: View,
        *others: View,
        about: TextLine | None = None,
        judge: Judge | None = None,
        place: Place | None = None,
    ) -> PartLines:
        """The lines of a view.

        Args:
            view: to be read.
            others: further views of the same part, in its frame: other lights. They are looked at where one is not
                enough.
            about: where the line lies, if that is known.
            judge: other experts.
            place: who knows more closely where a line stands that is not surely read.
        """
        looked: list[tuple[View, list[ReadLine]]] = []
        for one in (view, *others):
            # that one of several lights is sure of a text, where the first one was not, is chance: all are heard then
            looked.append(
                (one, self.search.looks(one, [about]) if about is not None else self.search.lines(one))
            )
            if says_much(self.search.meant(*looked[-1])):
                break
        views = (view, *others)
        view, seen = max(
            looked, key=lambda each: max(map(promise_of, self.search.meant(*each)), default=-np.inf)
        )
        dimmer = [one for one in views if one is not view]
        meant = self.search.meant(view, seen)
        if not meant:
            return PartLines(None)
        best = self.search.settled(view, meant) if place is None else meant[0]
        best = self._right_way_up(view, best)
        main = self._believed(
            view,
            best,
            self.grammar,
            others=dimmer,
            closely=len(looked) > 1,
            judge=judge,
            place=place,
            rivals=meant[:RIVALS],
        )
        if main is None and "own" not in self.experts:
            return PartLines(None)  # who was asked has nothing to say
        main = main or best
        rest = [one for one in seen if apart(one, main)]
        named: dict[str, ReadLine] = {}
        for name, asked in self.lines.items():
            found = self._named(view, rest, asked)
            if found is not None:
                named[name] = found
                rest = [one for one in rest if apart(one, found)]
        unclaimed: list[ReadLine] = []
        for line in rest:
            if _is_text(line) and all(apart(line, other) for other in unclaimed):
                unclaimed.append(line)
        return PartLines(main, MappingProxyType(named), tuple(unclaimed), _candidates(view, meant))

    def _named(self, view: View, rest: Sequence[ReadLine], asked: LineFormat) -> ReadLine | None:
        """The line of these that this format and region mean; None where none does."""
        weights = weights_of(view.kind)
        fits = [
            ReadLine(one.line, belief)
            for one in rest
            if stands_in(asked.region, one.line, view)
            and (belief := believed(one.belief.heard, asked.grammar, weights=weights)) is not None
        ]
        if not fits:
            return None
        best = max(fits, key=promise_of)
        best = self._believed(view, best, asked.grammar) or best
        return best if best.belief.evidence > ASKED_EVIDENCE else None

    def _right_way_up(self, view: View, best: ReadLine) -> ReadLine:
        """The line from the end from which all experts together hear more; as it is where it is beyond doubt."""
        plain = says_much([best], PLAIN) and best.belief.evidence > PLAIN_EVIDENCE
        if plain and abs(best.line.turned_deg) < UPSIDE_DOWN_DEG:
            return best
        both = (best, *self.search.looks(view, [best.line.reversed]))
        return max((self.heard(view, one) for one in both), key=promise_of) if len(both) > 1 else best

    def heard(self, view: View, best: ReadLine) -> ReadLine:
        """A line that was looked at, by a look of each expert: quick, for parts that are still being felt."""
        heard, _ = self._first_looks(view, best)
        weights = weights_of(view.kind).among(self.experts & heard.keys())
        belief = believed(heard, self.grammar, weights=weights)
        return best if belief is None else ReadLine(best.line, belief)

    def _first_looks(
        self, view: View, best: ReadLine
    ) -> tuple[dict[str, Sequence[Steps]], list[generic.Picture]]:
        """What every expert hears at a look, and the generic one's pictures."""
        heard, pictures = dict(best.belief.heard), self._pictures(view, best.line)
        if pictures:
            heard["print"] = generic.steps_of(pictures[:1], chars=self.chars, rare=self.search.rare)
        return heard, pictures

    def _believed(
        self,
        view: View,
        best: ReadLine,
        grammar: Grammar | None,
        *,
        others: Sequence[View] = (),
        closely: bool = False,
        judge: Judge | None = None,
        place: Place | None = None,
        rivals: Sequence[ReadLine] = (),
    ) -> ReadLine | None:
        """What all experts believe of a line: of one look each where they are sure of the same, or of several.

        Several looks are taken where `place` has the line, of these and its rivals; where asked for `closely`, always.
        """
        line = best.line
        heard, pictures = self._first_looks(view, best)
        weights = weights_of(view.kind).among(self.experts & heard.keys())
        belief = believed(heard, grammar, weights=weights)
        if belief is None or closely or not agreed(belief):
            moves, first = JITTERS, 1
            near = (
                place(view, [line, *(one.line for one in rivals)], belief or best.belief) if place else None
            )
            if near is not None:
                line, heard, moves, first = near, {"own": [], "print": []}, (HERE, *JITTERS), 0
                pictures = self._pictures(view, line)
            heard["own"] = [*heard["own"], *self._own(view, line, moves)]
            if pictures[first:]:
                heard["print"] = [
                    *heard["print"],
                    *generic.steps_of(pictures[first:], chars=self.chars, rare=self.search.rare),
                ]
            for number, other in enumerate(others, start=1):
                heard["own"] = [*heard["own"], *_of_view(number, self._own(other, line, (HERE, *JITTERS)))]
                if pictures:
                    shown = generic.steps_of(
                        self._pictures(other, line), chars=self.chars, rare=self.search.rare
                    )
                    heard["print"] = [*heard["print"], *_of_view(number, shown)]
            belief = believed(
                {name: looks for name, looks in heard.items() if looks}, grammar, weights=weights
            )
        if belief is None:
            return None
        more = judge(line, belief) if judge is not None else {}
        by_expert = {name: own for name, own in {**belief.by_expert, **more}.items() if name in self.experts}
        if not by_expert:
            return None
        if by_expert.keys() != belief.by_expert.keys():
            belief = replace(belief, lattice=pooled(by_expert, belief.weights), by_expert=by_expert)
        return ReadLine(line, belief)

    def _own(self, view: View, line: TextLine, moves: Sequence[tuple[float, float]]) -> list[Steps]:
        strips = [view.strip(moved(line, down, size)) for down, size in moves]
        return recogniser.steps_of(strips, chars=self.chars, rare=self.search.rare)

    def _pictures(self, view: View, line: TextLine) -> list[generic.Picture]:
        return generic.looks_at(view, line)[:MOST_PRINT] if self.print_too else []


def _of_view(number: int, looks: Sequence[Steps]) -> list[Steps]:
    return [replace(one, view=number) for one in looks]


def _candidates(view: View, meant: Sequence[ReadLine]) -> tuple[TextLine, ...]:
    """Lines that lie apart, as many as a person may want to look at, without those tried across the whole view."""
    kept: list[ReadLine] = []
    for one in meant:
        across = one.line.length_mm > MOST_ACROSS * view.size_mm[0]
        if not across and len(kept) < MOST_CANDIDATES and all(apart(one, other) for other in kept):
            kept.append(one)
    return tuple(one.line for one in kept)


def apart(one: ReadLine, other: ReadLine) -> bool:
    """Whether two lines are different ink: their characters have room above each other."""
    band_mm = ROOM * (one.line.height_mm + other.line.height_mm)
    return not any(overlap(a, b, band_mm=band_mm) for a, b in permutations((one.line, other.line)))


def _is_text(one: ReadLine) -> bool:
    """Whether a line can be read, whatever it says."""
    lattice, _ = one.belief.openly
    best = np.exp(lattice.log_belief.max(axis=1, initial=-np.inf))
    return lattice.n_places >= OTHER_PLACES and float(best.mean()) > OTHER_BELIEF


def agreed(belief: LineBelief) -> bool:
    """Whether all experts are sure of the same text."""
    texts = {tuple(own.log_belief.argmax(axis=1)) for own in belief.by_expert.values()}
    least = float(np.exp(belief.lattice.log_belief.max(axis=1)).min())
    return len(texts) == 1 and least > AGREED and belief.evidence > AGREED_EVIDENCE
