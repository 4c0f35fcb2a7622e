"""Follow the line that is being scanned; a look reads it at its last position and one variant, so no stage waits."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

from glyphs.surface.display import OneLine
from recognition.find.find import apart, search_of
from recognition.find.line_variants import variants
from recognition.find.promise import is_convincing
from recognition.find.request import LineRequest
from recognition.language.constrained_decoding import Choice, choose
from recognition.recogniser.read_line import ReadLine
from recognition.see.text_line import TextLine
from recognition.see.view import View


@dataclass(frozen=True, eq=False, repr=False)
class Look(OneLine):
    """The best line and text after a step; with few scan lines, the text of `others` may not show yet."""

    read: ReadLine
    choice: Choice
    others: bool = False

    @property
    def text(self) -> str:
        return self.choice.text

    @property
    def confidence(self) -> float:
        return self.choice.probability * self.read.count_probability


class LineWatch:
    """Tracker of one line while it is felt."""

    def __init__(self, request: LineRequest, *, line: TextLine | None = None) -> None:
        self.request, self.line = request, line
        self.is_sure, self._others = line is not None, False
        self._looks = count()

    def follow(self, line: TextLine | None, *, confidence: float, least: float = 0.05) -> None:
        """Continue with the line of a full reading from a confidence of `least`: it is then seldom a wrong one."""
        if line is not None and confidence > least:
            self.line, self.is_sure = line, True

    def look(self, view: View, *, most_found: int = 3) -> Look | None:
        search = search_of(view, self.request)
        known = [] if self.line is None else [self.line]
        if self.is_sure:
            tried = variants(known[0])
            near = [*known, tried[next(self._looks) % len(tried)]]  # one variant, in turns
        else:
            near = [*known, *search.candidates()[:most_found]]
        seen = search.read(near)
        if not seen:
            return None
        if not self.is_sure:
            self._others = any(apart(line, seen[0]) for line in seen[1:])
        self.line, self.is_sure = seen[0].line, is_convincing(seen, self.request.limits.sure)
        choice = choose(seen[0].lattice, self.request.grammar)
        return Look(seen[0], choice, self._others) if choice.text else None
