"""`kill -9` under load: whatever was answered is there, whole, and what was not is neither twice nor half there."""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import sqlite3
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

from tests.contract.front_doors import RunningService, run_service, synth
from tests.support.waiting import LOOK_S, PATIENCE_S, children, is_alive, wait_until

SENDERS = 3
PARTS = 4
OPTIONS = ("--jobs", "1", "--format", "A99", "--font", "gothic", "--height-mm", "4", "--tokens", "off")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    made_so = ("--seed", "3", "--height-mm", "4", "--no-photo")
    folder = synth(tmp_path_factory.mktemp("parts"), "A99", *made_so, parts=PARTS)
    return [path.read_bytes() for path in sorted(folder.glob("*.npz"))]


class Senders:
    """Send parts with a key each, again and again until there is an answer, as a line would."""

    def __init__(self, files: list[bytes], folder: Path) -> None:
        self.files, self.folder = files, folder
        self.answered: dict[str, dict[str, object]] = {}
        self.asked: set[str] = set()
        self._lock = threading.Lock()

    def keep_sending(self, url: str, stop: threading.Event, who: str) -> None:
        number = 0
        with httpx.Client(base_url=url, timeout=30.0) as http:
            while not stop.is_set():
                key = f"{who}-{number}"
                number += 1
                with self._lock:
                    self.asked.add(key)
                try:
                    self.send(http, key)
                except httpx.TransportError:
                    return  # killed

    def send(self, http: httpx.Client, key: str) -> dict[str, object]:
        data = self.files[hash_of(key) % len(self.files)]
        answer = http.post(
            "/v1/parts",
            files={"scan": ("part.npz", data)},
            data={"name": key},
            headers={"Idempotency-Key": key},
        )
        assert answer.status_code in (200, 201), answer.text
        with self._lock:
            self.answered[key] = answer.json()
        return answer.json()


def hash_of(key: str) -> int:
    return int(hashlib.sha256(key.encode()).hexdigest()[:8], 16)


def kill(service: RunningService) -> None:
    os.kill(service.process.pid, signal.SIGKILL)
    service.process.wait()


@pytest.fixture(scope="module")
def senders(files: list[bytes], tmp_path_factory: pytest.TempPathFactory) -> Senders:
    """Senders of a service that was killed while it answered them; its folder is as the kill has left it."""
    rng = np.random.default_rng(8)
    folder = tmp_path_factory.mktemp("killed") / "service"
    senders = Senders(files, folder)
    with run_service(folder, *OPTIONS) as service:
        workers = children(service.process.pid)
        assert workers
        stop = threading.Event()
        threads = [
            threading.Thread(target=senders.keep_sending, args=(service.url, stop, f"sender{k}"))
            for k in range(SENDERS)
        ]
        for thread in threads:
            thread.start()
        # under load: at least a few answers, then at any moment of the next
        wait_until(lambda: len(senders.answered) >= 5)
        time.sleep(float(rng.uniform(0.0, 0.4)))
        kill(service)
        stop.set()
        for thread in threads:
            thread.join()
    wait_until(lambda: not any(is_alive(w) for w in workers), why="for workers to end with a killed service")
    return senders


@pytest.fixture(scope="module")
def running(senders: Senders) -> Iterator[RunningService]:
    """A service that goes on after the kill, of which workers are killed, and that the last test asks to end."""
    _whole(senders.folder)
    with run_service(senders.folder, *OPTIONS, "--drain-s", "5") as service:
        yield service


def test_nothing_answered_is_lost_and_nothing_is_half_there(
    senders: Senders, running: RunningService
) -> None:
    assert len(senders.answered) >= 5
    answered = dict(senders.answered)
    with httpx.Client(base_url=running.url, timeout=60.0) as http:
        for key, told in answered.items():
            now = http.get(f"/v1/parts/{told['id']}").json()
            assert now["name"] == key
            assert now["reading"] == told["reading"]
            assert http.get(told["links"]["edges"]).status_code == 200  # type: ignore[index]
        # what nobody answered is asked again, with its key
        for key in sorted(senders.asked):
            again = senders.send(http, key)
            if key in answered:
                assert again["id"] == answered[key]["id"]
        listed = http.get("/v1/parts", params={"limit": 500}).json()
        assert sorted(part["name"] for part in listed) == sorted(senders.asked)
    _whole(senders.folder)


