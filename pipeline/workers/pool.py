"""Worker processes, each fed by a thread of this one: for runs, the service, benchmarks and made parts.

::

    submit --> waiting (bounded) --> thread 1 <== pipe ==> worker 1
                                 --> thread 2 <== pipe ==> worker 2

* Every job ends: with its result, its exception, or WorkerLostError; also where no worker can start.
* A worker that dies, or takes longer than a job may, costs its own job alone and is replaced, also while it is idle.
* No lock is shared between processes, so a worker killed at any moment leaves nothing locked.
* A job beyond those at work and those that may wait is refused at once.
* A worker uses one core and keeps to its memory; none is forked, for a forked child dies in its first parallel kernel.
* Workers end when this process does, however that ends.
"""

from __future__ import annotations

import atexit
import contextlib
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from glyphs.errors import MarksError
from pipeline.workers.process import Answer
from pipeline.workers.slot import Slot, SlotOrder, Task, Tasks, WorkerLostError

__all__ = ["BusyError", "WorkPool", "WorkerLostError"]

_STOPPING = "the workers are stopping"
_NOT_READY = "no worker is ready"
_STARTS_TRIED = 3
"""Starts in a row that fail before jobs are no longer kept waiting."""
_USUAL_S = 1.0
_SMOOTHING = 0.2
_LEAST_RETRY_S, _MOST_RETRY_S = 1.0, 60.0


class BusyError(MarksError):
    """As many jobs wait as may.

    Attributes:
        retry_after_s: when a place may be free, about.
    """

    def __init__(self, retry_after_s: float) -> None:
        super().__init__("the queue is full", hint=f"try again in {retry_after_s:.0f} s")
        self.retry_after_s = retry_after_s


class WorkPool:
    """Runs functions in worker processes.

    The functions are of modules that a worker can import; arguments, results and exceptions can be pickled.
    """

    def __init__(
        self,
        workers: int,
        *,
        queue: int,
        timeout_s: float,
        memory_mb: int = 0,
        warm_up: Callable[[], object] | None = None,
    ) -> None:
        """Start the workers; they warm up by themselves, see `ready`.

        Args:
            workers: processes.
            queue: jobs that may wait beyond those that run.
            timeout_s: a job may take.
            memory_mb: of a worker; 0: no limit.
            warm_up: called by every worker before its first job; it can be pickled.

        Raises:
            ValueError: numbers that cannot be.
        """
        if workers < 1 or queue < 0 or not timeout_s > 0.0:
            raise ValueError(
                f"{workers} workers, {queue} waiting, {timeout_s} s: give at least 1, 0 and above 0"
            )
        self.workers, self.queue, self.timeout_s = workers, queue, timeout_s
        self._order = SlotOrder(memory_mb, warm_up)
        self._tasks: Tasks = _no_tasks()
        self._lock = threading.Lock()
        self._jobs = 0
        self._mean_s = _USUAL_S
        self._slots: list[Slot] = []
        for k in range(workers):
            self._slots.append(Slot(k, self._order, self._tasks, self._settle, self._give_up_waiting))
        for slot in self._slots:
            slot.thread.start()
        # before multiprocessing's own, which waits for workers that do not end by themselves
        atexit.register(self.close, 0.0)

    def submit(self, function: Callable[..., Any], *args: Any, timeout_s: float | None = None) -> Future[Any]:
        """Have a worker call the function.

        Args:
            function: to be called.
            args: its arguments.
            timeout_s: it may take; as any job of the pool unless given.

        Returns:
            Its future: the function's result or exception, or WorkerLostError. It cannot be cancelled.

        Raises:
            BusyError: as many jobs wait as may.
            WorkerLostError: the pool is closed.
        """
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        with self._lock:
            if self._order.closing.is_set():
                raise WorkerLostError(_STOPPING)
            busy_s = self.retry_after_s()
            if busy_s is not None:
                raise BusyError(busy_s)
            self._jobs += 1
        self._tasks.put(Task(function, args, future, timeout_s or self.timeout_s))
        self._give_up_waiting()
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
        return not self._order.closing.is_set() and any(slot.warm for slot in self._slots)

    @property
    def trouble(self) -> str:
        """Why no worker is ready, where one has failed to start; empty otherwise."""
        slot = max(self._slots, key=lambda slot: slot.failed)
        if slot.failed == 0 or any(slot.warm for slot in self._slots):
            return ""
        if slot.failed < _STARTS_TRIED:
            return f"no worker is ready; the last one did not start: {slot.trouble}"
        return f"no worker can start: {slot.trouble}"

    def all_ready(self) -> bool:
        """Whether every worker is warm."""
        return all(slot.warm for slot in self._slots)

    def close(self, grace_s: float) -> None:
        """Take no more jobs, let those that there are end, and end the workers; what is not done by then is lost."""
        with self._lock:
            if self._order.closing.is_set():
                return
            self._order.closing.set()
        atexit.unregister(self.close)
        until = time.monotonic() + max(0.0, grace_s)
        for _ in self._slots:
            self._tasks.put(None)
        for slot in self._slots:
            slot.thread.join(max(0.0, until - time.monotonic()))
        self._order.stopped.set()
        for slot in self._slots:
            slot.kill()
        for slot in self._slots:
            slot.thread.join()
        with contextlib.suppress(queue.Empty):
            while True:
                task = self._tasks.get_nowait()
                if task is not None:
                    self._settle(task, WorkerLostError(_STOPPING))

    def _give_up_waiting(self) -> None:
        """Settle the jobs that wait for a worker while none can start."""
        while not any(slot.warm for slot in self._slots):
            failed = max(slot.failed for slot in self._slots)
            with self._tasks.mutex:
                waiting = self._tasks.queue
                task = waiting[0] if waiting else None
                if task is None or failed == 0:
                    return
                if failed < _STARTS_TRIED and time.monotonic() - task.queued < task.timeout_s:
                    return
                waiting.popleft()
            self._settle(task, WorkerLostError(self.trouble or _NOT_READY, unstarted=True))

    def _settle(self, task: Task, outcome: Any) -> None:
        with self._lock:
            self._jobs -= 1
            if isinstance(outcome, Answer):
                self._mean_s += _SMOOTHING * (time.monotonic() - task.begun - self._mean_s)
        if isinstance(outcome, Answer):
            task.future.set_result(outcome.value)
        else:
            task.future.set_exception(outcome)


def _no_tasks() -> Tasks:
    # `queue` is what the pool calls the number of jobs that may wait
    return queue.Queue()
