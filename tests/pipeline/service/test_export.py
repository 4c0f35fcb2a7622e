"""Parts as CSV, over HTTP."""

from __future__ import annotations

import csv
import io
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from pipeline.common.records import PartState, ReviewAction
from pipeline.service.api import lookup
from pipeline.service.api.lookup import COLUMNS, lookup_router
from pipeline.service.web.access import Access
from pipeline.service.web.problem import add_problem_handlers
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock, received


@pytest.fixture
def store_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/store.db"


@pytest.fixture
def client(store: Store) -> TestClient:
    app = FastAPI()
    access, settings = Access(store, required=False), SimpleNamespace(root_path="")
    app.include_router(
        lookup_router(SimpleNamespace(store=store, access=access, evidence=None, settings=settings))
    )
    add_problem_handlers(app)
    return TestClient(app)


def rows(client: TestClient, **sought: str) -> list[dict[str, str]]:
    answer = client.get("/v1/parts.csv", params=sought)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    return list(csv.DictReader(io.StringIO(answer.text, newline="")))


def test_every_part_is_a_row_however_many_there_are(
    store: Store, client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lookup, "_AT_ONCE", 3)
    assert rows(client) == []
    ids = [received(store, name=f'Größe {k}, "left"').id for k in range(8)]
    found = rows(client)
    assert list(found[0]) == list(COLUMNS)
    assert [row["id"] for row in found] == ids[::-1]
    assert found[0]["name"] == 'Größe 7, "left"'
    assert (found[0]["serial"], found[0]["state"], found[0]["received"]) == (
        "KX407251", "accepted", "2026-11-21T09:30:00Z",
    )  # fmt: skip


def test_filters(store: Store, clock: Clock, client: TestClient) -> None:
    first = received(store, job="left", line="north").id
    clock.go_on(days=1)
    second = received(store, PartState.REVIEW, job="right").id
    store.review(second, action=ReviewAction.CORRECT, text="KX407257", who="Ada", note="worn")
    day = f"{START + timedelta(days=1):%Y-%m-%d}"
    assert [r["id"] for r in rows(client, since=day)] == [second]
    assert [r["id"] for r in rows(client, until=day)] == [first]
    assert [r["id"] for r in rows(client, since="2026-11-22T09:30:01+01:00")] == [second]
    assert [r["id"] for r in rows(client, state="accepted")] == [first]
    assert [r["id"] for r in rows(client, job="right")] == [second]
    assert [r["id"] for r in rows(client, line="north")] == [first]
    row = rows(client, text="57")[0]
    assert (row["reviewed_by"], row["review"], row["note"]) == ("Ada", "correct", "worn")
    for wrong in ("yesterday", "9999-12-31T23:59:59-23:00"):
        assert client.get("/v1/parts.csv", params={"since": wrong}).status_code == 422


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", '=HYPERLINK("http://x","y")'])
def test_no_cell_is_a_formula(store: Store, client: TestClient, name: str) -> None:
    received(store, name=name)
    cell = rows(client)[0]["name"]
    assert cell == f"'{name}"
