"""A PostgreSQL that is frozen: nothing waits for ever, nothing is half stored, and all goes on when it does."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import psycopg
import pytest
import sqlalchemy as sa
from starlette.testclient import TestClient

from pipeline.common.records import Scope
from pipeline.reading.triage import ReadPart
from pipeline.store.errors import StoreError
from pipeline.store.store import Store
from tests.support.postgres_server import PostgresServer
from tests.support.service_fixtures import Served, inline_service, is_problem
from tests.support.store_samples import reading
from tests.support.waiting import wait_until

SILENT_S, CONNECT_S = 0.5, 2.0  # the driver waits no less to connect
MOST_S = 2.0 * (SILENT_S + CONNECT_S)
NO_ANSWER = "the store does not answer"


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


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    began_s = time.monotonic()
    return call(), time.monotonic() - began_s


def test_a_store_says_after_a_while_that_nobody_answers(postgres: PostgresServer, url: str) -> None:
    def refused(_: int = 0) -> bool:
        with pytest.raises(StoreError, match=r"does not answer.*; check that the database runs"):
            store.check_writable()
        return True

    with contextlib.closing(Store.open(url)) as store, ThreadPoolExecutor(8) as threads:
        store.check_writable()
        with postgres.frozen():
            assert timed(refused)[1] < MOST_S
            # one asks, and the others are refused
            done, took_s = timed(lambda: list(threads.map(refused, range(16))))
            assert all(done)
            assert took_s < 3.0 * MOST_S
        store.check_writable()


def test_requests_are_answered_while_the_database_is_frozen(postgres: PostgresServer, served: Served) -> None:
    service, client = served
    assert sent(client, "before").status_code == 201
    with postgres.frozen():
        answer, took_s = timed(lambda: sent(client, "while"))
        assert is_problem(answer, 503, NO_ANSWER), answer.text
        assert took_s < MOST_S
        for path in ("/readyz", "/v1/parts"):
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
        assert is_problem(answer, 503, NO_ANSWER), answer.text
        assert took_s < MOST_S
    again = sent(client, "one")
    assert again.status_code == (200 if at == "commit" else 201)
    (part,) = service.store.parts()
    assert part.id == again.json()["id"]
    for kept in service.store.evidence(part.id):
        assert service.evidence.state(kept.sha256) == "whole"


def executed(url: str, *statements: str) -> None:
    """On a connection of their own, and all others of that database are ended."""
    with psycopg.connect(url, autocommit=True, options="-c default_transaction_read_only=off") as other:
        for statement in statements:
            other.execute(statement.encode())
        others = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database()"
        other.execute(f"{others} AND pid <> pg_backend_pid()".encode())


def test_a_database_that_takes_no_writes_is_not_ready(url: str, served: Served) -> None:
    _, client = served
    name = url.split("/")[3].split("?")[0]
    executed(url, f"ALTER DATABASE {name} SET default_transaction_read_only = on")  # as after a fail-over
    assert is_problem(sent(client, "one"), 503, NO_ANSWER)
    ready = client.get("/readyz")
    assert (ready.status_code, "the store is read-only" in ready.json()["detail"]) == (503, True)
    executed(url, f"ALTER DATABASE {name} RESET default_transaction_read_only")
    wait_until(lambda: client.get("/readyz").status_code == 200)
    assert sent(client, "one").status_code == 201


def test_while_the_parts_are_locked_readiness_says_so_at_once(url: str, served: Served) -> None:
    _, client = served
    with psycopg.connect(url) as other:
        other.execute("LOCK TABLE parts IN ACCESS EXCLUSIVE MODE")
        for _ in range(2):
            ready, took_s = timed(lambda: client.get("/readyz"))
            assert ready.status_code == 503
            assert "parts are locked" in ready.json()["detail"]
            assert took_s < 3.0
    assert client.get("/readyz").status_code == 200


def test_the_fate_of_the_last_write_counts(served: Served) -> None:
    service, client = served
    with psycopg.connect(
        service.store._engine.url.set(drivername="postgresql").render_as_string(False)
    ) as other:
        other.execute(
            "ALTER TABLE tactile_marks_version ADD CONSTRAINT none CHECK (version_num = '') NOT VALID"
        )
        other.execute("ALTER TABLE parts ADD CONSTRAINT none CHECK (id = '') NOT VALID")
        other.commit()
        assert client.get("/readyz").status_code == 200
        assert is_problem(sent(client, "one"), 503, NO_ANSWER)
        assert client.get("/readyz").status_code == 503
        other.execute("ALTER TABLE tactile_marks_version DROP CONSTRAINT none")
        other.execute("ALTER TABLE parts DROP CONSTRAINT none")
        other.commit()
    assert client.get("/readyz").status_code == 200
    assert sent(client, "one").status_code == 201
