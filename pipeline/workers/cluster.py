"""A Dask cluster as an executor: workers on many machines, of which any may be lost.

Dask gives the task of a lost worker to another one, and gives up a task that several workers have died of. It blames
all that such a worker had before it, though one alone has killed it: where several are blamed, each is tried once
more by itself, when all others are done.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import islice
from types import TracebackType
from typing import Any

from glyphs.errors import MarksError
from pipeline.workers.executors import O, Outcome, R, T
from pipeline.workers.interrupts import raise_interrupt

_CONNECT_S = 10.0
_START_S = 120.0
"""How long the connection's thread may take to start: the library allows ten seconds a try, a frozen machine more."""
_LOOK_S = 2.0
_AHEAD = 3
_LEAST_AHEAD = 8
_MOST_TRIES = 4
_ONE_AT_A_TIME = threading.Lock()
"""Readers and their templates are not shared between threads."""


class ClusterError(MarksError):
    """A cluster that cannot be used, or is lost."""


class OtherProgramError(MarksError):
    """A worker has another version of the program: its answers do not belong to this run."""


class WorkersDiedError(RuntimeError):
    """Workers were lost again and again while they had a task."""


class ClusterExecutor:
    """The workers of a Dask scheduler."""

    def __init__(self, address: str, *, patience_s: float = 120.0, connect_s: float = _CONNECT_S) -> None:
        """Tell where; the connection is made with the block.

        Args:
            address: of the scheduler, such as tcp://scheduler:8786.
            patience_s: how long there may be no worker at all.
            connect_s: how long the scheduler may take to answer.
        """
        self.address, self.patience_s, self._connect_s = address, patience_s, connect_s
        self.workers = 0

    def __enter__(self) -> ClusterExecutor:
        """Connect, wait for a worker, and see that all run this program.

        Raises:
            ClusterError: no scheduler, no worker, or one with another version of the program.
            MissingExtraError: the extra `cluster` is not installed.
        """
        require_distributed()
        import distributed

        connect: Any = partial(
            distributed.Client, self.address, timeout=self._connect_s, set_as_default=False
        )
        try:
            self._client = _connected(connect)
        except AssertionError as error:
            raise ClusterError(
                "the connection to the scheduler does not start: this machine is too busy",
                hint="try again, or leave a core free",
            ) from error
        except (OSError, ValueError, TypeError) as error:
            raise ClusterError(
                f"no Dask scheduler answers at {self.address} ({_first_line(error)})",
                hint="start one with: dask scheduler",
            ) from error
        try:
            self._wait_for_workers()
            self._check_programs()
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def calls(self, function: Callable[[O, T], R], order: O, tasks: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """See `pipeline.workers.executors.Executor`.

        Raises:
            ClusterError: the scheduler is lost, or no worker has been left for too long.
        """
        client = self._client
        # a task like the others, so that it is made anew where the workers that held it are lost
        shared = client.submit(_same, order, pure=False)
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        held: dict[Any, tuple[T, int]] = {}
        blamed: list[Outcome[T, R]] = []
        alone = False
        waiting = iter(tasks)

        def hand_over(given: Iterable[T], tries: int = 1) -> None:
            for task in given:
                future: Any = client.submit(_called, self._mark, function, shared, task, pure=False)
                held[future] = (task, tries)
                future.add_done_callback(done.put)

        hand_over(islice(waiting, self._ahead()))
        last_seen = looked = time.monotonic()
        while held or blamed:
            if not held:
                if len(blamed) == 1 and not alone:
                    # whoever kills is blamed each time, so one that is blamed by itself has killed
                    yield blamed.pop()
                    continue
                alone = True
                hand_over([blamed.pop().task])
            try:
                future = done.get(timeout=_LOOK_S)
            except queue.Empty:
                future = None
            raise_interrupt()
            now = time.monotonic()
            if future is None or now - looked > _LOOK_S:
                looked = now
                if self.count():
                    last_seen = now
                elif client.status != "running":
                    raise self._lost()
                elif now - last_seen > self.patience_s:
                    raise ClusterError(
                        f"no worker has been at {self.address} for {self.patience_s:.0f} s",
                        hint="start some and run the same command again",
                    )
            if future is None:
                pass
            elif future.status in ("lost", "pending"):
                # its worker was lost with the result, which another one makes anew
                future.add_done_callback(done.put)
            else:
                task, tries = held.pop(future)
                outcome: Outcome[T, R] | None = self._outcome(future, task)
                if outcome is not None and isinstance(outcome.error, WorkersDiedError) and not alone:
                    blamed.append(outcome)
                elif outcome is not None:
                    yield outcome
                elif not self.count() and client.status != "running":
                    raise self._lost()
                elif tries < _MOST_TRIES:
                    hand_over([task], tries + 1)
                else:
                    yield Outcome(task, error=RuntimeError("its result was lost again and again on its way"))
            hand_over(islice(waiting, max(0, self._ahead() - len(held))))

    def _outcome(self, future: Any, task: T) -> Outcome[T, R] | None:
        """What became of a task; None where that was lost on its way, and the task is to be handed over again."""
        from distributed.scheduler import KilledWorker

        fault = None
        if future.status == "finished":
            with contextlib.suppress(Exception):
                return Outcome(task, future.result())
        if future.status == "error":
            fault = future.exception()
        if isinstance(fault, OtherProgramError):
            raise ClusterError(fault.what, hint=fault.hint) from fault
        if isinstance(fault, KilledWorker):
            fault = WorkersDiedError("several workers have died of it, perhaps for want of memory")
        return None if fault is None else Outcome(task, error=fault)

    def _lost(self) -> ClusterError:
        return ClusterError(
            f"the scheduler at {self.address} is lost", hint="start it and run the same command again"
        )

    def _ahead(self) -> int:
        return max(_LEAST_AHEAD, _AHEAD * self.workers)

    def count(self) -> int:
        """Tasks that the workers can be at, all together; 0 where the scheduler does not answer."""
        with contextlib.suppress(Exception):
            self.workers = sum(self._client.nthreads().values())
            return self.workers
        return 0

    def _wait_for_workers(self) -> None:
        until = time.monotonic() + self.patience_s
        while not self.count():
            if time.monotonic() > until:
                raise ClusterError(
                    f"the scheduler at {self.address} has no workers",
                    hint=f"start some with: tactile-marks worker {self.address}",
                )
            time.sleep(0.2)

    def _check_programs(self) -> None:
        self._mark = ours = _own_mark()
        try:
            theirs = self._client.run(_own_mark, on_error="return")
        except Exception as error:
            raise ClusterError(
                f"the workers of {self.address} do not answer ({_first_line(error)})"
            ) from error
        for worker, mark in theirs.items():
            if isinstance(mark, Exception):
                raise ClusterError(
                    f"worker {worker} cannot run this program ({_first_line(mark)})",
                    hint="install tactile-marks there",
                )
            if mark != ours:
                raise ClusterError(_other_program(worker))

    def _close(self) -> None:
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)


