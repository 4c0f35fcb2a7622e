"""A whole service in this process, its jobs done in threads: as the real one, but nothing to start or wait for."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from starlette.testclient import TestClient

from pipeline.common.records import PartRecord
from pipeline.common.settings import ReadSettings
from pipeline.service import app as service_module
from pipeline.service.app import Service
from pipeline.service.settings import ServiceSettings
from pipeline.service.web.problem import problem_of
from pipeline.service.web_app import create_app
from pipeline.workers.machine import Machine
from pipeline.workers.pool import BusyError

# FastAPI prepares a type for every route that takes or gives it, in every app anew: a third of a second for every
# service of a test; here each is prepared once
KEPT: dict[tuple[object, str], TypeAdapter[Any]] = {}


def kept(annotation: Any, *, config: Any = None) -> TypeAdapter[Any]:
    """The adapter of a type; it is not changed by those who use it."""
    key = (getattr(annotation, "__origin__", annotation), f"{annotation} {config}")
    if key not in KEPT:
        KEPT[key] = TypeAdapter(annotation, config=config)
    return KEPT[key]


def keep_adapters() -> None:
    """Have all apps of this process share their adapters; another FastAPI may make them elsewhere, and takes longer."""
    with contextlib.suppress(ImportError):
        from fastapi._compat import v2

        if hasattr(v2, "TypeAdapter"):
            v2.TypeAdapter = kept  # type: ignore[assignment,misc]


keep_adapters()
FORMAT = "AA99"
Served = tuple[Service, TestClient]


class InlinePool:
    """A pool of threads with the face of `pipeline.workers.pool.WorkPool`."""

    full = False
    waiting = 0
    running = 0

    def __init__(self, workers: int, **_: object) -> None:
        self.workers = workers
        self._threads = ThreadPoolExecutor(2)
        self.jobs: list[tuple[Any, ...]] = []
        self.instead: Callable[..., Any] | None = None

    def call(self, function: Callable[..., Any], *arguments: Any, **_: float) -> Any:
        if self.full:
            raise BusyError(3.0)
        return self._threads.submit(function, *arguments).result()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self.full:
            raise BusyError(3.0)
        self.jobs.append((function, *arguments))
        return self._threads.submit(self.instead or function, *arguments)

    def retry_after_s(self) -> float | None:
        return 3.0 if self.full else None

    def ready(self) -> bool:
        return True

    def close(self, grace_s: float = 0.0) -> None:
        self._threads.shutdown()


@contextlib.contextmanager
def inline_service(
    folder: Path,
    *,
    reading: ReadSettings | None = None,
    instead: Callable[..., Any] | None = None,
    machine: Machine | None = None,
    **settings: Any,
) -> Iterator[Served]:
    """A service in a folder and a client of it; `instead` is called by its pool in place of reading."""
    kept = service_module.WorkPool
    service_module.WorkPool = InlinePool  # type: ignore[misc,assignment]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        read = reading or ReadSettings(format=(FORMAT,), font=("gothic",), height_mm=5.0)
        service = Service(ServiceSettings(folder=folder, **settings), read, machine=machine)
        service.pool.instead = instead  # type: ignore[attr-defined]
        with TestClient(create_app(service), base_url="http://127.0.0.1:8417") as client:
            yield service, client
    finally:
        service_module.WorkPool = kept  # type: ignore[misc]


def triggered(served: Served, name: str, job: str = "") -> PartRecord:
    """The part that a trigger of the TCP port or of OPC UA gives, on the service's own loop; raises the problem that
    those ports answer with."""
    service, client = served
    try:
        return client.portal.call(service.intake.trigger, name, job)
    except Exception as error:
        raise problem_of(error) from error


def is_problem(answer: Any, status: int, words: str = "") -> bool:
    """Whether an answer is a problem with these words, and says when to ask again if it is the service's own."""
    return (
        answer.status_code == status
        and answer.headers["content-type"] == "application/problem+json"
        and answer.json()["status"] == status
        and words in answer.json()["detail"]
        and (status != 503 or int(answer.headers["retry-after"]) > 0)
    )
