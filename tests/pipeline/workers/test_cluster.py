"""A real Dask scheduler and real workers: what is lost costs nothing but time."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.workers.cluster import ClusterError, ClusterExecutor
from tests.support.cluster_process import ClusterProcess, cluster_process
from tests.support.executor_calls import dies_of_seven, doubled, noted
from tests.support.waiting import wait_until

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ClusterProcess]:
    """A cluster that has no worker at first: the first test sees it so, and the last one ends it."""
    # two workers die of a task, not Dask's four: each starts again and imports everything
    with cluster_process(tmp_path_factory.mktemp("cluster"), workers=0, deaths_allowed=1) as started:
        yield started


@pytest.fixture
def cluster(scheduler: ClusterProcess) -> ClusterProcess:
    """The same with two workers."""
    while len(scheduler.workers) < 2:
        scheduler.add_worker()
    return scheduler


@pytest.mark.parametrize(
    "answer", [b"HTTP/1.1 400 Bad Request\r\n\r\n", (2**31).to_bytes(8, "little") + b"\xff" * 200]
)
def test_what_is_no_scheduler_is_one_message_in_time(
    answer: bytes, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pipeline.workers.cluster._CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            caller, _ = server.accept()
            callers.append(caller)
            caller.sendall(answer)

        callers = list[socket.socket]()
        threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        began_s = time.monotonic()
        with pytest.raises(ClusterError, match=f"no Dask scheduler answers at {address}"):
            ClusterExecutor(address).__enter__()
        assert time.monotonic() - began_s < 10.0
    assert "Traceback" not in capfd.readouterr().err


def test_no_worker_is_told_and_a_late_one_waited_for(scheduler: ClusterProcess) -> None:
    with (
        pytest.raises(ClusterError, match="has no workers; start some with: tactile-marks worker tcp://"),
        ClusterExecutor(scheduler.address, patience_s=0.5),
    ):
        pass
    threading.Timer(0.5, scheduler.add_worker).start()
    with ClusterExecutor(scheduler.address) as executor:
        assert [o.result for o in executor.calls(doubled, 1, [20])] == [41]


def test_a_worker_is_no_scheduler(cluster: ClusterProcess) -> None:
    with distributed.Client(cluster.address) as client:
        wait_until(lambda: bool(client.scheduler_info()["workers"]))
        worker = next(iter(client.scheduler_info()["workers"]))
    with pytest.raises(ClusterError, match="it is a Worker"):
        ClusterExecutor(worker).__enter__()


def test_another_version_of_the_program_is_refused(
    cluster: ClusterProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.common.version.program_mark", lambda: "another")
    with pytest.raises(ClusterError, match="runs another version"), ClusterExecutor(cluster.address):
        pass


def test_a_task_that_kills_every_worker_is_given_up_alone(cluster: ClusterProcess, tmp_path: Path) -> None:
    with ClusterExecutor(cluster.address) as executor:
        outcomes = {o.task: o for o in executor.calls(dies_of_seven, str(tmp_path), range(12))}
    assert sorted(outcomes) == list(range(12)), cluster.told()
    assert [task for task, o in outcomes.items() if o.error is not None] == [7], cluster.told()
    assert "workers have died with it" in str(outcomes[7].error)


def test_a_lost_scheduler_ends_the_run(cluster: ClusterProcess, tmp_path: Path) -> None:
    with ClusterExecutor(cluster.address) as executor:
        executor._client._timeout = 1.0  # how long it looks for the lost scheduler
        outcomes = executor.calls(noted, str(tmp_path), range(10_000))
        for _, _ in zip(range(6), outcomes, strict=False):
            pass
        cluster.lose(cluster.scheduler)
        with pytest.raises(ClusterError, match="run the same command again"):
            list(outcomes)