def _connected(connect: Callable[[], Any]) -> Any:
    """What `connect` gives: its thread has ten seconds to start, too few where all cores are busy."""
    until = time.monotonic() + _START_S
    while True:
        try:
            return connect()
        except AssertionError:
            if time.monotonic() >= until:
                raise


def _same(order: Any) -> Any:
    return order


def _own_mark() -> str:
    from pipeline.common.version import program_mark

    return program_mark()


def _called(mark: str, function: Callable[[O, T], R], order: O, task: T) -> R:
    """In a worker, which may have come later than the others, and may have several threads."""
    if _own_mark() != mark:
        import socket

        raise OtherProgramError(_other_program(socket.gethostname()))
    with _ONE_AT_A_TIME:
        _keep_to_one_core()
        return function(order, task)


def _keep_to_one_core() -> None:
    """The other workers have the other cores; numba has it set thread by thread."""
    import numba

    from glyphs.opencv import cv2

    cv2.setNumThreads(1)
    with contextlib.suppress(ValueError):
        numba.set_num_threads(1)


def _other_program(worker: str) -> str:
    return f"worker {worker} runs another version of this program; install the same one everywhere"


def require_distributed() -> None:
    """See that the library is there.

    Raises:
        MissingExtraError: the extra `cluster` is not installed.
    """
    from importlib.util import find_spec

    from glyphs.errors import MissingExtraError

    if find_spec("distributed") is None:
        raise MissingExtraError("a cluster", "distributed", "cluster")


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
