"""Functions that the tests have workers call; in a module of its own, so that workers can import them."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.workers.pool import WorkPool


def wait_ready(pool: WorkPool, timeout_s: float) -> bool:
    """Wait until every worker of a pool is warm."""
    until = time.monotonic() + timeout_s
    while not pool.all_ready():
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True


def parent(marks: str) -> None:
    """A service with two workers, one of them at work, until it is killed: tells their processes in a file."""
    from pipeline.workers.pool import WorkPool

    pool = WorkPool(2, queue=2, timeout_s=600.0)
    wait_ready(pool, 120.0)
    pool.submit(time.sleep, 600.0)
    path = Path(marks)
    path.with_suffix(".tmp").write_text(" ".join(map(str, pool.pids)))
    path.with_suffix(".tmp").rename(path)
    time.sleep(600.0)


def fail_while(path: str) -> None:
    """Warm up, but not while there is such a file."""
    if Path(path).exists():
        raise OSError(28, "No space left on device", path)


def wait_for(path: str) -> str:
    """Return once there is such a file."""
    while not Path(path).exists():
        time.sleep(0.01)
    return path


def mark_and_wait(mark: str, path: str) -> int:
    """Tell that it runs, then wait for a file."""
    # whole or not at all: the worker may be killed as soon as the mark is there
    Path(f"{mark}.tmp").write_text(str(os.getpid()))
    Path(f"{mark}.tmp").rename(mark)
    wait_for(path)
    return os.getpid()


def fail_with_problem() -> None:
    from glyphs.errors import FileError

    raise FileError("a.png", "is empty", "copy it again")


class OddError(Exception):
    """Cannot be pickled there and back."""

    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def fail_oddly() -> None:
    raise OddError(1, 2)


def return_oddly() -> Any:
    return lambda: None


def take_memory(megabytes: int) -> int:
    return len(bytearray(megabytes << 20))


def leave() -> None:
    os._exit(3)


def facts() -> dict[str, Any]:
    import cv2

    return {
        "interrupt": signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
        "blas": os.environ.get("OPENBLAS_NUM_THREADS"),
        "numba": os.environ.get("NUMBA_NUM_THREADS"),
        "cv2": cv2.getNumThreads(),
        "matplotlib": "matplotlib" in sys.modules,
    }
