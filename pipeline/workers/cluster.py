"""A Dask cluster as an executor: workers on many machines, any of which may be lost. Dask blames all tasks that a
worker held, though only one has killed it: if several are blamed, `Executor.calls` tries each once more by itself."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from typing import Any, cast

from glyphs.errors import MarksError, MissingExtraError
from pipeline.common import version
from pipeline.workers.executors import Executor, Outcome, WorkerLostError

# longest time for the scheduler to answer, seconds
_CONNECT_S = 10.0
# longest time for the connection's thread to start, seconds; the library's ten are too few on a busy machine
_START_S = 120.0
# seconds between two checks of scheduler and workers
_LOOK_S = 2.0
# tasks submitted at a time for each worker, and in all at least
_AHEAD, _LEAST_AHEAD = 3, 8
# readers and their templates are not shared between threads
_ONE_AT_A_TIME = threading.Lock()


class ClusterError(MarksError):
    """The cluster cannot be used, or is lost."""

    is_usage = False


class ClusterExecutor(Executor):
    """The workers of a Dask scheduler; `patience_s` is the longest time without any worker."""

    remote = True

    def __init__(self, address: str, *, patience_s: float = 120.0) -> None:
        self.address, self.patience_s = address, patience_s
        self.workers = 0

    def __enter__(self) -> ClusterExecutor:
        """Connect, wait for a worker, and check that all run this program. Raises ClusterError, MissingExtraError."""
        require_distributed()
        self._client = self._connect()
        try:
            self._seen_s = self._looked_s = time.monotonic()
            while not self.count():
                if time.monotonic() > self._seen_s + self.patience_s:
                    hint = f"start some with: tactile-marks worker {self.address}"
                    raise ClusterError(f"the scheduler at {self.address} has no workers", hint=hint)
                time.sleep(0.2)
            self._check_programs()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)

    def count(self) -> int:
        with contextlib.suppress(Exception):
            self.workers = sum(self._client.nthreads().values())
            return self.workers
        return 0

    def _ahead(self) -> int:
        return max(_LEAST_AHEAD, _AHEAD * self.workers)

    def _shared(self, order: Any) -> Any:
        self._seen_s = self._looked_s = time.monotonic()
        # a task like the others, so that Dask repeats it if the workers that held it are lost
        return self._client.submit(_same, order, pure=False)

    def submit(self, function: Callable[..., Any], *args: Any) -> Any:
        return self._client.submit(_call_in_worker, self._mark, function, *args, pure=False)

    def _next(self, done: queue.SimpleQueue[Any]) -> Any:
        while True:
            future = None
            with contextlib.suppress(queue.Empty):
                future = done.get(timeout=_LOOK_S)
            self._look(at_once=future is None)
            if future is not None and future.status not in ("lost", "pending"):
                return future
            if future is not None:  # its worker was lost with the result; another one repeats the task
                future.add_done_callback(done.put)

    def _look(self, *, at_once: bool) -> None:
        now = time.monotonic()
        if not at_once and now - self._looked_s <= _LOOK_S:
            return
        self._looked_s = now
        if self.count():
            self._seen_s = now
        elif self._client.status != "running":
            what = f"the scheduler at {self.address} is lost"
            raise ClusterError(what, hint="start it and run the same command again")
        elif now - self._seen_s > self.patience_s:
            what = f"no worker has been connected to {self.address} for {self.patience_s:.0f} s"
            raise ClusterError(what, hint="start some and run the same command again")

    def _outcome(self, future: Any, task: Any) -> Outcome[Any, Any]:
        from distributed.scheduler import KilledWorker

        if future.status == "finished":
            with contextlib.suppress(Exception):
                return Outcome(task, future.result())
        fault = future.exception() if future.status == "error" else None
        if isinstance(fault, ClusterError):  # another version's answers do not belong to this run
            raise fault
        if isinstance(fault, KilledWorker):
            fault = WorkerLostError(
                "several workers have died with it, perhaps for lack of memory", tried=True
            )
        elif fault is None:
            self._look(at_once=True)
            fault = WorkerLostError("its result was lost twice on the way")
        return Outcome(task, error=fault)

    def _connect(self) -> Any:
        """The client's thread has ten seconds to start, too few if all cores are busy."""
        import distributed

        self._check_scheduler()
        until = time.monotonic() + _START_S
        while True:
            try:
                connect: Any = distributed.Client
                return connect(self.address, timeout=_CONNECT_S, set_as_default=False)
            except AssertionError as error:
                if time.monotonic() >= until:
                    what = "the connection to the scheduler does not start: this machine is too busy"
                    raise ClusterError(what, hint="try again, or leave a core free") from error
            except (OSError, ValueError, TypeError) as error:
                raise self._no_scheduler(error) from error

    def _check_scheduler(self) -> None:
        """Ask the address what it is: with anything else `Client` would try for ever, or end in a traceback."""
        with ThreadPoolExecutor(1) as thread:  # it has a loop of its own, unlike a notebook's thread
            try:
                kind = thread.submit(asyncio.run, _kind_of_server(self.address)).result()
            except TimeoutError as error:
                raise self._no_scheduler(TimeoutError(f"silent for {_CONNECT_S:g} s")) from error
            except (OSError, ValueError, TypeError) as error:
                raise self._no_scheduler(error) from error
            except Exception as error:  # whatever comes of reading what is no message of Dask
                raise self._no_scheduler(ValueError("something else is there")) from error
        if kind != "Scheduler":
            raise self._no_scheduler(ValueError(f"it is a {kind}"))

    def _no_scheduler(self, error: BaseException) -> ClusterError:
        what = f"no Dask scheduler answers at {self.address} ({_first_line(error)})"
        return ClusterError(what, hint="start one with: dask scheduler")

    def _check_programs(self) -> None:
        self._mark = _own_mark()
        try:
            theirs = self._client.run(_own_mark, on_error="return")
        except Exception as error:
            what = f"the workers of {self.address} do not answer ({_first_line(error)})"
            raise ClusterError(what) from error
        for worker, mark in theirs.items():
            if isinstance(mark, Exception):
                what = f"worker {worker} cannot run this program ({_first_line(mark)})"
                raise ClusterError(what, hint="install tactile-marks there")
            if mark != self._mark:
                raise ClusterError(_other_program(worker))


