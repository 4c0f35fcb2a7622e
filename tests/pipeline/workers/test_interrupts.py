"""Interrupts, also where Python would forget them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from pipeline.workers.executors import Executor
from pipeline.workers.interrupts import interrupts_noted, raise_interrupt


class Forgets:
    """Is interrupted while it is thrown away, where exceptions are printed and forgotten."""

    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))  # the signal's handler is called between two steps of the program


def interrupted_at_three(_: object, task: int) -> int:
    if task == 3:
        forgets = Forgets()
        del forgets
    return task


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_python_forgets_ends_the_run_all_the_same() -> None:
    done = []
    with interrupts_noted(), pytest.raises(KeyboardInterrupt):  # noqa: PT012 - where it is raised is what is tested
        for outcome in Executor().calls(interrupted_at_three, None, range(10)):
            done.append(outcome.task)
    assert done == [0, 1, 2]


def _interrupted() -> None:
    os.kill(os.getpid(), signal.SIGINT)
    threading.Event().wait(10.0)


def test_an_interrupt_is_raised_at_once_and_the_handler_is_put_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interrupts_noted():
        _interrupted()
    assert signal.getsignal(signal.SIGINT) is before
    with interrupts_noted():
        raise_interrupt()  # the one before is forgotten


def test_a_program_that_took_an_interrupt_ends_with_its_own_status(tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(
        "import sys\n"
        "from pipeline.workers.interrupts import interrupts_noted\n"
        "try:\n"
        "    with interrupts_noted():\n"
        "        exec('import os, signal; os.kill(os.getpid(), signal.SIGINT)')\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(130)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])}
    done = subprocess.run([sys.executable, "-m", "interrupted"], env=environment, check=False)
    assert done.returncode == 130
