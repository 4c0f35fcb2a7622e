"""Parts as CSV, over HTTP."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from pipeline.common.people_records import Person
from pipeline.common.records import PartState, ReviewAction
from pipeline.common.texts import unescape_formula
from pipeline.service import api
from pipeline.service.api import COLUMNS
from tests.support.service_fixtures import Served, inline_service
from tests.support.store_samples import START, Clock, received


@pytest.fixture
def served(tmp_path: Path, clock: Clock) -> Iterator[Served]:
    with inline_service(tmp_path) as (service, client):
        service.store._now = clock
        yield service, client


def rows(client: TestClient, **sought: str) -> list[dict[str, str]]:
    answer = client.get("/v1/parts.csv", params=sought)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    return list(csv.DictReader(io.StringIO(answer.content.decode("utf-8-sig"), newline="")))


def test_every_part_is_a_row_however_many_there_are(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    store, client = served[0].store, served[1]
    monkeypatch.setattr(api, "_AT_ONCE", 3)
    assert rows(client) == []
    ids = [received(store, name=f'Größe {k}, "left"').id for k in range(8)]
    found = rows(client)
    assert list(found[0]) == list(COLUMNS)
    assert [row["id"] for row in found] == ids[::-1]
    assert found[0]["name"] == 'Größe 7, "left"'
    assert (found[0]["serial"], found[0]["state"], found[0]["received"]) == (
        "KX407251", "accepted", "2026-11-21T09:30:00Z",
    )  # fmt: skip


def test_filters(served: Served, clock: Clock) -> None:
    store, client = served[0].store, served[1]
    first = received(store, job="left", line="north").id
    clock.go_on(days=1)
    second = received(store, PartState.REVIEW, job="right").id
    store.review(second, action=ReviewAction.CORRECT, text="KX407257", person=Person("Ada"), note="worn")
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
def test_no_cell_is_a_formula(served: Served, name: str) -> None:
    received(served[0].store, name=name)
    cell = rows(served[1])[0]["name"]
    assert cell.startswith("'")
    assert unescape_formula(cell) == name
