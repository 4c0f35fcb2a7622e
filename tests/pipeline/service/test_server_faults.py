"""What is the service's own fault is told so: 503 as a problem, with when to ask again; and /readyz knows."""

from __future__ import annotations

import asyncio
import errno
import os
import shutil
import signal
import sqlite3
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from starlette.testclient import TestClient

from pipeline.common.part_id import new_part_id
from pipeline.common.records import PartState
from pipeline.common.settings import ReadSettings
from pipeline.reading.part_job import check_settings
from pipeline.reading.triage import ReadPart
from pipeline.service import worker_calls
from pipeline.service.app import Service
from pipeline.service.settings import ServiceSettings
from pipeline.service.stage import ScanOrder, SimulatedStage
from pipeline.service.web.web_server import DrainingServer
from pipeline.service.web_app import create_app
from pipeline.workers.executors import WorkerLostError
from pipeline.workers.options import PoolSettings
from tests.support.service_fixtures import Served, inline_service, is_problem
from tests.support.store_samples import PLAN, reading
from tests.support.waiting import wait_until
from whisker_array.scan.stage_error import StageError


@pytest.fixture
def plate(parts: Path) -> bytes:
    return (parts / "clean.npz").read_bytes()


def read_at_once(*_: object) -> ReadPart:
    """What a worker gives, without reading."""
    return ReadPart((reading("KX40", "tactile"),))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    with inline_service(tmp_path / "s", instead=read_at_once) as both:
        yield both


def sent(client: TestClient, plate: bytes) -> Any:
    return client.post("/v1/parts", files={"scan": ("part.npz", plate)})


@pytest.mark.parametrize(
    ("where", "code"), [("mkdtemp", errno.ENOSPC), ("replace", errno.EROFS), ("fsync", errno.EIO)]
)
def test_a_disk_that_does_not_take_files_is_not_the_senders_fault(
    served: Served, plate: bytes, monkeypatch: pytest.MonkeyPatch, where: str, code: int
) -> None:
    service, client = served

    with monkeypatch.context() as patched:
        module = "pipeline.store.evidence_folder.tempfile" if where == "mkdtemp" else "os"
        patched.setattr(f"{module}.{where}", Mock(side_effect=OSError(code, os.strerror(code))))
        assert is_problem(sent(client, plate), 503)
        if where == "fsync":
            ready = client.get("/readyz")
            assert ready.status_code == 503
            assert os.strerror(code) in ready.json()["detail"]
    assert sent(client, plate).status_code == 201
    assert client.get("/readyz").status_code == 200
    assert len(service.store.parts()) == 1


def test_no_room_for_an_upload_that_is_coming_is_not_its_senders_fault(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "starlette.formparsers.SpooledTemporaryFile",
        Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))),
    )
    assert is_problem(sent(served[1], b"x" * 100), 503)


def test_a_disk_that_is_nearly_full_is_not_ready(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage("/")
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage._replace(free=1000))
    ready = served[1].get("/readyz")
    assert (ready.status_code, "No space left" in ready.json()["detail"]) == (503, True)


def test_a_store_that_another_program_holds_is_not_ready_and_says_so_at_once(
    served: Served, tmp_path: Path
) -> None:
    other = sqlite3.connect(tmp_path / "s" / "store.db")
    other.execute("BEGIN IMMEDIATE")
    began_s = time.monotonic()
    ready = served[1].get("/readyz")
    assert (ready.status_code, "have not answered for 2 s" in ready.json()["detail"]) == (503, True)
    assert time.monotonic() - began_s < 4.0
    other.close()
    wait_until(lambda: served[1].get("/readyz").status_code == 200)


@pytest.mark.parametrize(
    ("losses", "status"),
    [
        ([WorkerLostError("killed")], 201),
        ([WorkerLostError("crashed", crashed=True)] * 2, 422),
        ([WorkerLostError("killed")] * 2, 503),
        ([WorkerLostError("too long", timed_out=True)], 422),
        ([WorkerLostError("too long", timed_out=True, starved=True)], 503),
    ],
)
def test_a_lost_worker_is_a_verdict_on_the_part_only_if_it_would_be_lost_again(
    served: Served, plate: bytes, losses: list[WorkerLostError], status: int
) -> None:
    service, client = served
    left = list(losses)

    def work(*_: object) -> ReadPart:
        if left:
            raise left.pop()
        return read_at_once()

    service.pool.instead = work  # type: ignore[attr-defined]
    answer = sent(client, plate)
    assert (answer.status_code, left) == (status, [])
    if status == 503:
        assert is_problem(answer, 503)
    assert client.get("/metrics").text.count(f"tactile_marks_workers_lost_total {len(losses)}.0") == 1


def test_workers_that_are_lost_in_a_row_make_the_service_unready_until_it_reads_a_clean_part(
    served: Served, plate: bytes
) -> None:
    service, client = served
    broken = threading.Event()
    broken.set()

    def work(*_: object) -> ReadPart:
        if broken.is_set():
            raise WorkerLostError("the worker took longer than 60 s", timed_out=True, starved=True)
        return read_at_once()

    service.pool.instead = work  # type: ignore[attr-defined]
    assert is_problem(sent(client, plate), 503)
    assert client.get("/readyz").status_code == 200  # one may be the part's own
    assert is_problem(sent(client, plate), 503)
    ready = client.get("/readyz")
    assert (ready.status_code, "took longer than 60 s" in ready.json()["detail"]) == (503, True)
    broken.clear()
    wait_until(lambda: client.get("/readyz").status_code == 200)


