"""Call a function for many tasks: in this process, in processes of this machine, or on a Dask cluster.

* Every task has one outcome: its result, its exception, or WorkerLostError. Few tasks are drawn ahead.
* A task that loses its worker is tried once more, by itself, after the others, and then given up.
"""

from __future__ import annotations

import os
import queue
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Generic, TypeVar

from glyphs.compiling import end_part
from glyphs.errors import MarksError
from pipeline.workers.interrupts import raise_interrupt

O = TypeVar("O")  # noqa: E741 - an order
T = TypeVar("T")
R = TypeVar("R")


# Seconds for which an outcome waits for others that finish with it.
_SOON_S = 0.002


class WorkerLostError(MarksError):
    """The worker of a task ended before the task did."""

    is_usage = False

    def __init__(
        self,
        what: str,
        *,
        timed_out: bool = False,  # the task exceeded its time limit; another try would hardly help
        starved: bool = False,  # the worker got little of a core until then, so that another try may help
        crashed: bool = False,  # rather than being killed from outside
        unstarted: bool = False,  # no worker has begun the task, because none can start
        tried: bool = False,  # it was retried already; another try is useful only if others were lost with it
    ) -> None:
        super().__init__(what)
        self.timed_out, self.starved = timed_out, starved
        self.crashed, self.unstarted, self.tried = crashed, unstarted, tried


@dataclass(frozen=True, eq=False)
class Outcome(Generic[T, R]):
    """Result of a task, or its error; `more` if another outcome is ready, so that the next one comes at once."""

    task: T
    result: R | None = None
    error: Exception | None = None
    more: bool = False


class Executor:
    """Call a function for many tasks, about `workers` at once; `remote` workers lack this machine's files."""

    workers = 1
    remote = False

    def calls(self, function: Callable[[O, T], R], order: O, tasks: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """Yield the outcome of function(order, task) for every task as it finishes. Raises ClusterError: it is lost."""
        waiting, shared = iter(tasks), self._shared(order)
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        running: dict[Any, T] = {}
        lost: list[T] = []
        tried = False

        def hand_over(tasks: Iterable[T]) -> None:
            for task in tasks:
                future = self.submit(function, shared, task)
                running[future] = task
                future.add_done_callback(done.put)

        def next_outcome() -> Outcome[T, R]:
            future = self._next(done)
            raise_interrupt()
            return self._outcome(future, running.pop(future))

        hand_over(islice(waiting, self._ahead()))
        while running:
            outcome = next_outcome()
            hand_over(islice(waiting, max(0, self._ahead() - len(running))))
            error = outcome.error
            if isinstance(error, WorkerLostError) and not (error.timed_out or error.unstarted):
                lost.append(outcome.task)
                tried, last = error.tried, outcome
                continue
            # quick tasks finish together: what comes of them is kept in fewer transactions
            if running and self._ahead() > 1 and done.empty():
                time.sleep(_SOON_S)
            # without workers the next task has finished before this outcome is reported; that does not count as more
            yield replace(outcome, more=self._ahead() > 1 and not done.empty())
        if tried and len(lost) == 1:
            # lost alone, in an executor that has retried it: it has killed each of its workers
            yield last
            return
        for task in lost:
            hand_over([task])
            yield next_outcome()

    def submit(self, function: Callable[..., Any], *args: Any) -> Any:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args))
        except Exception as error:
            future.set_exception(error)
        end_part()
        return future

    def _ahead(self) -> int:
        return 1

    def _shared(self, order: Any) -> Any:
        return order

    def _next(self, done: queue.SimpleQueue[Any]) -> Any:
        return done.get()

    def _outcome(self, future: Any, task: Any) -> Outcome[Any, Any]:
        error = future.exception()
        return Outcome(task, future.result()) if error is None else Outcome(task, error=error)


def ordered_map(executor: Executor, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
    """Yield function(task) in the order of the tasks; raises the function's exception, or WorkerLostError."""
    done: dict[int, Any] = {}
    following = 0
    for outcome in executor.calls(_call, function, enumerate(tasks)):
        if outcome.error is not None:
            raise outcome.error
        done[outcome.task[0]] = outcome.result
        while following in done:
            yield done.pop(following)
            following += 1


def _call(function: Callable[[T], R], task: tuple[int, T]) -> R:
    return function(task[1])


def cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
