"""Functions that workers of an executor are asked to call: those of a test module are not theirs."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


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


def noted_by_two(folder: str, task: int) -> int:
    """Note who did it; return when two processes have, however long one of them takes to begin."""
    Path(folder, f"{task}.txt").write_text(f"{os.getpid()}\n")
    until = time.monotonic() + 60.0
    while time.monotonic() < until and len({p.read_text() for p in Path(folder).iterdir()} - {""}) < 2:
        time.sleep(0.01)
    return task