@pytest.mark.parametrize(("jams", "status"), [("open", 503), ("feel", 503), ("close", 422)])
def test_a_stage_that_hangs_is_told_and_its_part_still_waits(
    tmp_path: Path, parts: Path, monkeypatch: pytest.MonkeyPatch, jams: str, status: int
) -> None:
    back = threading.Event()

    plan = replace(PLAN, region_mm=(1.0, 1.0, 30.0, 12.0))
    # made before the time of a call counts
    fitting = SimulatedStage(parts).open(ScanOrder("clean", plan)).fitting

    class Hanging:
        def __init__(self) -> None:
            self.fitting = fitting

        def open(self, order: ScanOrder) -> Hanging:
            if jams == "open":
                back.wait()
            return self

        def feel(self, order: object) -> None:
            if jams == "feel":
                back.wait()
            raise StageError("the array has jammed")

        def close(self) -> None:
            if jams == "close":
                back.wait()

    monkeypatch.setattr("pipeline.formats.synth.hanging", Hanging, raising=False)
    stage = {"stage": {"device": "pipeline.formats.synth:hanging"}, "device_timeout_s": 0.5}
    try:
        with inline_service(tmp_path, **stage) as (service, client):
            part_id = new_part_id()
            service.store.add_part(
                part_id=part_id,
                name="part",
                state=PartState.TOUCH_NEEDED,
                plan=replace(PLAN, region_mm=(1.0, 1.0, 30.0, 12.0)),
            )
            answer = client.post(f"/v1/parts/{part_id}/touch")
            assert answer.status_code == status, answer.text
            assert is_problem(answer, 503) == (status == 503)
            assert client.get(f"/v1/parts/{part_id}").json()["state"] == "touch_needed"
            assert client.get("/readyz").status_code == 503
    finally:
        back.set()


def test_the_first_signal_drains_and_the_second_stops() -> None:
    import uvicorn

    said: list[str] = []
    server = DrainingServer(
        uvicorn.Config(lambda *_: None), drain=lambda: said.append("drains"), drain_s=3600.0
    )
    server.started = True
    server.handle_exit(signal.SIGTERM, None)
    assert (said, asyncio.run(server.on_tick(1))) == (["drains"], False)
    server.handle_exit(signal.SIGTERM, None)
    assert asyncio.run(server.on_tick(2)) is True
    at_once = DrainingServer(uvicorn.Config(lambda *_: None), drain=lambda: None, drain_s=0.0)
    at_once.started = True
    at_once.handle_exit(signal.SIGTERM, None)
    assert asyncio.run(at_once.on_tick(1)) is True


def test_an_unusable_database_is_opened_again_once_it_changes_and_forgotten_once_it_is_removed(
    tmp_path: Path, plate: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_calls, "UNCHANGED_S", 1e9)
    with inline_service(tmp_path) as (service, client):
        path = tmp_path / "databases" / "die.glyphs"
        path.parent.mkdir(exist_ok=True)
        for content in (b"rubbish", b"rubbish of another size"):
            path.write_bytes(content)
            before = checks(service)
            read = client.post("/v1/parts", files={"scan": ("part.npz", plate)}, data={"database": "die"})
            assert is_problem(read, 503), read.text
            for _ in range(3):
                client.portal.call(service.intake.calls.recheck)  # type: ignore[union-attr]
            assert checks(service) == before + 1
        path.unlink()
        client.portal.call(service.intake.calls.recheck)  # type: ignore[union-attr]
        assert "die has disappeared" in service.intake.calls.troubles["die"]
        # after an hour it counts as removed: nobody can put it right, so it is no fault any more
        monkeypatch.setattr("pipeline.service.jobs.MOST_AWAY_S", 0.0)
        client.portal.call(service.intake.calls.recheck)  # type: ignore[union-attr]
        assert service.intake.calls.troubles == {}
        assert "unusable" not in client.get("/readyz").json()


def checks(service: Any) -> int:
    """Times that settings were checked in a worker."""
    return sum(function is check_settings for function, *_ in service.pool.jobs)


def test_parts_are_answered_with_the_cause_while_no_worker_can_start(
    tmp_path: Path, plate: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr("pipeline.workers.pool.worker_of", fail)
    service = Service(ServiceSettings(folder=tmp_path), ReadSettings(format=("A9",)), PoolSettings(jobs=1))
    with TestClient(create_app(service), base_url="http://127.0.0.1:8417") as client:
        answer = sent(client, plate)
        assert is_problem(answer, 503, "start: ")
        wait_until(lambda: "no worker can start: " in client.get("/readyz").text)
        ready = client.get("/readyz")
        assert ready.status_code == 503
        assert os.strerror(errno.EAGAIN) in ready.json()["detail"]
        assert client.get("/healthz").status_code == 200
