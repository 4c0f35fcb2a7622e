"""A PostgreSQL that is frozen: nothing waits for ever, nothing is half stored, and all goes on when it does."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from starlette.testclient import TestClient

from pipeline.common.records import Scope
from pipeline.reading.triage import ReadPart
from pipeline.store.errors import StoreError
from pipeline.store.store import Store
from tests.support.postgres_server import PostgresServer
from tests.support.service_fixtures import Served, inline_service
from tests.support.store_samples import reading

SILENT_S, CONNECT_S = 1.0, 2.0
MOST_S = 2.0 * (SILENT_S + CONNECT_S)


@pytest.fixture
def url(postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("pipeline.store.postgres.SILENT_S", SILENT_S)
    return f"{postgres.create(f'frozen_{time.monotonic_ns()}')}&connect_timeout={CONNECT_S:.0f}"


@pytest.fixture
def served(url: str, tmp_path: Path) -> Iterator[Served]:
    read = ReadPart((reading(),))
    with inline_service(tmp_path / "s", instead=lambda *_: read, store=url, tokens="on") as (service, client):
        client.headers["authorization"] = f"Bearer {service.store.add_token('line', list(Scope))}"
        yield service, client


def sent(client: TestClient, key: str) -> Any:
    photo = {"photo": ("part.png", b"\x89PNG\r\n\x1a\n" + key.encode())}
    return client.post("/v1/parts", files=photo, headers={"Idempotency-Key": key})


def says_later(answer: Any) -> bool:
    return (
        answer.status_code == 503
        and int(answer.headers["retry-after"]) > 0
        and "the store does not answer" in answer.json()["detail"]
    )


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    began_s = time.monotonic()
    return call(), time.monotonic() - began_s


def test_a_store_says_after_a_while_that_nobody_answers(postgres: PostgresServer, url: str) -> None:
    def refused(_: int = 0) -> bool:
        with pytest.raises(StoreError, match=r"does not answer.*; check that the database runs"):
            store.ping()
        return True

    with contextlib.closing(Store.open(url)) as store, ThreadPoolExecutor(8) as threads:
        store.ping()
        with postgres.frozen():
            assert timed(refused)[1] < MOST_S
            # one asks, and the others are refused
            done, took_s = timed(lambda: list(threads.map(refused, range(40))))
            assert all(done)
            assert took_s < 3.0 * MOST_S
        store.ping()


def test_requests_are_answered_while_the_database_is_frozen(postgres: PostgresServer, served: Served) -> None:
    service, client = served
    assert sent(client, "before").status_code == 201
    with postgres.frozen():
        answer, took_s = timed(lambda: sent(client, "while"))
        assert says_later(answer), answer.text
        assert took_s < MOST_S
        for path in ("/readyz", "/v1/parts", "/metrics", "/review"):
            answer, took_s = timed(lambda at=path: client.get(at))
            assert answer.status_code == 503, (path, answer.text)
            assert took_s < MOST_S, path
        assert client.get("/healthz").status_code == 200
    assert sent(client, "while").status_code == 201
    assert client.get("/readyz").status_code == 200
    assert len(service.store.parts()) == 2


@pytest.mark.parametrize("at", ["insert", "commit"])
def test_a_part_whose_transaction_is_frozen_is_stored_whole_or_not_at_all(
    postgres: PostgresServer, served: Served, at: str
) -> None:
    service, client = served
    writers: list[object] = []

    def insert(connection: object, _cursor: object, statement: str, *_: object) -> None:
        if statement.startswith("INSERT INTO parts") and not writers:
            writers.append(connection)
            if at == "insert":
                frozen.enter_context(postgres.frozen())

    def commit(connection: object) -> None:
        if at == "commit" and writers == [connection]:
            frozen.enter_context(postgres.frozen())

    sa.event.listen(service.store._engine, "before_cursor_execute", insert)
    sa.event.listen(service.store._engine, "commit", commit)
    with contextlib.ExitStack() as frozen:
        answer, took_s = timed(lambda: sent(client, "one"))
        assert says_later(answer), answer.text
        assert took_s < MOST_S
    again = sent(client, "one")
    assert again.status_code == (200 if at == "commit" else 201)
    (part,) = service.store.parts()
    assert part.id == again.json()["id"]
    for kept in service.store.evidence(part.id):
        assert service.evidence.state(kept.sha256) == "whole"
