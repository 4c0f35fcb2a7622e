"""Read the lines of a view: which one is the serial, and the posteriors of each.

    view --LineSearch--> the most promising line --more looks--> ReadLine

The format decides which of several lines is the serial. Other text on the part is kept as unassigned
(`PartLines.others`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import permutations
from types import MappingProxyType

import numpy as np

from recognition.combine.read_line import ReadLine, combine_looks
from recognition.language.grammar import Grammar
from recognition.lines.find import overlap
from recognition.lines.ink import on_ink
from recognition.lines.moves import lengthen
from recognition.search.line_search import UPSIDE_DOWN_DEG, LineSearch, Move, is_convincing, promise_of, rank
from recognition.search.part_lines import LineFormat, PartLines, stands_in
from recognition.views.text_line import TextLine
from recognition.views.view import View


@dataclass(frozen=True)
class LineReader:
    """Reads views.

    Attributes:
        search: line search, with the format and the characters that may occur.
        lines: other lines of the part, by name.
        moves: moves of further readings of a line.
        between: the move of a reading whose steps fall halfway between those of the first.
    """

    search: LineSearch
    lines: Mapping[str, LineFormat] = field(default_factory=dict)
    moves: tuple[Move, ...] = ((0.08, 1.0, 2), (-0.08, 1.0, 5), (0.0, 1.1, 3), (0.0, 0.91, 2))
    between: Move = (0.0, 1.0, 3)

    @property
    def grammar(self) -> Grammar | None:
        """Format of the serial's line."""
        return self.search.grammar

    def under(self, grammar: Grammar | None) -> LineReader:
        """The same reader with another format."""
        return replace(self, search=replace(self.search, grammar=grammar))

    def read(
        self,
        view: View,
        *others: View,
        about: TextLine | None = None,
        twice: bool = False,
    ) -> PartLines:
        """Read the lines of a view.

        Args:
            view: view to be read.
            others: further views of the same part, in its frame, under other lights. They are read if the first one is
                not enough.
            about: position of the line, if known.
            twice: look a second time even if one look is sure: templates need accurate places.
        """
        looked: list[tuple[View, list[ReadLine]]] = []
        for one in (view, *others):
            # if only a later light is sure, that may be chance: then the line is read under all lights
            looked.append(
                (one, self.search.read_once(one, [about]) if about is not None else self.search.lines(one))
            )
            if is_convincing(self.search.in_region(*looked[-1]), self.search.limits.sure):
                break
        views = (view, *others)
        view, seen = max(
            looked, key=lambda each: max(map(promise_of, self.search.in_region(*each)), default=-np.inf)
        )
        dimmer = [one for one in views if one is not view]
        meant = self.search.in_region(view, seen)
        if not meant:
            return PartLines(None)
        look = partial(
            self._look_closely,
            view,
            grammar=self.grammar,
            others=dimmer,
            closely=len(looked) > 1,
            twice=twice,
        )
        first = self._most_promising(view, meant)
        read = [look(line) for line in first]
        if self.grammar is not None and not any(map(self._is_plain, read)):
            for line in (*self._refined_freely(view, meant), *self._laid_anew(view, first[0], read[0])):
                read.append(look(line))
                if self._is_plain(read[-1]):
                    break
        main = max(read, key=promise_of)
        rest = [one for one in seen if apart(one, main)]
        named: dict[str, ReadLine] = {}
        for name, asked in self.lines.items():
            found = self._line_named(view, rest, asked)
            if found is not None:
                named[name] = found
                rest = [one for one in rest if apart(one, found)]
        unassigned: list[ReadLine] = []
        for line in rest:
            if _is_clear_text(line) and all(apart(line, other) for other in unassigned):
                unassigned.append(line)
        return PartLines(main, MappingProxyType(named), tuple(unassigned), _candidates(view, meant))

    def _line_named(
        self, view: View, rest: Sequence[ReadLine], asked: LineFormat, *, asked_evidence: float = -4.0
    ) -> ReadLine | None:
        """Line that matches a format and region; None if none does.

        Args:
            asked_evidence: log probability of the format above which a line is the requested one.
        """
        fits = [
            read
            for one in rest
            if stands_in(asked.region, one.line, view)
            and (read := combine_looks(one.line, one.looks, asked.grammar)) is not None
        ]
        if not fits:
            return None
        best = self._look_closely(view, max(fits, key=promise_of), asked.grammar)
        return best if best.evidence > asked_evidence else None

    def _most_promising(
        self, view: View, candidates: Sequence[ReadLine], *, most_lines: int = 3, chance_nats: float = 1.0
    ) -> list[ReadLine]:
        """The most promising line, and under a format others that are as promising by chance, each refined.

        Args:
            view: view of the part.
            candidates: lines in the serial's region, most promising first.
            most_lines: most lines that are compared.
            chance_nats: difference in promise that a closer look may turn round.
        """
        lines = [self._right_way_up(view, self.search.refine(view, candidates))]
        for line in candidates if self.grammar is not None else ():
            near = promise_of(line) > promise_of(candidates[0]) - chance_nats
            if near and len(lines) < most_lines and all(apart(line, other) for other in lines):
                lines.append(self._right_way_up(view, self.search.refine(view, [line])))
        return lines

    def _refined_freely(
        self, view: View, candidates: Sequence[ReadLine], *, most_lines: int = 3
    ) -> list[ReadLine]:
        """Lines that are text without the format: refined without it, and read under it.

        The finder may see half of a serial at twice its height. The format fits that nowhere, but without it the line
        is text, and grows to the whole serial.
        """
        search = replace(self.search, grammar=None)
        freely = (combine_looks(line.line, line.looks, None) for line in candidates)
        texts: list[ReadLine] = []
        for line in rank([line for line in freely if line is not None]):
            clear = is_convincing([line], search.limits.some) and len(texts) < most_lines
            if clear and all(apart(line, text) for text in texts):
                texts.append(line)
        return self.search.read_once(view, [search.refine(view, [text]).line for text in texts])

    def _laid_anew(
        self,
        view: View,
        first: ReadLine,
        closely: ReadLine,
        *,
        chance_nats: float = 1.0,
        ends_heights: float = 0.5,
    ) -> list[ReadLine]:
        """The line refitted to its ink and lengthened, if a closer look doubts it; only where that is without doubt.

        Args:
            view: view of the part.
            first: the line at the first look.
            closely: the same at several looks.
            chance_nats: difference in promise that counts as chance.
            ends_heights: length that is added at both ends, character heights.
        """
        if promise_of(closely) > promise_of(first) - chance_nats:
            return []
        known = self.search.height_mm is not None
        lines = on_ink(view, first.line, first.columns, height_known=known)
        longer = [lengthen(line, ends_heights, ends_heights) for line in (first.line, *lines)]
        return [line for line in self.search.read_once(view, [*lines, *longer]) if self._is_plain(line)]

    def _is_plain(self, line: ReadLine, *, plain_evidence: float = -0.5) -> bool:
        """Whether a line is of the format without doubt.

        Args:
            plain_evidence: log probability of the format above which there is none.
        """
        return is_convincing([line], self.search.limits.plain) and line.evidence > plain_evidence

    def _right_way_up(self, view: View, best: ReadLine) -> ReadLine:
        """The line in the direction that is more promising; unchanged if there is no doubt."""
        if self._is_plain(best) and abs(best.line.turned_deg) < UPSIDE_DOWN_DEG:
            return best
        return max((best, *self.search.read_once(view, [best.line.reversed])), key=promise_of)

    def _look_closely(
        self,
        view: View,
        best: ReadLine,
        grammar: Grammar | None,
        *,
        others: Sequence[View] = (),
        closely: bool = False,
        twice: bool = False,
    ) -> ReadLine:
        """Read a line again under its grammar: from one look if that is sure, otherwise from several.

        With `closely`, always from several; with `twice`, always from at least two.
        """
        looks = list(best.looks)
        if closely or not is_agreed(best):
            looks += self.search.more_looks(view, best, (self.between, *self.moves))
            for number, other in enumerate(others, start=1):
                # under another light, look first without a move
                more = self.search.more_looks(other, best, ((0.0, 1.0, 0), *self.moves))
                looks += [replace(one, view=number) for one in more]
        elif twice:
            looks += self.search.more_looks(view, best, (self.between,))
        else:
            return best
        return combine_looks(best.line, looks, grammar) or best


