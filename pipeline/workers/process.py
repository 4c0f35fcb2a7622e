"""A worker process with limits of memory and cores, which makes the calls that it receives until its parent ends."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from glyphs.compiling import end_part, show_compiling
from glyphs.errors import MarksError
from pipeline.workers.executors import WorkerLostError

# keep freed memory in the process: maps of tens of megabytes would be returned and cleared each time
MALLOC = {"MALLOC_TRIM_THRESHOLD_": str(1 << 30), "MALLOC_MMAP_THRESHOLD_": str(1 << 30)}
_THREADS = (
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"),
    *("NUMBA_NUM_THREADS", "NUMEXPR_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"),
)
LOOK_S = 0.25
# least share of its time limit for which a slow worker had a core; with less, the machine was busy
_STARVED = 0.5
_PR_SET_PDEATHSIG = 1
_MB = 1 << 20
# exit codes of workers that were killed by a person, or by a system short of memory
_FROM_OUTSIDE = (None, -signal.SIGTERM, -getattr(signal, "SIGKILL", 9), -signal.SIGINT)


@dataclass(frozen=True)
class Answer:
    """Value that a function returned."""

    value: Any


class Shared:
    """An argument of many calls: pickled once, and unpickled once by each worker, which caches it."""

    def __init__(self, value: Any) -> None:
        self._data = pickle.dumps(value)

    def __reduce__(self) -> tuple[Callable[[bytes], Any], tuple[bytes]]:
        return _unpickle, (self._data,)


@lru_cache(maxsize=2)
def _unpickle(data: bytes) -> Any:
    return pickle.loads(data)


class Worker:
    """A worker process, from the parent's side."""

    def __init__(self, number: int, modules: Sequence[str] = ()) -> None:
        """Import some modules at once; only number 0 reports what is compiled. Raises OSError: it cannot start."""
        for name, value in MALLOC.items():  # read as a process starts
            os.environ.setdefault(name, value)
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        arguments = (theirs, modules, number == 0)
        self.process = context.Process(target=_serve, args=arguments, daemon=True)
        try:
            self.process.start()
        except BaseException:
            self._pipe.close()
            raise
        finally:
            theirs.close()

    def limit(self, memory_mb: int) -> None:
        with contextlib.suppress(OSError):  # the process has died; the first call finds it
            self._pipe.send(memory_mb)

    @property
    def is_alive(self) -> bool:
        return self.process.exitcode is None

    def ask(
        self, call: bytes, timeout_s: float, late: str, stopped: Callable[[], bool] = lambda: False
    ) -> Answer | Exception:
        """Let the process make a pickled call; its result, or a WorkerLostError. `late` is its message after
        `timeout_s`, with {} for the seconds; `stopped` is called now and then, and True ends the wait."""
        with contextlib.suppress(OSError):  # the process has died; the wait below finds it
            self._pipe.send_bytes(call)
        until = time.monotonic() + timeout_s
        before_s = self._core_s() if timeout_s < 4.0 * LOOK_S else None  # a quick call of a part needs none
        while not stopped():
            left_s = until - time.monotonic()
            ready = wait([self._pipe, self.process.sentinel], max(0.0, min(LOOK_S, left_s)))
            if self._pipe in ready:
                with contextlib.suppress(Exception):  # a message cut short by a kill may be anything
                    answer: Answer | Exception = self._pipe.recv()
                    return answer
            if ready:
                self.process.join(1.0)
                code = self.process.exitcode
                return WorkerLostError(
                    f"the worker has ended (exit code {code})", crashed=code not in _FROM_OUTSIDE
                )
            if left_s <= 0.0:
                starved = before_s is not None and self._core_s() - before_s < _STARVED * timeout_s
                return WorkerLostError(late.format(f"{timeout_s:g}"), timed_out=True, starved=starved)
            before_s = self._core_s() if before_s is None else before_s
        return WorkerLostError("the workers are stopping")

    def _core_s(self) -> float:
        """Processor time of the process, s; the wall-clock time where that is not known."""
        try:
            stat = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="ascii", errors="replace")
            return sum(map(int, stat.rpartition(")")[2].split()[11:13])) / os.sysconf("SC_CLK_TCK")
        except (OSError, ValueError, AttributeError):
            return time.monotonic()

    def kill(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            self.process.kill()

    def end(self, grace_s: float = 0.0) -> None:
        """Close the pipe, whereupon the process ends by itself, and kill it after the grace period."""
        self._pipe.close()
        if self.is_alive:
            self.process.join(grace_s)
        self.kill()
        self.process.join()


# the worker of `started_early`, until a pool uses it
_EARLY: list[Worker] = []


@contextlib.contextmanager
def started_early(modules: Sequence[str]) -> Iterator[None]:
    """Let a worker import modules while this process imports its own; a pool within the block uses that worker."""
    with contextlib.suppress(OSError):  # the pool tries again, and says why
        _EARLY.append(Worker(0, modules))
    try:
        yield
    finally:
        for worker in _EARLY:
            worker.end()
        _EARLY.clear()


def worker_of(number: int, memory_mb: int) -> Worker:
    """Start a worker with a memory limit; number 0 may have been started early. Raises OSError: it cannot start."""
    worker = _EARLY.pop() if _EARLY and number == 0 else Worker(number)
    worker.limit(memory_mb)
    return worker


def _serve(pipe: Connection, modules: Sequence[str], shows: bool) -> None:
    gc.set_threshold(10_000)  # modules make many objects that stay
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if sys.platform == "linux":
        # native code that holds the interpreter lock would block that thread
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    # the parent gets the signal; it then ends its workers
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # before the libraries are loaded
    for name in modules:
        # a failed import is reported by the call that needs the module
        with contextlib.suppress(Exception):
            importlib.import_module(name)
    say = partial(print, file=sys.stderr, flush=True)
    with show_compiling(say) if shows else contextlib.nullcontext(), contextlib.suppress(EOFError, OSError):
        _keep_to(pipe.recv())
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))
            end_part()


def _keep_to(memory_mb: int) -> None:
    """Limit the memory that this process uses, not its address space, of which libraries reserve far more."""
    if memory_mb > 0:
        with contextlib.suppress(ImportError):  # not on Windows
            import resource

            resource.setrlimit(resource.RLIMIT_DATA, (memory_mb * _MB, memory_mb * _MB))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(0)


def pickled_call(function: Callable[..., Any], *args: Any) -> bytes:
    """Pickle a call of a module's function for a worker; raises whatever pickling raises."""
    return pickle.dumps((function, args))


def _answer(call: bytes) -> bytes:
    try:
        function, args = pickle.loads(call)
        return pickle.dumps(Answer(function(*args)))
    except Exception as error:
        if not isinstance(error, MarksError):  # a fault of the program is reported with its traceback
            error.add_note("".join(traceback.format_exception(error)))
        return pickle.dumps(_sendable(error))


def _sendable(error: Exception) -> Exception:
    with contextlib.suppress(Exception):
        if type(pickle.loads(pickle.dumps(error))) is type(error):
            return error
    return RuntimeError(f"{type(error).__name__}: {error}")
