"""Tasks of the event loop: in the background, endlessly repeated, and ended within a time limit."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection
from typing import Any, TypeVar

import structlog

T = TypeVar("T")
log = structlog.get_logger("tactile-marks")


def start(work: Awaitable[T], running: set[asyncio.Future[Any]]) -> asyncio.Future[T]:
    """Start work, kept among the `running` until it is done: a task without a reference may be garbage-collected."""
    task = asyncio.ensure_future(work)
    running.add(task)
    task.add_done_callback(running.discard)
    return task


async def repeat(what: str, work: Callable[[], Awaitable[object]], *, every_s: float) -> None:
    """Do work again and again; a failure is logged as `what` when it begins or changes, and does not end the loop."""
    failure = ""
    while True:
        try:
            await work()
            failure = ""
        except Exception as error:
            if failure != (failure := repr(error)):
                log.exception(f"{what} failed; trying again")
        await asyncio.sleep(every_s)


async def end_tasks(tasks: Collection[asyncio.Future[Any]], *, grace_s: float = 0.0) -> None:
    """Give tasks time to end by themselves, then cancel them."""
    ending = list(tasks)
    if ending and grace_s:
        await asyncio.wait(ending, timeout=grace_s)
    for task in ending:
        task.cancel()
    await asyncio.gather(*ending, return_exceptions=True)
