"""Functions that the tests have workers call; in a module of its own, so that workers can import them."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from tests.support.waiting import wait_until


def parent(marks: str) -> None:
    """A service with two workers, one of them at work, until it is killed: tells their processes in a file."""
    from pipeline.workers.pool import WorkPool

    pool = WorkPool(2, queue=2, timeout_s=600.0)
    wait_until(pool.all_ready)
    pool.submit(time.sleep, 600.0)
    path = Path(marks)
    path.with_suffix(".tmp").write_text(" ".join(map(str, pool.pids)))
    path.with_suffix(".tmp").rename(path)
    time.sleep(600.0)


def fail_while(path: str) -> None:
    """Warm up, but not while there is such a file."""
    if Path(path).exists():
        raise OSError(28, "No space left on device", path)


def mark_and_wait(mark: str, path: str) -> int:
    """Tell that it runs, then wait for a file."""
    # whole or not at all: the worker may be killed as soon as the mark is there
    Path(f"{mark}.tmp").write_text(str(os.getpid()))
    Path(f"{mark}.tmp").rename(mark)
    wait_until(Path(path).exists)
    return os.getpid()


def is_there(path: str) -> bool:
    return Path(path).exists()


def time_out() -> None:
    raise TimeoutError("of the function")


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


def facts() -> dict[str, Any]:
    import cv2

    return {
        "interrupt": signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
        "blas": os.environ.get("OPENBLAS_NUM_THREADS"),
        "numba": os.environ.get("NUMBA_NUM_THREADS"),
        "cv2": cv2.getNumThreads(),
        "matplotlib": "matplotlib" in sys.modules,
    }


def work_for_ever() -> None:
    while True:
        sum(range(10_000))
