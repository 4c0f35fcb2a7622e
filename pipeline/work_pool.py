"""Worker processes, each with a thread of the service that feeds it; what does not fit is refused at once.

::

    submit --> waiting (bounded) --> thread 1 <== pipe ==> worker 1
                                 --> thread 2 <== pipe ==> worker 2

A worker that dies, or takes longer than a job may, costs its own job and is replaced; no lock is shared between
processes, so that one killed at any moment leaves nothing held. Workers keep to a limit of memory, use one core each,
and end when the service does, however that ends.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import multiprocessing
import os
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Any

from pipeline.work_process import Answer, serve_jobs

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

    from pipeline.settings import ReadSettings
    from pipeline.work import Limits

_log = logging.getLogger(__name__)
_USUAL_S = 1.0
_SMOOTHING = 0.2
_PAUSE_S, _MOST_PAUSE_S = 0.2, 10.0
_WARM_UP_S = 180.0
_LEAST_RETRY_S, _MOST_RETRY_S = 1.0, 60.0


class BusyError(RuntimeError):
    """As many jobs wait as may.

    Attributes:
        retry_after_s: when a place may be free, about.
    """

    def __init__(self, retry_after_s: float) -> None:
        super().__init__(f"as many parts wait as may; try again in {retry_after_s:.0f} s")
        self.retry_after_s = retry_after_s

    def __reduce__(self) -> tuple[type[BusyError], tuple[float]]:
        return (type(self), (self.retry_after_s,))


class WorkerLostError(RuntimeError):
    """A job whose worker ended before it did.

    Attributes:
        reason: what became of the worker, in words.
        timed_out: whether it took longer than a job may; the same job will then hardly do better.
    """

    def __init__(self, reason: str, timed_out: bool = False) -> None:
        super().__init__(reason)
        self.reason, self.timed_out = reason, timed_out


@dataclass
class _Task:
    function: Callable[..., Any]
    args: tuple[Any, ...]
    future: Future[Any]


_Tasks = queue.Queue[_Task | None]


def _new_tasks() -> _Tasks:
    return queue.Queue()


class WorkPool:
    """Runs functions in worker processes.

    The functions are of modules that a worker can import; arguments, results and exceptions can be pickled.
    """

    def __init__(
        self,
        settings: ReadSettings,
        limits: Limits,
        workers: int,
        queue: int,
        timeout_s: float,
        *,
        warm: bool = True,
    ) -> None:
        """Start the workers; they warm up by themselves, see `ready`.

        Args:
            settings: how the workers read; they make their readers while they warm up.
            limits: memory of a worker.
            workers: processes.
            queue: jobs that may wait beyond those that run.
            timeout_s: a job may take.
            warm: whether workers read a small part before their first job.

        Raises:
            ValueError: numbers that cannot be.
        """
        if workers < 1 or queue < 0 or not timeout_s > 0.0:
            raise ValueError(
                f"{workers} workers, {queue} waiting, {timeout_s} s: give at least 1, 0 and above 0"
            )
        self.workers, self.queue, self.timeout_s = workers, queue, timeout_s
        self._settings, self._limits, self._warm = settings, limits, warm
        self._tasks: _Tasks = _new_tasks()
        self._lock = threading.Lock()
        self._jobs = 0
        self._mean_s = _USUAL_S
        self._closing, self._stopped = threading.Event(), threading.Event()
        self._slots = [_Slot(self, k) for k in range(workers)]
        for slot in self._slots:
            slot.thread.start()
        # before multiprocessing's own, which waits for workers that do not end by themselves
        atexit.register(self.close, 0.0)

    def submit(self, function: Callable[..., Any], *args: Any) -> Future[Any]:
        """Have a worker call the function.

        Returns:
            Its future: the function's result or exception, or WorkerLostError. It cannot be cancelled.

        Raises:
            BusyError: as many jobs wait as may.
            RuntimeError: the pool is closed.
        """
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        with self._lock:
            if self._closing.is_set():
                raise RuntimeError("the pool is closed")
            busy_s = self.retry_after_s()
            if busy_s is not None:
                raise BusyError(busy_s)
            self._jobs += 1
        self._tasks.put(_Task(function, args, future))
        return future

    def retry_after_s(self) -> float | None:
        """When a place may be free, about; None while there is one."""
        if self._jobs < self.workers + self.queue:
            return None
        after_s = self._mean_s * (self._jobs - self.workers + 1) / self.workers
        return min(max(after_s, _LEAST_RETRY_S), _MOST_RETRY_S)

    @property
    def waiting(self) -> int:
        """Jobs that no worker has begun."""
        return max(0, self._tasks.qsize())

    @property
    def running(self) -> int:
        """Jobs that workers are at."""
        return max(0, self._jobs - self.waiting)

    @property
    def restarts(self) -> int:
        """Workers that were replaced."""
        return sum(slot.restarts for slot in self._slots)

    @property
    def pids(self) -> tuple[int, ...]:
        """Of the worker processes that live."""
        return tuple(pid for slot in self._slots if (pid := slot.pid) is not None)

    def ready(self) -> bool:
        """Whether any worker is warm; one that is being replaced does not make the service unready."""
        return not self._closing.is_set() and any(slot.warm for slot in self._slots)

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait until every worker is warm."""
        until = time.monotonic() + timeout_s
        while time.monotonic() < until and not self._closing.is_set():
            if all(slot.warm for slot in self._slots):
                return True
            time.sleep(0.02)
        return False

    def close(self, grace_s: float) -> None:
        """Take no more jobs, let those that there are end, and end the workers; what is not done by then is lost."""
        with self._lock:
            if self._closing.is_set():
                return
            self._closing.set()
        atexit.unregister(self.close)
        until = time.monotonic() + max(0.0, grace_s)
        for _ in self._slots:
            self._tasks.put(None)
        for slot in self._slots:
            slot.thread.join(max(0.0, until - time.monotonic()))
        self._stopped.set()
        for slot in self._slots:
            slot.kill()
        for slot in self._slots:
            slot.thread.join()
        with contextlib.suppress(queue.Empty):
            while True:
                task = self._tasks.get_nowait()
                if task is not None:
                    self._settle(task, WorkerLostError("the service is stopping"), 0.0)

    def _settle(self, task: _Task, outcome: Any, seconds: float) -> None:
        with self._lock:
            self._jobs -= 1
            if isinstance(outcome, Answer):
                self._mean_s += _SMOOTHING * (seconds - self._mean_s)
        if isinstance(outcome, Answer):
            task.future.set_result(outcome.value)
        else:
            task.future.set_exception(outcome)


