"""One worker of the pool: its process, the thread that feeds it, and what becomes of both."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import queue
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from glyphs.errors import MarksError, describe_fault
from pipeline.workers.process import Answer, serve_jobs

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

_log = logging.getLogger(__name__)
_PAUSE_S, _MOST_PAUSE_S = 0.2, 10.0
_WARM_UP_S = 180.0
_LOOK_S = 0.25
_FROM_OUTSIDE = (None, -signal.SIGTERM, -getattr(signal, "SIGKILL", 9), -signal.SIGINT)
"""Exit codes of workers that somebody has killed: a person, or a system short of memory."""


class WorkerLostError(MarksError):
    """A job whose worker ended before it did.

    Attributes:
        reason: what became of the worker, in words.
        timed_out: whether it took longer than a job may; the same job will then hardly do better.
        crashed: whether the worker has ended by a fault of what it ran, and was not killed from outside.
        unstarted: whether no worker has begun the job, for none can start; another try will hardly find one.
    """

    def __init__(
        self, reason: str, timed_out: bool = False, crashed: bool = False, unstarted: bool = False
    ) -> None:
        super().__init__(reason)
        self.reason, self.timed_out, self.crashed, self.unstarted = reason, timed_out, crashed, unstarted


@dataclass
class Task:
    """A call that someone waits for.

    Attributes:
        function: to be called.
        args: its arguments.
        future: of the result.
        timeout_s: it may take.
        queued: when it was handed in, by the monotonic clock.
        begun: when a worker began it.
    """

    function: Callable[..., Any]
    args: tuple[Any, ...]
    future: Future[Any]
    timeout_s: float
    queued: float = field(default_factory=time.monotonic)
    begun: float = 0.0


Tasks = queue.Queue[Task | None]


@dataclass(frozen=True, eq=False)
class SlotOrder:
    """How workers are to be, and when to end.

    Attributes:
        memory_mb: of a worker; 0: no limit.
        warm_up: called by a worker before its first job.
        closing: no more jobs come.
        stopped: jobs that are not done are lost.
    """

    memory_mb: int
    warm_up: Callable[[], object] | None
    closing: threading.Event = field(default_factory=threading.Event)
    stopped: threading.Event = field(default_factory=threading.Event)


class Slot:
    """One worker, whichever process it is at the time, and the thread that feeds it."""

    def __init__(
        self,
        number: int,
        order: SlotOrder,
        tasks: Tasks,
        settle: Callable[[Task, Any], None],
        not_warm: Callable[[], None],
    ) -> None:
        """Prepare; `thread` is to be started.

        Args:
            number: of the slot; the worker of the first shows what is compiled.
            order: how the worker is to be, and when to end.
            tasks: where jobs come from; one None for each slot at the end.
            settle: called with every job and what came of it: an `Answer` or an exception.
            not_warm: called now and then while the worker is not warm.
        """
        self.number, self.order, self.tasks, self.settle = number, order, tasks, settle
        self.not_warm = not_warm
        self.restarts, self.warm = 0, False
        self.failed, self.trouble = 0, ""
        """Starts in a row that have failed, and why the last one did."""
        self.process: SpawnProcess | None = None
        self.pipe: Connection | None = None
        self._life: Connection | None = None
        self.thread = threading.Thread(target=self._run, name=f"worker-{number}", daemon=True)

    @property
    def pid(self) -> int | None:
        """Of the process, while it lives."""
        process = self.process
        return process.pid if process is not None and process.exitcode is None else None

    def kill(self) -> None:
        """End the process now; its thread sees it."""
        process = self.process
        if process is not None:
            with contextlib.suppress(OSError, ValueError):
                process.kill()

    def _run(self) -> None:
        pause = _PAUSE_S
        closing = self.order.closing
        while not self.order.stopped.is_set():
            if not self.warm and not (closing.is_set() and self.tasks.empty()):
                why = self._start()
                if why:
                    self._end()
                    self.restarts += 1
                    if why != self.trouble and not self.order.stopped.is_set():
                        _log.warning("a worker cannot start and is tried again: %s", why)
                    self.failed, self.trouble = self.failed + 1, why
                    self.not_warm()
                    # a worker that cannot even start would otherwise keep a core busy with failing
                    closing.wait(pause)
                    pause = min(2.0 * pause, _MOST_PAUSE_S)
                    if closing.is_set():
                        break
                    continue
                pause, self.failed, self.trouble = _PAUSE_S, 0, ""
            task = self._next()
            if task is None and (closing.is_set() or self.warm):
                break
            if task is not None:
                self._do(task)
        self._end()

    def _next(self) -> Task | None:
        """The next job; None at the end, or where the idle worker has died and is to be replaced first."""
        while True:
            with contextlib.suppress(queue.Empty):
                return self.tasks.get(timeout=_LOOK_S)
            if self.process is None or self.process.exitcode is not None:
                self._end()
                self.restarts += 1
                return None

    def _jobs_wait(self) -> bool:
        """Whether a job waits that this worker may still do."""
        with self.tasks.mutex:
            return any(task is not None for task in self.tasks.queue)

    def _start(self) -> str:
        """Begin a process and wait until it is warm; why it is not, or nothing."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        life_end, self._life = context.Pipe(duplex=False)
        process = context.Process(
            target=serve_jobs,
            args=(theirs, life_end, self.order.memory_mb, self.order.warm_up),
            name=f"tactile-marks-worker-{self.number}",
            daemon=True,
        )
        self.pipe = ours
        try:
            process.start()
        except Exception as error:
            return _cause(error)
        finally:
            theirs.close()
            life_end.close()
        self.process = process
        until = time.monotonic() + _WARM_UP_S
        message, alive = None, True
        while message is None and alive and time.monotonic() < until:
            if self.order.stopped.is_set() or (self.order.closing.is_set() and not self._jobs_wait()):
                return "the workers are stopping"
            alive = process.exitcode is None
            message = self._received(_LOOK_S)
            self.not_warm()
        self.warm = isinstance(message, Answer)
        if self.warm:
            return ""
        limit = f"; it may use {self.order.memory_mb} MB of memory" if self.order.memory_mb else ""
        if isinstance(message, Exception):
            return _cause(message) + limit
        return self._fate(f"it was not ready after {_WARM_UP_S:.0f} s" if alive else "") + limit

    def _do(self, task: Task) -> None:
        task.begun = time.monotonic()
        try:
            outcome = self._outcome(task)
        except Exception as error:  # of this thread: the job may not wait for ever, nor the slot be lost
            _log.exception("fault of the program while waiting for a worker")
            self._end()
            self.restarts += 1
            outcome = WorkerLostError(f"the worker was lost ({type(error).__name__})")
        self.settle(task, outcome)

    def _outcome(self, task: Task) -> Any:
        assert self.pipe is not None
        try:
            self.pipe.send((task.function, task.args))
        except OSError:
            pass  # it has died, as is found below
        except Exception as error:  # arguments that cannot be pickled
            return error
        started = time.monotonic()
        message = self._received(task.timeout_s)
        if message is not None:
            return message
        timed_out = time.monotonic() - started >= task.timeout_s
        fate = self._fate(
            f"the part took longer than {task.timeout_s:g} s and was stopped" if timed_out else ""
        )
        code = self.process.exitcode if self.process is not None else None
        lost = WorkerLostError(fate, timed_out, not timed_out and code not in _FROM_OUTSIDE)
        _log.warning("%s", lost.reason)
        self._end()
        self.restarts += 1
        return lost

    def _received(self, timeout_s: float) -> Any:
        """What the worker sends; None where it is gone or too late."""
        assert self.pipe is not None
        assert self.process is not None
        wait([self.pipe, self.process.sentinel], timeout_s)
        with contextlib.suppress(Exception):  # a message cut short by a kill may be anything
            if self.pipe.poll():
                return self.pipe.recv()
        return None

    def _fate(self, too_late: str) -> str:
        """Why there is no answer: the time that is up, or how the process ended."""
        if too_late:
            return too_late
        process = self.process
        if process is not None:
            process.join(1.0)
        code = process.exitcode if process is not None else None
        return f"the worker has ended (exit code {code})"

    def _end(self) -> None:
        self.warm = False
        process, self.process = self.process, None
        if self.pipe is not None:
            self.pipe.close()
        if self._life is not None:
            self._life.close()
        self.pipe = self._life = None
        if process is not None:
            process.join(0.2 if process.exitcode is None and self.order.closing.is_set() else 0.0)
            if process.exitcode is None:
                process.kill()
            process.join()


def _cause(error: Exception) -> str:
    """Why a worker cannot start, without paths of this machine."""
    if isinstance(error, OSError) and error.strerror:
        return f"{type(error).__name__}: {error.strerror}"
    return error.what if isinstance(error, MarksError) else describe_fault(error)