def _whole(folder: Path) -> None:
    """Every part of the store has its reading, its received event and its files, as long and as hashed as told."""
    with contextlib.closing(sqlite3.connect(folder / "store.db")) as store:
        assert store.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        parts = {row[0] for row in store.execute("SELECT id FROM parts")}
        for table in ("events WHERE kind = 'received'", "events WHERE kind = 'read'", "evidence"):
            assert {row[0] for row in store.execute(f"SELECT DISTINCT part_id FROM {table}")} == parts
        rows = list(store.execute("SELECT sha256, n_bytes FROM evidence"))
    assert rows
    kept = {path.name.split(".")[0]: path for path in (folder / "evidence").rglob("*") if path.is_file()}
    for sha256, n_bytes in rows:
        data = kept[sha256].read_bytes()
        assert len(data) == n_bytes
        assert hashlib.sha256(data).hexdigest() == sha256


def test_a_killed_worker_is_replaced_and_the_service_goes_on(
    running: RunningService, files: list[bytes]
) -> None:
    with httpx.Client(base_url=running.url, timeout=60.0) as http:
        workers = children(running.process.pid)
        assert workers
        for worker in workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
        statuses = [
            http.post("/v1/parts", files={"scan": ("part.npz", data)}).status_code for data in files[:3]
        ]
        assert statuses[-1] == 201
        assert set(statuses) <= {201, 422, 503}  # the part at which a worker dies may be told so, never a 500
        assert http.get("/healthz").status_code == 200


def test_one_key_at_once_is_one_part_and_who_is_at_work_may_end(
    running: RunningService, files: list[bytes]
) -> None:
    """Four senders of one part; then a service that is asked to end while it reads."""
    answers: list[httpx.Response] = []

    def send(key: str, data: bytes) -> None:
        headers = {"Idempotency-Key": key}
        scan = {"scan": ("part.npz", data)}
        answers.append(httpx.post(f"{running.url}/v1/parts", files=scan, headers=headers, timeout=60.0))

    at_once = [threading.Thread(target=send, args=("one", files[0])) for _ in range(4)]
    for thread in at_once:
        thread.start()
    for thread in at_once:
        thread.join()
    assert sorted(a.status_code for a in answers) == [200, 200, 200, 201]
    assert len({a.json()["id"] for a in answers}) == 1
    answers.clear()
    last = [threading.Thread(target=send, args=(f"last-{k}", data)) for k, data in enumerate(files[:4])]
    for thread in last:
        thread.start()
    # a sender that has not connected when the service ends is refused: all four are to be known to it
    wait_until(lambda: len(answers) + _jobs(running) >= len(last))
    running.process.send_signal(signal.SIGTERM)
    drained = _refused_ready(running)
    late = httpx.post(f"{running.url}/v1/parts", files={"scan": ("part.npz", files[0])}, timeout=60.0)
    for refused in (drained, late):
        assert (refused.status_code, refused.headers["content-type"]) == (503, "application/problem+json")
        assert int(refused.headers["retry-after"]) > 0
    for thread in last:
        thread.join()
    assert [a.status_code for a in answers] == [201] * 4
    # the signal is passed on once everything is closed
    assert running.process.wait(30.0) in (0, -signal.SIGTERM)
    assert "Application shutdown complete" in running.log


def _refused_ready(service: RunningService) -> httpx.Response:
    """The first answer of /readyz that is not ready."""
    until = time.monotonic() + PATIENCE_S
    while (answer := httpx.get(f"{service.url}/readyz", timeout=30.0)).status_code == 200:
        assert time.monotonic() < until
        time.sleep(LOOK_S)
    return answer


def _jobs(service: RunningService) -> float:
    """Parts that wait for a worker or that one is at."""
    page = httpx.get(f"{service.url}/metrics", timeout=30.0).text
    names = ("tactile_marks_jobs_waiting", "tactile_marks_jobs_running")
    figures = dict(line.split() for line in page.splitlines() if line.startswith(names))
    return sum(float(figures[name]) for name in names)
