"""A separate thread for a driver: if the driver hangs, it blocks neither other work nor the end of the service.

    call(work) --> waiting (bounded) --> the driver's thread --> driver
         \\------ timeout_s ------> StageDownError, and `trouble` says so until the driver comes back

* A driver is never called by two threads at once.
* Every call ends within its time: with the driver's answer, its exception, or StageDownError.
* While a call hangs, others are refused at once; when it returns at last, the driver is used again.
* The thread is a daemon: a driver that never returns does not keep the process alive.
"""

from __future__ import annotations

import asyncio
import queue
import threading
import time
from collections.abc import Callable
from concurrent import futures
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, TypeVar

import structlog

from whisker_array.scan.stage_error import StageError

T = TypeVar("T")
MOST_WAITING = 8
log = structlog.get_logger("tactile-marks")


class StageDownError(StageError):
    """The driver does not answer, or is too busy; a later call may succeed."""

    later = True


class DriverThread:
    """Call one driver.

    Attributes:
        what: camera or stage, for messages.
        timeout_s: timeout for one call, with its wait for those before, unless the caller says another.
    """

    def __init__(self, what: str, *, timeout_s: float) -> None:
        self.what, self.timeout_s = what, timeout_s
        self._calls: queue.Queue[_Call] = queue.Queue(MOST_WAITING)
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()
        self._at_work: _Call | None = None

    @property
    def trouble(self) -> str:
        """Current fault of the driver, in words; empty without one."""
        at_work = self._at_work
        if at_work is None or (waited_s := time.monotonic() - at_work.begun_s) < at_work.timeout_s:
            return ""
        return f"the {self.what} has not answered for {waited_s:.0f} s"

    def call(self, work: Callable[[], T], *, timeout_s: float | None = None) -> T:
        """Run work in the driver's thread, and return its result.

        Raises:
            StageError: raised by the driver.
            OSError: raised by the driver.
            StageDownError: the driver does not answer in time, has a fault, or too many calls wait for it already.
        """
        made = self._submit(work, timeout_s)
        futures.wait([made.future], made.timeout_s)
        outcome: T = self._outcome(made.future, made)
        return outcome

    async def call_async(self, work: Callable[[], T], *, timeout_s: float | None = None) -> T:
        """Do the same as `call` in a coroutine."""
        made = self._submit(work, timeout_s)
        answer = asyncio.wrap_future(made.future)
        try:
            await asyncio.wait([answer], timeout=made.timeout_s)
            outcome: T = self._outcome(answer, made)
        finally:
            answer.cancel()  # if its caller is cancelled
        return outcome

    def _submit(self, work: Callable[[], Any], timeout_s: float | None) -> _Call:
        if self.trouble:
            raise self._down(self.trouble)
        made = _Call(work, self.timeout_s if timeout_s is None else timeout_s)
        with self._starting:
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self.what, daemon=True)
                self._thread.start()
        try:
            self._calls.put_nowait(made)
        except queue.Full:
            raise self._down(f"{MOST_WAITING} others wait for the {self.what}") from None
        return made

    def _outcome(self, answer: Future[Any] | asyncio.Future[Any], made: _Call) -> Any:
        if answer.done():
            return answer.result()
        answer.cancel()
        raise self._down(f"the {self.what} has not answered in {made.timeout_s:g} s")

    def _run(self) -> None:
        while True:
            made = self._calls.get()
            if not made.future.set_running_or_notify_cancel():
                continue  # its caller has given up
            made.begun_s = time.monotonic()
            self._at_work = made
            result, failure = None, None
            try:
                result = made.work()
            except (StageError, OSError) as error:
                failure = error
            except BaseException as error:
                log.exception("fault of a driver", driver=self.what)
                fault = f"the {self.what}'s driver has a fault ({type(error).__name__}: {error})"
                failure = StageDownError(fault, "the service's log has more of it")
            self._at_work = None
            if failure is None:
                made.future.set_result(result)
            else:
                made.future.set_exception(failure)

    def _down(self, what: str) -> StageDownError:
        return StageDownError(what, f"see that the {self.what} and its driver work")


@dataclass(eq=False)
class _Call:
    """One call of the driver.

    Attributes:
        work: work to be done.
        timeout_s: time that its caller waits.
        future: its result.
        begun_s: when, by the monotonic clock.
    """

    work: Callable[[], Any]
    timeout_s: float
    future: Future[Any] = field(default_factory=Future)
    begun_s: float = 0.0
