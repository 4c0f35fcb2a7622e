"""Common code of the ports at the line: calls and error messages."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Protocol

from glyphs.plain_text import is_hidden
from pipeline.common.records import PartRecord
from pipeline.service.web.problem import problem_of

_MOST_WORDS = 200
# time limit of a trigger, s; after it the caller gets an error, and the part is read to its end, but not felt
ANSWER_S = 120.0


class LineCalls(Protocol):
    """Calls of controllers; each raises what `problem_of` turns into an answer."""

    def trigger(
        self, name: str, job: str = "", *, expected: str = "", within_s: float = ANSWER_S
    ) -> Awaitable[PartRecord]:
        """Photograph the part with a name, read it by a job (both may be empty), and return it once it is stored."""

    def release(self, part: str, *, within_s: float = ANSWER_S) -> Awaitable[PartRecord]:
        """Have a part felt that lies under the whiskers, by its id or name."""

    def look_up(self, part: str) -> Awaitable[PartRecord]:
        """The part with an id, or the latest of a name, as it stands."""


def in_words(error: BaseException) -> str:
    """Error message for the caller: one short line without control characters."""
    plain = "".join(" " if is_hidden(char) else char for char in problem_of(error).detail)
    words = " ".join(plain.split())
    return words if len(words) <= _MOST_WORDS else words[: _MOST_WORDS - 3] + "..."
