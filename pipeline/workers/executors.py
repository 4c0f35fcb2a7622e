"""Who does the work: this process, processes of this machine, or a Dask cluster (`pipeline.workers.cluster`).

    tasks (as they are asked for) --> executor --> outcomes (as they are done)

* Every task has one outcome: its result, its exception, or what became of its worker.
* Only the few tasks at work are taken, so there may be any number of them.
* A lost worker costs no other task; a task that loses its worker again and again is given up, and the others go on.
"""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from pipeline.common.settings import SettingsError
from pipeline.workers.allocator import kept_memory
from pipeline.workers.interrupts import raise_interrupt

if TYPE_CHECKING:
    from concurrent.futures import Future

O = TypeVar("O")  # noqa: E741 - an order
T = TypeVar("T")
R = TypeVar("R")

PART_TIMEOUT_S = 900.0
_AHEAD = 2
"""Tasks that are handed over for each worker: one at work, one waiting."""
_AGAIN = 1
"""Times that a task is tried again whose worker was lost."""


@dataclass(frozen=True, eq=False)
class Outcome(Generic[T, R]):
    """What became of a task.

    Attributes:
        task: as it was given.
        result: what the function returned; None with an error.
        error: what the function raised, or what became of its worker.
    """

    task: T
    result: R | None = None
    error: Exception | None = None


class Executor(Protocol):
    """Calls a function for many tasks."""

    @property
    def workers(self) -> int:
        """Tasks that are at work at once, about."""

    def calls(self, function: Callable[[O, T], R], order: O, tasks: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """What the function makes of (order, task), as it is done, in any order."""


class InlineExecutor:
    """This process."""

    workers = 1

    def calls(self, function: Callable[[O, T], R], order: O, tasks: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """See `Executor`; in the order of the tasks."""
        for task in tasks:
            try:
                outcome = Outcome(task, function(order, task))
            except Exception as error:
                outcome = Outcome(task, error=error)
            raise_interrupt()
            yield outcome


class PoolExecutor:
    """Processes of this machine, each on one core and within its share of the memory."""

    def __init__(self, jobs: int, *, timeout_s: float = PART_TIMEOUT_S, modules: Sequence[str] = ()) -> None:
        """Make ready; the processes start with the block.

        Args:
            jobs: processes.
            timeout_s: after which a task is given up and its process replaced.
            modules: that the processes import before their first task.

        Raises:
            SettingsError: no process, no time.
        """
        if jobs < 1 or not timeout_s > 0.0:
            raise SettingsError(f"{jobs} jobs, {timeout_s} s a part: give at least 1, and a time above 0")
        self.workers = jobs
        self._timeout_s, self._modules = timeout_s, modules
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> PoolExecutor:
        from pipeline.workers.pool import WorkPool
        from pipeline.workers.process import load

        self._stack.enter_context(kept_memory())
        self._pool = WorkPool(
            self.workers,
            queue=_AHEAD * self.workers,
            timeout_s=self._timeout_s,
            memory_mb=_share_mb(self.workers),
            warm_up=partial(load, self._modules),
        )
        self._stack.callback(self._pool.close, 0.0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    @property
    def pids(self) -> tuple[int, ...]:
        """Of the processes that live."""
        return self._pool.pids

    def calls(self, function: Callable[[O, T], R], order: O, tasks: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """See `Executor`."""
        from pipeline.workers.pool import WorkerLostError

        done: queue.SimpleQueue[Future[R]] = queue.SimpleQueue()
        held: dict[Future[R], tuple[T, int]] = {}
        waiting = iter(tasks)

        def hand_over(task: T, tries: int) -> None:
            future: Future[Any] = self._pool.submit(function, order, task)
            held[future] = (task, tries)
            future.add_done_callback(done.put)

        for task in islice(waiting, _AHEAD * self.workers):
            hand_over(task, 0)
        while held:
            future = done.get()
            raise_interrupt()
            task, tries = held.pop(future)
            error = future.exception()
            if isinstance(error, WorkerLostError) and not error.timed_out and tries < _AGAIN:
                hand_over(task, tries + 1)
                continue
            for following in islice(waiting, 1):
                hand_over(following, 0)
            if error is None:
                yield Outcome(task, future.result())
            elif isinstance(error, Exception):
                yield Outcome(task, error=error)
            else:
                raise error


def ordered_map(executor: Executor, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
    """What the function makes of every task, in the order of the tasks.

    Raises:
        Exception: what the function raised, or WorkerLostError.
    """
    done: dict[int, R] = {}
    following = 0
    for outcome in executor.calls(_numbered, function, enumerate(tasks)):
        if outcome.error is not None:
            raise outcome.error
        assert outcome.result is not None
        number, result = outcome.result
        done[number] = result
        while following in done:
            yield done.pop(following)
            following += 1


def _numbered(function: Callable[[T], R], task: tuple[int, T]) -> tuple[int, R]:
    return task[0], function(task[1])


def cores() -> int:
    """Cores that this process may use."""
    import os

    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _share_mb(workers: int) -> int:
    """A worker's share of the machine's memory, in MB; 0, no limit, where that is not known."""
    import os

    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 0
    return max(1024, int(0.9 * total / (1 << 20) / workers))
