"""Crews on this machine: every task has one outcome, whatever becomes of its worker."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.workers.executors import Executor, InlineExecutor, PoolExecutor
from tests.support.executor_calls import dies_of_seven, dies_once, doubled, odd_fails, slow_seven

COUNT = 20


@pytest.fixture(scope="module")
def pool() -> Iterator[PoolExecutor]:
    with PoolExecutor(ReadSettings(), 2) as crew:
        yield crew


@pytest.mark.parametrize("kind", ["inline", "pool"])
def test_every_task_has_one_outcome(kind: str, pool: PoolExecutor) -> None:
    crew: Executor = InlineExecutor() if kind == "inline" else pool
    outcomes = list(crew.calls(doubled, 100, range(COUNT)))
    assert sorted(o.task for o in outcomes) == list(range(COUNT))
    assert all(o.result == 100 + 2 * o.task and o.error is None for o in outcomes)
    assert list(crew.calls(doubled, 1, [])) == []


@pytest.mark.parametrize("kind", ["inline", "pool"])
def test_an_exception_is_its_tasks_own(kind: str, pool: PoolExecutor) -> None:
    crew: Executor = InlineExecutor() if kind == "inline" else pool
    for outcome in crew.calls(odd_fails, "told", range(COUNT)):
        if outcome.task % 2:
            assert isinstance(outcome.error, ValueError)
            assert str(outcome.error) == f"told: {outcome.task} is odd"
        else:
            assert (outcome.result, outcome.error) == (outcome.task, None)


def test_tasks_are_taken_as_they_are_needed(pool: PoolExecutor) -> None:
    """Of a million parts only those at work are held."""
    taken = 0

    def endless() -> Iterator[int]:
        nonlocal taken
        while True:
            taken += 1
            yield taken

    outcomes = pool.calls(doubled, 0, endless())
    for done, _ in zip(range(1, COUNT), outcomes, strict=False):
        # each worker has one task at work and one waiting; one more is asked for with each that is done
        assert taken <= done + 4
    outcomes.close()  # type: ignore[attr-defined]


def test_a_task_that_kills_its_workers_costs_itself_alone(tmp_path: Path) -> None:
    with PoolExecutor(ReadSettings(), 2) as crew:
        outcomes = {o.task: o for o in crew.calls(dies_of_seven, str(tmp_path), range(COUNT))}
    assert sorted(outcomes) == list(range(COUNT))
    assert [task for task, o in outcomes.items() if o.error is not None] == [7]
    # tried again once, by another worker; no other task more than once
    assert len(set((tmp_path / "7.txt").read_text().split())) == 2
    assert all(len((tmp_path / f"{k}.txt").read_text().split()) == 1 for k in range(COUNT) if k != 7)


def test_a_task_whose_worker_is_killed_from_outside_is_done_by_another(tmp_path: Path) -> None:
    with PoolExecutor(ReadSettings(), 2) as crew:
        outcomes = list(crew.calls(dies_once, str(tmp_path), range(COUNT)))
    assert sorted(o.result for o in outcomes if o.result is not None) == list(range(COUNT))


def test_a_task_that_never_ends_is_given_up() -> None:
    with PoolExecutor(ReadSettings(), 2, timeout_s=1.0) as crew:
        outcomes = {o.task: o for o in crew.calls(slow_seven, "", range(COUNT))}
    assert [task for task, o in outcomes.items() if o.error is not None] == [7]
    assert "1" in str(outcomes[7].error)


@pytest.mark.parametrize(("jobs", "timeout_s"), [(0, 1.0), (-1, 1.0), (1, 0.0), (1, float("nan"))])
def test_crews_that_cannot_be(jobs: int, timeout_s: float) -> None:
    with pytest.raises(SettingsError, match="give at least 1"):
        PoolExecutor(ReadSettings(), jobs, timeout_s=timeout_s)
