from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.settings import SettingsError
from pipeline.workers.executors import WorkerLostError
from pipeline.workers.pool import BusyError, WorkPool
from tests.support import executor_calls as calls
from tests.support.waiting import PATIENCE_S, is_alive, wait_until


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkPool]:
    with WorkPool(1, queue=2, timeout_s=PATIENCE_S, memory_mb=2048) as pool:
        yield pool


def test_function_is_called_in_another_process(pool: WorkPool) -> None:
    assert pool.submit(os.getpid).result(PATIENCE_S) != os.getpid()
    wait_until(pool.all_ready)
    assert pool.ready()


def test_exceptions_come_back_as_they_are(pool: WorkPool) -> None:
    with pytest.raises(FileError) as caught:
        pool.submit(calls.fail_with_problem).result(PATIENCE_S)
    assert (caught.value.what, caught.value.hint) == ("is empty", "copy it again")
    with pytest.raises(RuntimeError, match="OddError: 1 and 2"):
        pool.submit(calls.fail_oddly).result(PATIENCE_S)


def test_what_cannot_be_pickled_is_told(pool: WorkPool) -> None:
    with pytest.raises(Exception, match=r"pickle|local object"):
        pool.submit(calls.return_oddly).result(PATIENCE_S)
    with pytest.raises(Exception, match=r"pickle|local object"):
        pool.submit(lambda: None).result(PATIENCE_S)
    assert pool.submit(os.getpid).result(PATIENCE_S)


def test_memory_is_bounded(pool: WorkPool) -> None:
    before = calls.pids_of(pool)
    with pytest.raises(MemoryError):
        pool.submit(calls.take_memory, 4096).result(PATIENCE_S)
    assert pool.submit(calls.take_memory, 100).result(PATIENCE_S) == 100 << 20
    assert calls.pids_of(pool) == before


def test_workers_use_one_thread_and_leave_interrupts_to_the_service(pool: WorkPool) -> None:
    facts = pool.submit(calls.facts).result(PATIENCE_S)
    assert facts["interrupt"]
    assert (facts["blas"], facts["numba"], facts["cv2"]) == ("1", "1", 1)


def test_more_than_may_wait_are_refused_at_once(pool: WorkPool, tmp_path: Path) -> None:
    go, mark = tmp_path / "go", tmp_path / "mark"
    first = pool.submit(calls.mark_and_wait, str(mark), str(go))
    wait_until(mark.exists)
    second, third = pool.submit(os.getpid), pool.submit(os.getpid)
    assert pool.waiting == 2
    assert pool.running == 1
    with pytest.raises(BusyError) as caught:
        pool.submit(os.getpid)
    assert caught.value.retry_after_s >= 1.0
    assert not first.done()
    go.touch()
    assert first.result(PATIENCE_S) == second.result(PATIENCE_S) == third.result(PATIENCE_S)
    wait_until(lambda: pool.running == 0)
    assert pool.submit(os.getpid).result(PATIENCE_S)


def test_a_call_goes_before_the_waiting_jobs_and_waits_no_longer_than_it_may(
    pool: WorkPool, tmp_path: Path
) -> None:
    go, mark, second_mark = tmp_path / "go", tmp_path / "mark", tmp_path / "second"
    first = pool.submit(calls.mark_and_wait, str(mark), str(go))
    wait_until(mark.exists)
    second = pool.submit(calls.mark_and_wait, str(second_mark), str(go))
    with pytest.raises(BusyError):  # the worker is at the first job
        pool.call(os.getpid, free_s=0.05, timeout_s=PATIENCE_S)
    assert pool.waiting == 1  # what nobody waits for is not done
    with ThreadPoolExecutor(1) as thread:
        later = thread.submit(
            pool.call, calls.is_there, str(second_mark), free_s=PATIENCE_S, timeout_s=PATIENCE_S
        )
        wait_until(lambda: pool.waiting == 2)
        go.touch()
        assert later.result() is False  # before the second job
    assert first.result(PATIENCE_S) == second.result(PATIENCE_S)
    with pytest.raises(TimeoutError, match="of the function"):
        pool.call(calls.time_out, free_s=PATIENCE_S, timeout_s=PATIENCE_S)


def test_killed_worker_costs_its_own_job_only_and_an_idle_one_none(pool: WorkPool, tmp_path: Path) -> None:
    go, mark = tmp_path / "go", tmp_path / "mark"
    doomed = pool.submit(calls.mark_and_wait, str(mark), str(go))
    waiting = pool.submit(os.getpid)
    wait_until(mark.exists)
    os.kill(int(mark.read_text()), signal.SIGKILL)
    with pytest.raises(WorkerLostError, match="exit code -9") as caught:
        doomed.result(PATIENCE_S)
    assert not caught.value.timed_out
    idle = waiting.result(PATIENCE_S)
    assert idle != int(mark.read_text())
    os.kill(idle, signal.SIGKILL)
    wait_until(lambda: calls.pids_of(pool) not in ((), (idle,)) and pool.ready())
    assert pool.submit(os.getpid).result(PATIENCE_S) != idle


