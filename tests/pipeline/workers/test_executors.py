"""Executors on this machine: every task has one outcome, whatever becomes of its worker."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from pipeline.workers.executors import Executor, ordered_map
from pipeline.workers.interrupts import interrupts_noted, raise_interrupt
from pipeline.workers.options import WorkerSettings
from pipeline.workers.pool import WorkPool
from tests.support.executor_calls import dies_of_seven, dies_once, doubled, late_first, odd_fails, pids_of

COUNT = 20


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkPool]:
    with WorkPool(2) as executor:
        yield executor


@pytest.fixture(params=["inline", "pool"])
def executor(request: pytest.FixtureRequest, pool: WorkPool) -> Executor:
    return pool if request.param == "pool" else Executor()


def test_every_task_has_one_outcome(executor: Executor) -> None:
    outcomes = list(executor.calls(doubled, 100, range(COUNT)))
    assert sorted(o.task for o in outcomes) == list(range(COUNT))
    assert all(o.result == 100 + 2 * o.task and o.error is None for o in outcomes)
    assert list(executor.calls(doubled, 1, [])) == []


def test_an_exception_is_its_tasks_own(executor: Executor) -> None:
    for outcome in executor.calls(odd_fails, "told", range(COUNT)):
        if outcome.task % 2:
            assert isinstance(outcome.error, ValueError)
            assert str(outcome.error) == f"told: {outcome.task} is odd"
        else:
            assert (outcome.result, outcome.error) == (outcome.task, None)


def test_a_map_keeps_the_order_of_its_tasks(executor: Executor) -> None:
    assert list(ordered_map(executor, late_first, range(COUNT))) == [-k for k in range(COUNT)]
    with pytest.raises(ValueError, match="told: 3 is odd"):
        list(ordered_map(executor, partial(odd_fails, "told"), [2, 3, 4]))


def test_tasks_are_taken_as_they_are_needed(pool: WorkPool) -> None:
    """Of a million parts only those at work are held."""
    taken = 0

    def endless() -> Iterator[int]:
        nonlocal taken
        while True:
            taken += 1
            yield taken

    outcomes = pool.calls(doubled, 0, endless())
    for done, _ in zip(range(1, 20 * COUNT), outcomes, strict=False):
        # each worker has at most 32 short tasks at work and as many waiting
        assert taken <= done + 2 * 2 * 32
    outcomes.close()  # type: ignore[attr-defined]


def test_a_task_that_kills_its_workers_costs_itself_alone(tmp_path: Path) -> None:
    with WorkPool(2) as executor:
        outcomes = {o.task: o for o in executor.calls(dies_of_seven, str(tmp_path), range(COUNT))}
    assert sorted(outcomes) == list(range(COUNT))
    assert [task for task, o in outcomes.items() if o.error is not None] == [7]
    # tried again once, by another worker; no other task more than once
    assert len(set((tmp_path / "7.txt").read_text().split())) == 2
    assert all(len((tmp_path / f"{k}.txt").read_text().split()) == 1 for k in range(COUNT) if k != 7)


def test_a_task_whose_worker_is_killed_from_outside_is_done_by_another(tmp_path: Path) -> None:
    with WorkPool(2) as executor:
        outcomes = list(executor.calls(dies_once, str(tmp_path), range(COUNT)))
    assert sorted(o.result for o in outcomes if o.result is not None) == list(range(COUNT))


@pytest.mark.parametrize(
    ("jobs", "parts", "workers"), [(None, 1, 1), (1, 500, 1), (2, 500, 2), (4, 2, 2), (1, 0, 1), (3, None, 3)]
)
def test_no_more_workers_than_parts_and_none_before_there_is_work(
    jobs: int | None, parts: int | None, workers: int
) -> None:
    with WorkerSettings(jobs=jobs).opened(parts) as executor:
        assert isinstance(executor, WorkPool)
        assert (executor.workers, pids_of(executor)) == (workers, ())


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