async def _kind_of_server(address: str) -> str:
    from distributed import core, security

    dask_core, dask_security = cast(Any, core), cast(Any, security)
    async with asyncio.timeout(_CONNECT_S):
        options = dask_security.Security().get_connection_args("client")
        # earlier than the whole, so that the library can say why
        comm = await dask_core.connect(address, timeout=0.8 * _CONNECT_S, **options)
        try:
            await comm.write({"op": "identity", "reply": True})
            return str((await comm.read())["type"])
        finally:
            comm.abort()


def _own_mark() -> str:
    return version.program_mark()


def _same(order: Any) -> Any:
    return order


def _call_in_worker(mark: str, function: Callable[..., Any], *args: Any) -> Any:
    """Call a function in a worker, which may have joined after the check of programs, and may have several threads."""
    if _own_mark() != mark:
        raise ClusterError(_other_program(socket.gethostname()))
    with _ONE_AT_A_TIME:
        _keep_to_one_core()
        return function(*args)


def _keep_to_one_core() -> None:
    """Use one core only, since other workers use the others; numba needs this in every thread."""
    import numba

    from glyphs.opencv import cv2

    cv2.setNumThreads(1)
    with contextlib.suppress(ValueError):
        numba.set_num_threads(1)


def _other_program(worker: str) -> str:
    return f"worker {worker} runs another version of this program; install the same one everywhere"


def require_distributed() -> None:
    """Check that the library is installed. Raises MissingExtraError: it is not."""
    if find_spec("distributed") is None:
        raise MissingExtraError("a cluster", "distributed", "cluster")


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
