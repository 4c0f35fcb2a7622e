"""Common code of the ports at the line: calls that may outlast their callers, and error messages."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Any, TypeVar

from glyphs.plain_text import is_hidden
from pipeline.service.tasks import start
from pipeline.service.web.problem import Problem, problem_of

_MOST_WORDS = 200
# time limit of a trigger, s; after it the caller gets an error, and the part is read to its end, but not felt
ANSWER_S = 120.0
T = TypeVar("T")


async def answer_of(call: Awaitable[T], running: set[asyncio.Future[Any]], *, within_s: float) -> T:
    """Wait for a call, which goes on if its caller leaves. Raises Problem: 503, it takes longer."""
    calling = start(call, running)
    calling.add_done_callback(
        lambda done: done.cancelled() or done.exception()
    )  # nobody may wait for it by then
    done, _ = await asyncio.wait({calling}, timeout=within_s)
    if not done:
        raise Problem(503, "no result in time; the part is still being read")
    return calling.result()


def in_words(error: BaseException) -> str:
    """Error message for the caller: one short line without control characters."""
    plain = "".join(" " if is_hidden(char) else char for char in problem_of(error).detail)
    words = " ".join(plain.split())
    return words if len(words) <= _MOST_WORDS else words[: _MOST_WORDS - 3] + "..."
