"""The line that is being scanned: its position and posterior, updated after every pass.

A look at a line takes a few milliseconds, a full reading some hundred: so that the stage need not wait, the line is
looked at where it was last, and at a few places beside it in turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

from glyphs.surface.display import one_line
from recognition.combine.read_line import ReadLine
from recognition.language.constrained_decoding import Choice, choose
from recognition.lines.moves import variants
from recognition.search.line_reader import LineReader, apart
from recognition.search.line_search import is_convincing
from recognition.views.text_line import TextLine
from recognition.views.view import View


@dataclass(frozen=True, eq=False)
class Look:
    """The best line and text after a step.

    Attributes:
        read: the line and the beliefs of all experts, a look each.
        choice: their texts in the format.
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
        """Probability that the whole text is right."""
        return self.choice.probability * self.read.likely


class LineWatch:
    """Follow one line while it is felt.

    Attributes:
        line: the line, as far as it is known.
        is_sure: whether there is a line with text.
    """

    def __init__(self, lines: LineReader, *, line: TextLine | None = None) -> None:
        """Begin.

        Args:
            lines: knows the format and the experts.
            line: where the line lies, if that is known.
        """
        self.lines, self.line = lines, line
        self.is_sure, self._others = line is not None, False
        self._looks = count()

    def follow(self, line: TextLine | None, *, confidence: float, followed: float = 0.05) -> None:
        """Continue with the line of a full reading if its confidence is above 0.5.

        Args:
            line: line of the reading, if there is one.
            confidence: confidence of the reading.
            followed: confidence of a reading from which its line is followed: it is seldom another by then.
        """
        if line is not None and confidence > followed:
            self.line, self.is_sure = line, True

    def look(self, view: View, *, most_found: int = 3) -> Look | None:
        """Return the best text so far; None without a line.

        Args:
            most_found: lines of a first view that are looked at.
        """
        known = [] if self.line is None else [self.line]
        if self.is_sure:
            tried = variants(known[0])
            near = [*known, tried[next(self._looks) % len(tried)]]  # one place beside the line, in turns
        else:
            near = [*known, *self.lines.search.candidates(view)[:most_found]]
        seen = self.lines.search.read_once(view, near)
        if not seen:
            return None
        if not self.is_sure:
            self._others = any(apart(one, seen[0]) for one in seen[1:])
        self.line, self.is_sure = seen[0].line, is_convincing(seen, self.lines.search.limits.sure)
        choice = choose(seen[0].lattice, self.lines.grammar)
        return Look(seen[0], choice, self._others) if choice.text else None
