"""Two services on one PostgreSQL, clients and a receiver of webhooks; services are killed on the way.

    python -m tests.faults.plant --rounds 20 --parts 100      a long run: prints each round, status 1 if one is wrong

The database is killed too, and frozen for a while.

A service is the whole one but for its workers: a part is answered as soon as it is received.
Each is forked from a process that has everything imported, so that it is back within a moment.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import multiprocessing
import shutil
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from pipeline.common.settings import ReadSettings
from pipeline.reading.triage import ReadPart
from pipeline.service import app as service_module
from pipeline.service.app import Service
from pipeline.service.logs import set_up_logs
from pipeline.service.outputs.dispatch import Dispatcher, Pace
from pipeline.service.settings import ServiceSettings, WebhookSettings
from pipeline.service.web_app import create_app
from pipeline.store import postgres
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.store import Store
from tests.faults.history import DATABASE, Arrival, Kill, Verdict, judged
from tests.support.line_broker import web_hook
from tests.support.postgres_server import PostgresServer
from tests.support.service_fixtures import InlinePool
from tests.support.store_samples import reading
from tests.support.waiting import PATIENCE_S, free_port, wait_until

FROZEN, SILENT_S, FROZEN_S = "frozen", 1.0, 3.0
"""A database that is stopped for a while, and seconds after which a service gives it up."""
PACE = {"look_s": 0.1, "first_wait_s": 0.2, "longest_rest_s": 0.5, "send_s": 4.0, "lease_s": 5.0}


def serve(port: int, folder: Path, store: str, webhook: str) -> None:
    """A service, until it is killed."""
    import uvicorn

    paces = {f.name for f in fields(Pace)}
    pace = Pace(**{name: seconds for name, seconds in PACE.items() if name in paces})
    postgres.SILENT_S = SILENT_S
    service_module.WorkPool = InlinePool  # type: ignore[misc,assignment]
    service_module.Dispatcher = functools.partial(Dispatcher, pace=pace)  # type: ignore[misc,assignment]
    settings = ServiceSettings(
        folder=folder, store=store, webhook=WebhookSettings(url=webhook), port=port, tokens="off"
    )
    log = (folder / f"log-{port}").open("a")
    with log, contextlib.redirect_stdout(log), contextlib.redirect_stderr(log):
        set_up_logs("text")  # else every traceback takes long to be drawn
        service = Service(settings, ReadSettings(format=("AA999999",), font=("gothic",), height_mm=5.0))
        service.pool.instead = lambda *_: ReadPart((reading(),))  # type: ignore[attr-defined]
        uvicorn.Server(uvicorn.Config(create_app(service), port=port, log_level="error")).run()


@dataclass
class Receiver:
    """Takes webhooks and writes down which came; at times it is slow, or does not want one."""

    arrivals: list[Arrival] = field(default_factory=list)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def take(self, sender: str, body: bytes) -> int:
        """The status to answer with."""
        told = json.loads(body)
        with self._lock:
            slow_s, refused = float(self.rng.uniform(0.0, 0.03)), self.rng.random() < 0.03
            if not refused:
                arrival = Arrival(time.monotonic(), sender, told["id"], told["delivery_id"])
                self.arrivals.append(arrival)
        time.sleep(slow_s)
        return 500 if refused else 200


class Plant:
    """Services that can be killed and are there again at once."""

    def __init__(self, folder: Path, store: str, hook: str) -> None:
        """Start two services."""
        self.folder, self.kills = folder, list[Kill]()
        self._store, self._hook, self._lives = store, hook, 0
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([__name__])
        self.ports = [free_port() for _ in range(2)]
        self._running = [self._started(port) for port in self.ports]

    def _started(self, port: int) -> tuple[str, BaseProcess]:
        self._lives += 1
        name = f"service-{port}-{self._lives}"
        hook = f"{self._hook}/{name}"
        arguments = (port, self.folder, self._store, hook)
        process = self._context.Process(target=serve, args=arguments, daemon=True)
        process.start()
        return name, process

    def url(self, number: int) -> str:
        return f"http://127.0.0.1:{self.ports[number]}"

    def await_ready(self) -> None:
        for number in range(len(self.ports)):
            end_s = time.monotonic() + PATIENCE_S
            while True:
                with contextlib.suppress(httpx.TransportError):
                    if httpx.get(f"{self.url(number)}/readyz", timeout=5.0).status_code == 200:
                        break
                assert time.monotonic() < end_s, "a service does not come up"
                time.sleep(0.02)

    def kill(self, number: int) -> None:
        """Kill a service and start it again."""
        name, process = self._running[number]
        _ended(process)
        now_s = time.monotonic()
        self.kills.append(Kill(now_s, name, now_s))
        self._running[number] = self._started(self.ports[number])

    def close(self) -> None:
        for _, process in self._running:
            _ended(process)


def _ended(process: BaseProcess) -> None:
    process.kill()
    process.join()


class Clients:
    """Send photographs with a key each until they are answered, then review them, by whichever service comes."""

    def __init__(self, plant: Plant, seed: int) -> None:
        self._plant, self._seed = plant, seed
        self.answered: dict[str, list[str]] = defaultdict(list)
        self.asked: set[str] = set()
        self.tries = 0

    def send(self, number: int) -> None:
        """One part: sent, at times to two services at once or again later; then reviewed twice."""
        rng = np.random.default_rng((self._seed, number))
        key = f"key-{self._seed}-{number}"
        self.asked.add(key)
        with httpx.Client(timeout=30.0) as http, ThreadPoolExecutor(2) as both:
            sending = [both.submit(self._posted, http, key, int(rng.integers(2)))]
            if rng.random() < 0.3:
                sending.append(both.submit(self._posted, http, key, int(rng.integers(2))))
            part_id, *_ = [one.result() for one in sending]
            for number in range(2):
                body = {"action": "correct", "text": f"KX40725{number}", "who": "Anna"}
                self._asked(http, f"/v1/parts/{part_id}/review", int(rng.integers(2)), json=body)
            if rng.random() < 0.3:
                self._posted(http, key, int(rng.integers(2)))

    def await_answers(self, parts: int) -> None:
        """Wait until so many parts were answered."""
        wait_until(lambda: len(self.answered) >= parts)

    def _posted(self, http: httpx.Client, key: str, first: int) -> str:
        digest = hashlib.sha256(key.encode()).digest()
        files = {"photo": ("photo.png", b"\x89PNG\r\n\x1a\n" + digest * 20)}
        answer = self._asked(
            http, "/v1/parts", first, files=files, data={"name": key}, headers={"Idempotency-Key": key}
        )
        part_id = str(answer["id"])
        self.answered[key].append(part_id)
        return part_id

    def _asked(self, http: httpx.Client, path: str, first: int, **request: Any) -> dict[str, Any]:
        end_s, number = time.monotonic() + PATIENCE_S, first
        while True:
            assert time.monotonic() < end_s, f"no answer to {path}"
            self.tries += 1
            with contextlib.suppress(httpx.TransportError):
                answer = http.post(self._plant.url(number % 2) + path, **request)
                if answer.is_success:
                    found: dict[str, Any] = answer.json()
                    return found
                assert answer.status_code >= 500, f"{answer.status_code}: {answer.text}"
            number += 1
            time.sleep(0.05)


@dataclass
class Outcome:
    """A history that was judged, and how long it was."""

    verdict: Verdict
    parts: int
    deliveries: int
    kills: int
    tries: int


def played(
    server: PostgresServer, name: str, *, parts: int, kills: int, database: Sequence[str] = (), seed: int
) -> Outcome:
    """Play a history in a new database that is killed (DATABASE) or frozen (FROZEN) at times, and judge it."""
    rng = np.random.default_rng(seed)
    folder = Path(tempfile.mkdtemp(prefix="tactile-marks-plant-"))
    url = f"{server.create(name)}&connect_timeout=2"
    Store.open(url).close()
    receiver = Receiver()
    with web_hook(receiver.take) as hook, contextlib.ExitStack() as stack:
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        plant = stack.enter_context(contextlib.closing(Plant(folder, url, hook)))
        plant.await_ready()
        clients = Clients(plant, seed)
        with ThreadPoolExecutor(4) as threads:
            sending = [threads.submit(clients.send, number) for number in range(parts)]
            when = [*("service" for _ in range(kills)), *database]
            rng.shuffle(when)
            for turn, who in enumerate(when, start=1):
                clients.await_answers(turn * parts // (len(when) + 1))
                time.sleep(float(rng.uniform(0.0, 0.05)))
                if who in (DATABASE, FROZEN):
                    began_s = time.monotonic()
                    if who == FROZEN:
                        with server.frozen():
                            time.sleep(FROZEN_S)
                    else:
                        server.kill()
                        server.start()
                    plant.kills.append(Kill(began_s, DATABASE, time.monotonic()))
                else:
                    plant.kill(int(rng.integers(2)))
            for one in sending:
                one.result()
        with contextlib.closing(Store.open(url)) as store:
            wait_until(lambda: store.undelivered() == 0)
            plant.close()
            return _judged(store, EvidenceFolder(folder / "evidence"), clients, receiver, plant)


def _judged(
    store: Store, evidence: EvidenceFolder, clients: Clients, receiver: Receiver, plant: Plant
) -> Outcome:
    stored: dict[str, list[str]] = defaultdict(list)
    deliveries = {}
    missing = []
    for part in store.parts(limit=500):
        stored[part.name].append(part.id)
        deliveries[part.id] = 1 + len(store.story(part.id).reviews)
        kept = [file.sha256 for file in store.evidence(part.id)]
        if not kept or len(evidence.whole(kept)) != len(kept):
            missing.append(f"{part.id}: a file of its is not there, or another")
    verdict = judged(
        clients.answered, stored, deliveries, receiver.arrivals, plant.kills, patience_s=PACE["send_s"]
    )
    verdict.lost += missing
    verdict.lost += [f"{key}: never there" for key in clients.asked - set(stored)]
    return Outcome(verdict, len(deliveries), len(receiver.arrivals), len(plant.kills), clients.tries)


def main(*, rounds: int = 20, parts: int = 100, kills: int = 6, seed: int = 0) -> int:
    """Play rounds, each in a database of its own, and print what is found in each.

    Args:
        rounds: number of rounds.
        parts: parts of each round.
        kills: services killed in each round.
        seed: of the first round; the next has the next one.
    """
    all_right = True
    with contextlib.closing(PostgresServer()) as server:
        for number in range(seed, seed + rounds):
            one = played(
                server, f"round{number}", parts=parts, kills=kills,
                database=(DATABASE, FROZEN), seed=number,
            )  # fmt: skip
            all_right &= not one.verdict.wrong
            print(
                f"round {number}: {one.parts} parts, {one.kills} kills, {one.deliveries} deliveries,"
                f" {one.tries} tries, wrong: {one.verdict.wrong or 'nothing'}",
                flush=True,
            )
    return int(not all_right)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
