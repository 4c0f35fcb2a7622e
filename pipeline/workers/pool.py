"""Worker processes, each fed by a thread of this process: for runs, the service, benchmarks and `synth`.

* Every job ends: with its result, its exception, or WorkerLostError, even if no worker can start.
* A worker that dies, or exceeds the time limit of a job, costs only its own job and is replaced.
* No lock is shared between processes, so a worker killed at any moment leaves nothing locked.
* A worker uses one core and keeps to its memory limit. It is not forked: a forked child dies in its first parallel
  kernel. It ends when this process does, however that ends.
"""

from __future__ import annotations

import atexit
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from glyphs.errors import MarksError
from pipeline.common.settings import SettingsError
from pipeline.errors import describe_fault
from pipeline.workers.executors import Executor, WorkerLostError
from pipeline.workers.machine import memory_share_mb
from pipeline.workers.process import LOOK_S, Answer, Shared, Worker, pickled_call, worker_of

_log = logging.getLogger(__name__)
PART_TIMEOUT_S = 900.0
# jobs that a run submits at a time for each worker: one at work, the others waiting
_AHEAD = 16
_STOPPING = "the workers are stopping"
_PAUSE_S, _MOST_PAUSE_S = 0.2, 10.0
_WARM_UP_S = 180.0
# failed starts in a row, for each worker, after which waiting jobs are given up
_STARTS_TRIED = 3
_USUAL_S = 1.0
_SMOOTHING = 0.2
_LEAST_RETRY_S, _MOST_RETRY_S = 1.0, 60.0


class BusyError(MarksError):
    """The queue of jobs is full; it has room again in some `retry_after_s` seconds."""

    def __init__(self, retry_after_s: float) -> None:
        super().__init__("the queue is full", hint=f"try again in {retry_after_s:.0f} s")
        self.retry_after_s = retry_after_s


@dataclass(frozen=True, eq=False)
class _Job:
    call: bytes
    timeout_s: float
    future: Future[Any]
    queued_s: float = field(default_factory=time.monotonic)


@dataclass(eq=False)
class _Slot:
    number: int
    worker: Worker | None = None
    warm: bool = False
    job: _Job | None = None
    thread: threading.Thread = field(default_factory=threading.Thread)


