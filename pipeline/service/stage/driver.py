"""A driver: called in a thread of its own, and, where it feels pass by pass, linked to the worker that reads the part.

    call(work) --> waiting (bounded) --> the driver's thread --> driver
         \\------ timeout_s ------> StageDownError, and `trouble` says so until the driver comes back

    worker: reader --pass--> LinkedStage <== connection ==> StageLink: the driver's session --> whiskers

A driver is never called by two threads at once, and blocks neither other work nor the end of the service: while a call
hangs, others are refused at once. A worker imports this module, so it imports nothing of the web.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import secrets
import threading
import time
from collections.abc import Callable
from concurrent import futures
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Client, Connection, Listener
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from pipeline.service.stage.devices import ScanOrder
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from whisker_array.scan.session import Fitting, SessionStage, StageSession
    from whisker_array.scan.sweep import Sweep
    from whisker_array.whisker.passes import Pass

T = TypeVar("T")
MOST_WAITING = 8
_LOST = (EOFError, OSError)
# seconds between looks whether the driver's session is closed
_LOOK_S = 0.02
log = structlog.get_logger("tactile-marks")


class StageDownError(StageError):
    """The driver does not answer, or is too busy; a later call may succeed."""

    later = True


class DriverThread:
    """Call one driver, a camera or a stage; `timeout_s` is for one call with its wait for those before."""

    def __init__(self, what: str, *, timeout_s: float) -> None:
        self.what, self.timeout_s = what, timeout_s
        self._calls: queue.Queue[_Call] = queue.Queue(MOST_WAITING)
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()
        self._at_work: _Call | None = None

    @property
    def trouble(self) -> str:
        at_work = self._at_work
        if at_work is None or (waited_s := time.monotonic() - at_work.begun_s) < at_work.timeout_s:
            return ""
        return f"the {self.what} has not answered for {waited_s:.0f} s"

    def call(self, work: Callable[[], T], *, timeout_s: float | None = None) -> T:
        """Run work in the driver's thread. Raises StageDownError: no answer in time, a fault, or a full queue."""
        call = self._submit(work, timeout_s)
        futures.wait([call.future], call.timeout_s)
        outcome: T = self._outcome(call.future, call)
        return outcome

    async def call_async(self, work: Callable[[], T], *, timeout_s: float | None = None) -> T:
        call = self._submit(work, timeout_s)
        answer = asyncio.wrap_future(call.future)
        try:
            await asyncio.wait([answer], timeout=call.timeout_s)
            outcome: T = self._outcome(answer, call)
        finally:
            answer.cancel()  # if its caller is cancelled
        return outcome

    def _submit(self, work: Callable[[], Any], timeout_s: float | None) -> _Call:
        if self.trouble:
            raise self._down(self.trouble)
        call = _Call(work, self.timeout_s if timeout_s is None else timeout_s)
        with self._starting:
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self.what, daemon=True)
                self._thread.start()
        try:
            self._calls.put_nowait(call)
        except queue.Full:
            raise self._down(f"{MOST_WAITING} others wait for the {self.what}") from None
        return call

    def _outcome(self, answer: Future[Any] | asyncio.Future[Any], call: _Call) -> Any:
        if answer.done():
            return answer.result()
        answer.cancel()
        raise self._down(f"the {self.what} has not answered in {call.timeout_s:g} s")

    def _run(self) -> None:
        while True:
            call = self._calls.get()
            if not call.future.set_running_or_notify_cancel():
                continue  # its caller has given up
            call.begun_s = time.monotonic()
            self._at_work = call
            result, failure = None, None
            try:
                result = call.work()
            except (StageError, OSError) as error:
                failure = error
            except BaseException as error:
                log.exception("fault of a driver", driver=self.what)
                fault = f"the {self.what}'s driver has a fault ({type(error).__name__}: {error})"
                failure = StageDownError(fault, "the service's log has more of it")
            self._at_work = None
            if failure is None:
                call.future.set_result(result)
            else:
                call.future.set_exception(failure)

    def _down(self, what: str) -> StageDownError:
        return StageDownError(what, f"see that the {self.what} and its driver work")


@dataclass(eq=False)
class _Call:
    work: Callable[[], Any]
    timeout_s: float
    future: Future[Any] = field(default_factory=Future)
    begun_s: float = 0.0


class LinkedStage:
    """The stage in a worker, with one session; `key` shows the service that its own worker connects."""

    fitting: Fitting
    _connection: Connection

    def __init__(self, address: Any, key: bytes) -> None:
        self.address, self._key = address, key

    def open(self, order: ScanOrder) -> StageSession:
        self._connection = Client(self.address, authkey=self._key)
        try:
            self.fitting = self._answer(order)
        except StageError:
            self.close()
            raise
        return self

    def feel(self, order: Pass) -> Sweep:
        sweep: Sweep = self._answer(order)
        return sweep

    def close(self) -> None:
        self._connection.close()

    def _answer(self, question: Any) -> Any:
        try:
            self._connection.send(question)
            answer = self._connection.recv()
        except _LOST as error:
            raise StageError("the service has released the stage", "scan the part again") from error
        if isinstance(answer, StageError):
            raise answer
        return answer


class StageLink:
    """The service's end: serve one session of a driver to one worker; `down` is a fault that kept it from answering."""

    def __init__(self, stage: SessionStage[ScanOrder], thread: DriverThread) -> None:
        key = secrets.token_bytes(32)
        self._driver = thread
        self.down: StageDownError | None = None
        self._listener = Listener(authkey=key)
        self.stage = LinkedStage(self._listener.address, key)
        self._serving = threading.Thread(target=self._serve, args=(stage,), name="stage-link", daemon=True)
        self._serving.start()

    async def close(self) -> None:
        if self._serving.is_alive():
            # the thread may still wait for a worker that never came; a connection without the key ends that
            with contextlib.suppress(*_LOST):
                Client(self.stage.address).close()
        # not joined: the end of the service need not wait for a driver that hangs
        while self._serving.is_alive():
            await asyncio.sleep(_LOOK_S)

    def _serve(self, stage: SessionStage[ScanOrder]) -> None:
        from multiprocessing import AuthenticationError

        with self._listener:
            try:
                connection = self._listener.accept()
            except (*_LOST, AuthenticationError):
                return
        session = None
        with connection, contextlib.suppress(*_LOST):
            try:
                session = self._answer_question(connection, stage.open, attrgetter("fitting"))
                while session is not None:
                    self._answer_question(connection, session.feel)
            finally:
                if session is not None:
                    with contextlib.suppress(StageError):  # the log has it
                        self._driver.call(session.close)

    def _answer_question(
        self,
        connection: Connection,
        work: Callable[[Any], Any],
        shown: Callable[[Any], Any] = lambda result: result,
    ) -> Any:
        question, result = connection.recv(), None
        try:
            result = self._driver.call(partial(work, question))
            answer = shown(result)
        except StageError as error:
            answer = StageError(error.what, error.hint)
            self.down = error if isinstance(error, StageDownError) else self.down
        except OSError as error:
            answer = StageError(
                f"the stage cannot be used ({error.strerror or error})", "see that it is connected"
            )
        connection.send(answer)
        return result
