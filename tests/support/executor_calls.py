"""Functions that workers are asked to call: those of a test module are not theirs."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.support.waiting import wait_until

if TYPE_CHECKING:
    from pipeline.workers.pool import WorkPool

# ---------------------------------------------------------------------------------------------------- executor calls


def doubled(order: int, task: int) -> int:
    return order + 2 * task


def odd_fails(order: str, task: int) -> int:
    if task % 2:
        raise ValueError(f"{order}: {task} is odd")
    return task


def late_first(task: int) -> int:
    """The first task is done last of those at work with it."""
    if task == 0:
        time.sleep(0.2)
    return -task


def dies_of_seven(folder: str, task: int) -> int:
    """Kill the worker that has to do with 7, every time; note who tried what."""
    with Path(folder, f"{task}.txt").open("a") as stream:
        stream.write(f"{os.getpid()}\n")
    if task == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return task


def dies_once(folder: str, task: int) -> int:
    """Kill the first worker that has to do with 3."""
    mark = Path(folder, "died")
    if task == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return task


def noted(folder: str, task: int) -> int:
    """Take a little while, so that a worker can be lost in the middle; note who did it."""
    time.sleep(0.05)
    Path(folder, f"{task}.txt").write_text(f"{os.getpid()}\n")
    return task


# -------------------------------------------------------------------------------------------------------- pool calls


def pids_of(pool: WorkPool) -> tuple[int, ...]:
    """Process ids of the living workers of a pool."""
    workers = [slot.worker for slot in pool._slots]
    return tuple(w.process.pid for w in workers if w is not None and w.is_alive and w.process.pid)


def parent(marks: str) -> None:
    """A service with two workers, one of them at work, until it is killed: tells their processes in a file."""
    from pipeline.workers.pool import WorkPool

    pool = WorkPool(2, queue=2, timeout_s=600.0)
    wait_until(pool.all_ready)
    pool.submit(time.sleep, 600.0)
    path = Path(marks)
    path.with_suffix(".tmp").write_text(" ".join(map(str, pids_of(pool))))
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