class WorkPool(Executor):
    """Run functions in worker processes of this machine; functions must be importable there, data picklable."""

    def __init__(
        self,
        workers: int,
        *,
        queue: int | None = None,  # waiting jobs, at most (default: enough to keep the workers busy)
        timeout_s: float = PART_TIMEOUT_S,  # longest time of a job; its process is then replaced
        memory_mb: int | None = None,  # limit of a worker; 0: none (default: its share of the machine's)
        warm_up: Callable[[], object] = bool,  # picklable; every worker calls it before its first job
        at_once: bool = True,  # start all processes now; else when there are jobs for them
    ) -> None:
        """Start the workers; they warm up in the background, see `ready`. Raises SettingsError: invalid numbers."""
        queue = _AHEAD * workers if queue is None else queue
        if workers < 1 or queue < 0 or not timeout_s > 0.0:
            raise SettingsError(
                f"invalid limits: {workers} jobs (at least 1), {queue} waiting (at least 0),"
                f" {timeout_s} s per part (above 0)"
            )
        self.workers, self.queue, self.timeout_s = workers, queue, timeout_s
        self.memory_mb = memory_share_mb(workers) if memory_mb is None else memory_mb
        self._warm_up, self._mean_s = warm_up, _USUAL_S
        self._failed, self._why_failed = 0, ""  # failed starts in a row, of any workers
        self._waiting: deque[_Job] = deque()
        self._slots: list[_Slot] = []
        self._changed = threading.Condition()  # jobs wait, or the pool closes
        self._closing, self._stopped = threading.Event(), threading.Event()
        for _ in range(workers if at_once else 0):
            self._add_slot()
        # called before multiprocessing's own handler, which waits for workers that do not end by themselves
        atexit.register(self.close, 0.0)

    def __enter__(self) -> WorkPool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close(0.0)

    def call(self, function: Callable[..., Any], *args: Any, free_s: float, timeout_s: float) -> Any:
        """Let a worker call the function before all waiting jobs, for at most `timeout_s`, and return its result.
        Raises BusyError: the queue is full, or no worker was free within `free_s`. WorkerLostError. What it raises."""
        future = self.submit(function, *args, timeout_s=timeout_s, first=True)
        with suppress(TimeoutError):
            return future.result(free_s)
        with self._changed:
            for job in self._waiting:
                if job.future is future:
                    self._waiting.remove(job)
                    raise BusyError(min(max(free_s, _LEAST_RETRY_S), _MOST_RETRY_S))
        return future.result()

    def submit(
        self,
        function: Callable[..., Any],
        *args: Any,
        timeout_s: float | None = None,
        first: bool = False,
    ) -> Future[Any]:
        """Let a worker call the function, before the waiting jobs with `first`; the future has its result, its
        exception or WorkerLostError. `timeout_s` is by default the pool's. Raises BusyError, WorkerLostError."""
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        try:
            job = _Job(pickled_call(function, *args), timeout_s or self.timeout_s, future)
        except Exception as error:  # arguments that cannot be pickled
            future.set_exception(error)
            return future
        with self._changed:
            if self._closing.is_set():
                raise WorkerLostError(_STOPPING)
            if (busy_s := self.retry_after_s()) is not None:
                raise BusyError(busy_s)
            (self._waiting.appendleft if first else self._waiting.append)(job)
            if len(self._slots) < min(self.waiting + self.running, self.workers):
                self._add_slot()
            self._changed.notify()
        self._give_up_waiting()
        return future

    def retry_after_s(self) -> float | None:
        over = self.waiting + self.running - self.workers - self.queue
        if over < 0:
            return None
        after_s = self._mean_s * (over + self.queue + 1) / self.workers
        return min(max(after_s, _LEAST_RETRY_S), _MOST_RETRY_S)

    @property
    def waiting(self) -> int:
        return len(self._waiting)

    @property
    def running(self) -> int:
        return sum(slot.job is not None for slot in self._slots)

    def ready(self) -> bool:
        """Whether any worker is warm; one that is being replaced does not make the service unready."""
        return not self._closing.is_set() and any(slot.warm for slot in self._slots)

    def all_ready(self) -> bool:
        return all(slot.warm for slot in self._slots)

    @property
    def trouble(self) -> str:
        failed = self._failed > 0 and not any(slot.warm for slot in self._slots)
        return f"no worker can start: {self._why_failed}" if failed else ""

    def close(self, grace_s: float) -> None:
        """Refuse new jobs, wait for running ones, and stop the workers; jobs not done by then are lost."""
        with self._changed:
            if self._closing.is_set():
                return
            self._closing.set()
            self._changed.notify_all()
        atexit.unregister(self.close)
        until = time.monotonic() + max(0.0, grace_s)
        for slot in self._slots:
            slot.thread.join(max(0.0, until - time.monotonic()))
        self._stopped.set()
        for slot in self._slots:
            if (worker := slot.worker) is not None:
                worker.kill()
        for slot in self._slots:
            slot.thread.join()
        for job in self._waiting:
            job.future.set_exception(WorkerLostError(_STOPPING))

    def _ahead(self) -> int:
        return _AHEAD * self.workers

    def _shared(self, order: Any) -> Any:
        return Shared(order)

    def _add_slot(self) -> None:
        slot = _Slot(len(self._slots))
        slot.thread = threading.Thread(target=self._feed, args=(slot,), daemon=True)
        self._slots.append(slot)
        slot.thread.start()

    def _feed(self, slot: _Slot) -> None:
        pause_s = _PAUSE_S
        while not self._not_wanted():
            if not slot.warm:
                if not self._start(slot):
                    # a worker that cannot even start would otherwise keep a core busy
                    self._closing.wait(pause_s)
                    pause_s = min(2.0 * pause_s, _MOST_PAUSE_S)
                    continue
                pause_s = _PAUSE_S
            assert slot.worker is not None
            if self._take_job(slot):
                self._work(slot, slot.worker)
            elif not slot.worker.is_alive:
                self._lose(slot)
        if slot.worker is not None:
            slot.worker.end(0.2)

    def _take_job(self, slot: _Slot) -> bool:
        with self._changed:
            if not self._waiting:
                self._changed.wait(LOOK_S)
            if self._waiting:
                slot.job = self._waiting.popleft()
        return slot.job is not None

    def _work(self, slot: _Slot, worker: Worker) -> None:
        job, began_s = slot.job, time.monotonic()
        assert job is not None
        outcome: Answer | Exception
        try:
            outcome = worker.ask(job.call, job.timeout_s, "the part took longer than {} s and was stopped")
        except Exception as error:  # a fault here must not leave the job waiting for ever, or the slot dead
            outcome = WorkerLostError(f"the worker was lost ({describe_fault(error)})")
        slot.job = None
        if isinstance(outcome, WorkerLostError):
            _log.warning("%s", outcome)
            self._lose(slot)
        if isinstance(outcome, Answer):
            self._mean_s += _SMOOTHING * (time.monotonic() - began_s - self._mean_s)
            job.future.set_result(outcome.value)
        else:
            job.future.set_exception(outcome)

    def _start(self, slot: _Slot) -> bool:
        answer: Answer | Exception
        try:
            slot.worker = worker_of(slot.number, self.memory_mb)
            late = "it was not ready after {} s"
            answer = slot.worker.ask(pickled_call(self._warm_up), _WARM_UP_S, late, self._not_wanted)
        except Exception as error:
            answer = error
        slot.warm = isinstance(answer, Answer)
        if isinstance(answer, Exception):
            why = _cause(answer)
            if slot.worker is not None and self.memory_mb:
                why += f"; it may use {self.memory_mb} MB of memory"
            if why != self._why_failed and not self._closing.is_set():
                _log.warning("a worker cannot start and is tried again: %s", why)
            self._lose(slot)
            self._failed, self._why_failed = self._failed + 1, why
            self._give_up_waiting()
        else:
            self._failed, self._why_failed = 0, ""
        return slot.warm

    def _lose(self, slot: _Slot) -> None:
        slot.warm, worker, slot.worker = False, slot.worker, None
        if worker is not None:
            worker.end()

    def _not_wanted(self) -> bool:
        self._give_up_waiting()
        return self._stopped.is_set() or (self._closing.is_set() and not self._waiting)

    def _give_up_waiting(self) -> None:
        while self._waiting and self._failed and not any(slot.warm for slot in self._slots):
            with self._changed:
                if not self._waiting:
                    return
                job = self._waiting[0]
                hopeless = self._failed >= _STARTS_TRIED * len(self._slots)
                if not hopeless and time.monotonic() - job.queued_s < job.timeout_s:
                    return
                self._waiting.popleft()
            job.future.set_exception(WorkerLostError(self.trouble or "no worker is ready", unstarted=True))


def _cause(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{type(error).__name__}: {error.strerror}"
    return error.what if isinstance(error, MarksError) else describe_fault(error)