def test_jobs_end_with_the_cause_while_no_worker_can_start(tmp_path: Path) -> None:
    full = tmp_path / "full"
    full.touch()
    with WorkPool(1, warm_up=partial(calls.fail_while, str(full))) as pool:
        for future in [pool.submit(os.getpid), pool.submit(os.getpid)]:
            with pytest.raises(
                WorkerLostError, match="no worker can start: OSError: No space left"
            ) as caught:
                future.result(PATIENCE_S)
            assert not caught.value.timed_out
            assert not caught.value.crashed
        assert "No space left on device" in pool.trouble
        assert str(full) not in pool.trouble
        assert not pool.ready()
        full.unlink()
        wait_until(pool.all_ready)
        assert pool.trouble == ""
        assert pool.submit(os.getpid).result(PATIENCE_S)


def test_a_worker_that_dies_before_it_is_ready_is_told_with_its_memory() -> None:
    with (
        WorkPool(1, memory_mb=4096, warm_up=partial(os._exit, 3)) as pool,
        pytest.raises(WorkerLostError, match=r"exit code 3\); it may use 4096 MB of memory"),
    ):
        pool.submit(os.getpid).result(PATIENCE_S)


@pytest.mark.parametrize(("of_all", "own"), [(0.5, None), (PATIENCE_S, 0.5)])
def test_job_that_takes_too_long_is_stopped(of_all: float, own: float | None) -> None:
    with WorkPool(1, timeout_s=of_all) as pool:
        with pytest.raises(WorkerLostError, match=r"longer than 0\.5 s") as caught:
            pool.submit(time.sleep, PATIENCE_S, timeout_s=own).result(PATIENCE_S)
        assert caught.value.timed_out
        assert caught.value.starved  # it slept
        assert pool.submit(os.getpid).result(PATIENCE_S)


def test_closing_waits_for_what_there_is(tmp_path: Path) -> None:
    pool = WorkPool(1, queue=5, timeout_s=PATIENCE_S)
    jobs = [pool.submit(time.sleep, 0.05) for _ in range(4)]
    wait_until(pool.all_ready)
    pids = calls.pids_of(pool)
    pool.close(PATIENCE_S)
    assert [job.result(0.0) for job in jobs] == [None] * 4
    assert not any(is_alive(pid) for pid in pids)
    assert not pool.ready()
    with pytest.raises(WorkerLostError, match="stopping"):
        pool.submit(os.getpid)
    pool.close(0.0)


def test_closing_does_not_wait_for_a_worker_that_would_have_nothing_to_do() -> None:
    pool = WorkPool(1, queue=1, timeout_s=PATIENCE_S, warm_up=partial(time.sleep, PATIENCE_S))
    wait_until(lambda: calls.pids_of(pool))
    (pid,) = calls.pids_of(pool)
    begun = time.monotonic()
    pool.close(PATIENCE_S)
    assert time.monotonic() - begun < PATIENCE_S / 2
    assert not is_alive(pid)


def test_closing_without_patience_loses_what_is_left(tmp_path: Path) -> None:
    pool = WorkPool(1, queue=5, timeout_s=PATIENCE_S)
    mark = tmp_path / "mark"
    jobs = [pool.submit(calls.mark_and_wait, str(mark), "never"), pool.submit(os.getpid)]
    wait_until(mark.exists)
    pool.close(0.0)
    for job in jobs:
        with pytest.raises(WorkerLostError):
            job.result(0.0)
    assert not is_alive(int(mark.read_text()))


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_workers_die_with_a_service_that_is_killed(tmp_path: Path) -> None:
    marks = tmp_path / "pids"
    service = multiprocessing.get_context("spawn").Process(target=calls.parent, args=(str(marks),))
    service.start()
    wait_until(marks.exists)
    pids = [int(pid) for pid in marks.read_text().split()]
    assert len(pids) == 2
    assert all(is_alive(pid) for pid in pids)
    service.kill()
    service.join()
    wait_until(lambda: not any(is_alive(pid) for pid in pids))


def test_a_job_that_computes_for_too_long_is_not_starved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.workers.process._STARVED", 0.05)  # other tests may use the cores
    with WorkPool(1, timeout_s=PATIENCE_S) as pool, pytest.raises(WorkerLostError) as caught:
        pool.submit(calls.work_for_ever, timeout_s=4.0).result(PATIENCE_S)
    assert (caught.value.timed_out, caught.value.starved) == (True, False)


@pytest.mark.parametrize(
    ("workers", "queue", "timeout_s"),
    [(0, 1, 1.0), (-1, None, 1.0), (1, -1, 1.0), (1, 1, 0.0), (1, None, float("nan"))],
)
def test_numbers_that_cannot_be_are_refused(workers: int, queue: int | None, timeout_s: float) -> None:
    with pytest.raises(SettingsError, match="invalid limits"):
        WorkPool(workers, queue=queue, timeout_s=timeout_s)
