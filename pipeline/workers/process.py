"""A worker process: keeps to its memory and its core, and calls what it is sent until its parent is gone."""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from glyphs.compiling import end_part, show_compiling

_THREADS = (
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"),
    *("NUMBA_NUM_THREADS", "NUMEXPR_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"),
)
_PR_SET_PDEATHSIG = 1
_MB = 1 << 20


@dataclass(frozen=True)
class Answer:
    """What a function returned."""

    value: Any


def serve_jobs(
    pipe: Connection, life: Connection, memory_mb: int, warm_up: Callable[[], object] | None
) -> None:
    """Call the functions that come through the pipe, and send back `Answer` or the exception.

    Args:
        pipe: (function, arguments) in, answers out; the first answer says that the worker is warm, or is the exception
            that kept it from it.
        life: nothing ever comes through it; it closes when the parent ends.
        memory_mb: to keep to; 0: no limit.
        warm_up: called first.
    """
    _end_with_parent(life)
    # the parent gets the signal; it then ends its workers
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    for name in _THREADS:
        os.environ[name] = "1"  # before the libraries are loaded
    _bound_memory(memory_mb)
    first = multiprocessing.current_process().name.endswith("-0")  # the others compile the same
    with show_compiling(_say) if first else contextlib.nullcontext():
        if warm_up is not None:
            try:
                warm_up()
            except Exception as error:
                pipe.send(_sendable(error))
                raise
            end_part()
        pipe.send(Answer(None))
        _serve(pipe)


def load(modules: Sequence[str]) -> None:
    """Import modules, for the first job to find them; one that cannot be imported is the job's fault."""
    for name in modules:
        with contextlib.suppress(Exception):
            importlib.import_module(name)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _serve(pipe: Connection) -> None:
    while True:
        try:
            function, args = pipe.recv()
        except (EOFError, OSError):
            return
        except Exception as error:  # a function that cannot be found here
            pipe.send(_sendable(error))
            continue
        try:
            pipe.send(_called(function, args))
            end_part()
        except OSError:
            return


def _called(function: Any, args: tuple[Any, ...]) -> Any:
    try:
        answer = Answer(function(*args))
        pickle.dumps(answer)
    except Exception as error:
        return _sendable(error)
    return answer


def _sendable(error: Exception) -> Exception:
    """The exception, or its words where it cannot be pickled there and back."""
    try:
        if type(pickle.loads(pickle.dumps(error))) is type(error):
            return error
    except Exception:
        pass
    return RuntimeError(f"{type(error).__name__}: {error}")


def _end_with_parent(life: Connection) -> None:
    """End this process when its parent does, even by `kill -9`."""

    def watch() -> None:
        try:
            life.recv_bytes()
        except (EOFError, OSError):
            os._exit(0)

    threading.Thread(target=watch, daemon=True).start()
    if sys.platform == "linux":
        # native code that holds the interpreter would keep the thread from seeing it
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _bound_memory(limit_mb: int) -> None:
    if limit_mb <= 0:
        return
    try:
        import resource
    except ImportError:  # not on Windows
        return
    # what is written to, that is: libraries reserve far more addresses than they use
    resource.setrlimit(resource.RLIMIT_DATA, (limit_mb * _MB, limit_mb * _MB))
