"""Common code of the ports at the line: calls and error messages."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from typing import Protocol, TypeVar

from glyphs.plain_text import is_hidden, visible
from pipeline.common.records import PartRecord
from pipeline.service.web.problem import problem_of

_MOST_WORDS = 200
LOG_EVERY_S = 10.0
"""Seconds between two lines of the log of one kind."""
_MOST_KINDS = 1000
"""Maximum number of kinds that are remembered: callers may invent addresses."""
_log = logging.getLogger(__name__)
T = TypeVar("T")
ANSWER_S = 120.0
"""Time limit of a trigger, s; after it the caller gets an error, and the part is read to its end, but not felt."""


class LineCalls(Protocol):
    """Calls of controllers; each raises what `problem_of` turns into an answer."""

    def trigger(
        self, name: str, job: str = "", *, expected: str = "", within_s: float = ANSWER_S
    ) -> Awaitable[PartRecord]:
        """Photograph the part with a name, read it by a job (both may be empty), and return it once it is stored.

        `expected` is the text that it should read, `within_s` the time that the caller waits, s.
        """

    def release(self, part: str, *, within_s: float = ANSWER_S) -> Awaitable[PartRecord]:
        """Have a part felt that lies under the whiskers, by its id or name."""

    def look_up(self, part: str) -> Awaitable[PartRecord]:
        """The part with an id, or the latest of a name, as it stands."""


class SparingLog(logging.Handler):
    """Log a message of each kind once in a while, without its traceback."""

    def __init__(self, port: str) -> None:
        super().__init__(logging.ERROR)
        self._port = port
        self._last_s: dict[str, float] = {}

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record of a library."""
        error = record.exc_info[1] if record.exc_info else None
        why = f": {type(error).__name__}: {error}" if error is not None else ""
        self.say(f"{record.name}:{record.lineno}", f"{record.getMessage()}{why}")

    def say(self, kind: str, message: str) -> None:
        """Log a message, unless one of its kind was logged just now."""
        now = time.monotonic()
        if now - self._last_s.get(kind, -LOG_EVERY_S) < LOG_EVERY_S:
            return
        if len(self._last_s) >= _MOST_KINDS:
            self._last_s.clear()
        self._last_s[kind] = now
        _log.warning("%s: %s", self._port, visible(message[:300]))


def in_words(error: BaseException) -> str:
    """Error message for the caller: one short line without control characters."""
    plain = "".join(" " if is_hidden(char) else char for char in problem_of(error).detail)
    words = " ".join(plain.split())
    return words if len(words) <= _MOST_WORDS else words[: _MOST_WORDS - 3] + "..."


def one_of_the_busiest(callers: Sequence[T], address: Callable[[T], str]) -> T:
    """The first caller of the address with the most callers; it is dropped to make room."""
    counts = Counter(map(address, callers))
    return max(callers, key=lambda caller: counts[address(caller)])