class _Slot:
    """One worker, whichever process it is at the time, and the thread that feeds it."""

    def __init__(self, pool: WorkPool, number: int) -> None:
        self.pool, self.restarts, self.warm = pool, 0, False
        self.process: SpawnProcess | None = None
        self.pipe: Connection | None = None
        self._life: Connection | None = None
        self.thread = threading.Thread(target=self._run, name=f"worker-{number}", daemon=True)

    @property
    def pid(self) -> int | None:
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
        closing = self.pool._closing
        while not self.pool._stopped.is_set():
            if not self.warm and not (closing.is_set() and self.pool.waiting == 0):
                started = self._start()
                if not started:
                    if not self.pool._stopped.is_set():
                        _log.warning("a worker has ended before it was warm")
                    self._end()
                    self.restarts += 1
                    # a worker that cannot even start would otherwise keep a core busy with failing
                    closing.wait(pause)
                    pause = min(2.0 * pause, _MOST_PAUSE_S)
                    if closing.is_set():
                        break
                    continue
                pause = _PAUSE_S
            task = self._next()
            if task is None and (closing.is_set() or self.warm):
                break
            if task is not None:
                self._do(task)
        self._end()

    def _next(self) -> _Task | None:
        """The next job; None at the end, or where the idle worker has died and is to be replaced first."""
        while True:
            with contextlib.suppress(queue.Empty):
                return self.pool._tasks.get(timeout=0.25)
            if self.process is None or self.process.exitcode is not None:
                self._end()
                self.restarts += 1
                return None

    def _start(self) -> bool:
        """Begin a process and wait until it is warm."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        life_end, self._life = context.Pipe(duplex=False)
        process = context.Process(
            target=serve_jobs,
            args=(theirs, life_end, os.getpid(), self.pool._settings, self.pool._limits, self.pool._warm),
            name="tactile-marks-worker",
            daemon=True,
        )
        self.pipe = ours
        try:
            process.start()
        except OSError:
            return False
        finally:
            theirs.close()
            life_end.close()
        self.process = process
        if self.pool._stopped.is_set():
            return False
        message = self._received(_WARM_UP_S)
        self.warm = isinstance(message, Answer)
        return self.warm

    def _do(self, task: _Task) -> None:
        started = time.monotonic()
        try:
            outcome = self._outcome(task)
        except Exception as error:  # of this thread: the job may not wait for ever, nor the slot be lost
            _log.exception("fault of the program while waiting for a worker")
            self._end()
            self.restarts += 1
            outcome = WorkerLostError(f"the worker was lost ({type(error).__name__})")
        self.pool._settle(task, outcome, time.monotonic() - started)

    def _outcome(self, task: _Task) -> Any:
        assert self.pipe is not None
        try:
            self.pipe.send((task.function, task.args))
        except OSError:
            pass  # it has died: seen below
        except Exception as error:  # arguments that cannot be pickled
            return error
        started = time.monotonic()
        message = self._received(self.pool.timeout_s)
        if message is not None:
            return message
        timed_out = time.monotonic() - started >= self.pool.timeout_s
        lost = WorkerLostError(self._fate(timed_out), timed_out)
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

    def _fate(self, timed_out: bool) -> str:
        if timed_out:
            return f"reading took longer than {self.pool.timeout_s:g} s and was stopped"
        process = self.process
        if process is not None:
            process.join(1.0)
        code = process.exitcode if process is not None else None
        return f"the worker that was reading has ended (exit code {code})"

    def _end(self) -> None:
        self.warm = False
        process, self.process = self.process, None
        if self.pipe is not None:
            self.pipe.close()
        if self._life is not None:
            self._life.close()
        self.pipe = self._life = None
        if process is not None:
            process.join(0.2 if process.exitcode is None and self.pool._closing.is_set() else 0.0)
            if process.exitcode is None:
                process.kill()
            process.join()