def _candidates(
    view: View, meant: Sequence[ReadLine], *, most_candidates: int = 4, most_across: float = 0.9
) -> tuple[TextLine, ...]:
    """The first few lines that do not overlap, without those across the whole view.

    Args:
        view: view of the part.
        meant: lines that may be the serial's, most promising first.
        most_candidates: most lines.
        most_across: greatest length of a line, as a share of the view's width.
    """
    kept: list[ReadLine] = []
    for one in meant:
        across = one.line.length_mm > most_across * view.size_mm[0]
        if not across and len(kept) < most_candidates and all(apart(one, other) for other in kept):
            kept.append(one)
    return tuple(one.line for one in kept)


def apart(one: ReadLine, other: ReadLine, *, room: float = 0.45) -> bool:
    """Whether two lines are different ink: there is room for the characters of both, one line above the other.

    Args:
        room: distance of two lines' middles, as a share of both heights, below which they are the same ink.
    """
    band_mm = room * (one.line.height_mm + other.line.height_mm)
    return not any(overlap(a, b, band_mm=band_mm) for a, b in permutations((one.line, other.line)))


def _is_clear_text(one: ReadLine, *, other_belief: float = 0.8, other_places: int = 3) -> bool:
    """Whether a line can be read as any text.

    Args:
        other_belief: least mean probability of the characters.
        other_places: least number of places.
    """
    lattice, _ = one.open_places
    best = np.exp(lattice.log_belief.max(axis=1, initial=-np.inf))
    return lattice.n_places >= other_places and float(best.mean()) > other_belief


def is_agreed(one: ReadLine, *, agreed: float = 0.99, agreed_evidence: float = -1.0) -> bool:
    """Whether all experts are sure of the same text.

    Args:
        one: the line.
        agreed: least probability of the best character at every place.
        agreed_evidence: least log probability of the format.
    """
    texts = {own.text for own in one.by_expert.values()}
    least = float(np.exp(one.lattice.log_belief.max(axis=1)).min())
    return len(texts) == 1 and least > agreed and one.evidence > agreed_evidence
