"""The line that is being felt: where it lies, and what is believed of it, looked at after every pass.

A look at a line takes a few milliseconds, a full reading some hundred: so that the stage need not wait, the line is
looked at where it was last, and at a few places beside it in turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import cycle

import numpy as np

from glyphs.surface.display import one_line
from recognition.active.active_reading import PlaceBelief
from recognition.belief.line_reader import LineReader, apart
from recognition.belief.line_search import says_much
from recognition.belief.part_lines import ReadLine
from recognition.language.constrained_decoding import Choice, choose
from recognition.lines.moves import LONGER, MOVES, lengthen, move_line
from recognition.lines.places import places_mm
from recognition.views.text_line import TextLine
from recognition.views.view import View

MOST_FOUND = 3
"""Lines of a first view that are looked at."""
FOLLOWED = 0.05
"""Confidence of a reading from which its line is followed: it is seldom another by then."""
BESIDE = 1
"""Places beside the line, in turns, that are looked at after every pass."""


@dataclass(frozen=True, eq=False)
class Look:
    """The best line and text after a step.

    Attributes:
        read: the line and the beliefs of all experts, a look each.
        choice: what the format makes of them.
        others: there may be lines beside it; few lines of samples do not show whether they can be read.
    """

    read: ReadLine
    choice: Choice
    others: bool = False

    __repr__ = one_line

    @property
    def text(self) -> str:
        """The best serial that is allowed."""
        return self.choice.text

    @property
    def confidence(self) -> float:
        """That all of it is right."""
        return self.choice.probability * self.read.belief.likely

    @cached_property
    def doubt_nats(self) -> float:
        """Entropy of the places between the rivals that the format leaves, together."""
        places = np.clip(self.choice.places, 0.0, 1.0)
        rest = np.clip(1.0 - places.sum(axis=1, keepdims=True), 0.0, 1.0)
        shares = np.concatenate([places, rest], axis=1)
        return float(-(shares * np.log(np.maximum(shares, 1e-12))).sum())

    def places(self) -> tuple[PlaceBelief, ...]:
        """Candidates place by place."""
        middles = places_mm(self.read.line, self.read.belief.columns)
        made = []
        for k, char in enumerate(self.choice.text):
            beliefs = self.choice.place(k)
            rival = next((c for c in beliefs if c != char), "")
            x, y = middles[k]
            made.append(PlaceBelief(char, float(beliefs.get(char, 0.0)), rival, (float(x), float(y))))
        return tuple(made)


class LineWatch:
    """Follows one line while it is felt."""

    def __init__(self, lines: LineReader, *, line: TextLine | None = None) -> None:
        """Begin.

        Args:
            lines: knows the format and the experts.
            line: where the line lies, if that is known.
        """
        self.lines, self.line = lines, line
        self._sure, self._others = line is not None, False
        self._beside = cycle(
            [*(partial(_move, by=move) for move in MOVES), *(partial(_grow, by=far) for far in LONGER)]
        )

    @property
    def is_sure(self) -> bool:
        """Whether there is a line that says something."""
        return self._sure

    def follow(self, line: TextLine | None, *, confidence: float) -> None:
        """Go on at the line of a full reading that is surer of it than not.

        Args:
            line: of the reading, if there is one.
            confidence: of it.
        """
        if line is not None and confidence > FOLLOWED:
            self.line, self._sure = line, True

    def look(self, view: View) -> Look | None:
        """Return the best text so far; None where there is no line yet."""
        known = [] if self.line is None else [self.line]
        if self._sure:
            near = [*known, *self._near(known[0])]
        else:
            near = [*known, *self.lines.search.candidates(view)[:MOST_FOUND]]
        seen = self.lines.search.looks(view, near)
        if not seen:
            return None
        if not self._sure:
            self._others = any(apart(one, seen[0]) for one in seen[1:])
        self.line, self._sure = seen[0].line, says_much(seen)
        return self._look_at(seen[0])

    def _look_at(self, read: ReadLine) -> Look | None:
        choice = choose(read.belief.lattice, self.lines.grammar)
        return Look(read, choice, self._others) if choice.text else None

    def _near(self, line: TextLine) -> list[TextLine]:
        return [next(self._beside)(line) for _ in range(BESIDE)]


def _move(line: TextLine, *, by: tuple[float, float, float]) -> TextLine:
    return move_line(line, *by)


def _grow(line: TextLine, *, by: tuple[float, float]) -> TextLine:
    return lengthen(line, *by)
