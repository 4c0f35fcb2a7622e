"""Parts over HTTP: their files, their rows as CSV, whose name a review bears, audits and alerts."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from glyphs.errors import FileError
from pipeline.common.people_records import Person
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartRecord, PartState, ReviewAction, Scope
from pipeline.service import api
from pipeline.service.api import COLUMNS
from pipeline.service.app import Service, check_folder
from pipeline.service.settings import ServiceSettings
from tests.support.postgres_server import PostgresServer
from tests.support.service_fixtures import Served, inline_service
from tests.support.store_samples import PHOTO, START, Clock, reading, received


def _kept(service: Service) -> tuple[PartRecord, EvidenceRecord]:
    path = service.evidence.incoming / "picture.jpg"
    path.write_bytes(b"as it was")
    sha256, n_bytes = service.evidence.keep(path)
    record = replace(PHOTO, kind=EvidenceKind.PHOTO_PICTURE, sha256=sha256, n_bytes=n_bytes)
    return received(service.store, evidence=(record,)), record


def test_a_damaged_file_is_said_and_not_served(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with inline_service(tmp_path / "service") as (service, client):
        part, record = _kept(service)
        addresses = (f"/v1/parts/{part.id}/pictures/photo", f"/v1/parts/{part.id}/evidence/{record.sha256}")
        for address in addresses:
            whole = client.get(address)
            assert (whole.status_code, whole.content) == (200, b"as it was")
            assert whole.headers["etag"] == f'"{record.sha256}"'
        service.evidence.path(record.sha256).write_bytes(b"as it rots")
        for address in (*addresses, f"/v1/parts/{part.id}/pictures/boxes"):
            damaged = client.get(address)
            assert damaged.status_code == 500, address
            assert damaged.headers["content-type"] == "application/problem+json"
            assert "is damaged on the service's disk; restore it from a backup" in damaged.json()["detail"]
            assert "etag" not in damaged.headers
            assert b"as it rots" not in damaged.content
        assert f"the file {record.sha256} kept as evidence is damaged" in caplog.text
        assert "This picture is damaged" in client.get(f"/parts/{part.id}").text
        assert service.evidence.whole((record.sha256,)) == (), "nor is it read again with touch"
        service.evidence.path(record.sha256).unlink()
        for address in addresses:
            missing = client.get(address)
            assert missing.status_code == 404
            assert "missing from the service" in missing.json()["detail"]


def _modes(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder.parent)): path.stat().st_mode & 0o777
        for path in (folder, *folder.rglob("*"))
    }


def test_nobody_but_the_owner_reads_what_is_kept(tmp_path: Path) -> None:
    folder = tmp_path / "service"
    check_folder(ServiceSettings(folder=folder))
    with inline_service(folder) as (service, _):
        _kept(service)
        modes = _modes(folder)
    assert modes["service"] == modes["service/evidence"] == modes["service/evidence/files"] == 0o700
    # what stands open within is behind a folder that is not
    kept = {name: mode for name, mode in modes.items() if "evidence" in name or "store.db" in name}
    assert set(kept) >= {"service/store.db", "service/store.db-wal", "service/store.db-shm"}
    assert {name: mode for name, mode in kept.items() if mode & 0o077} == {}


def test_what_stood_open_is_closed_but_to_a_group_that_may_write(tmp_path: Path) -> None:
    folder = tmp_path / "service"
    with inline_service(folder):
        pass
    folder.chmod(0o755)
    (folder / "store.db").chmod(0o664)
    check_folder(ServiceSettings(folder=folder))
    with inline_service(folder):
        modes = _modes(folder)
    assert modes["service"] == 0o700
    assert modes["service/store.db"] == 0o660


def test_services_that_share_a_postgresql_need_one_evidence_folder(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    url = postgres.create(f"shared_{time.monotonic_ns()}")
    with inline_service(tmp_path / "one", store=url), inline_service(tmp_path / "one", store=url):
        pass
    with (
        pytest.raises(
            FileError, match=r"is not the evidence folder of this store; .* the same --folder"
        ) as refused,
        inline_service(tmp_path / "two", store=url),
    ):
        pass
    # it was lost, and a new one is to take its place
    identity = (tmp_path / "one" / "evidence" / "identity").read_text()
    assert identity in str(refused.value)
    (tmp_path / "two" / "evidence" / "identity").write_text(identity)
    with inline_service(tmp_path / "two", store=url):
        pass


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


def test_a_token_to_write_looks_up_a_part_but_does_not_list_parts(tmp_path: Path) -> None:
    with inline_service(tmp_path, port="0.0.0.0:8417") as (service, client):
        writes, reads = (
            {"Authorization": f"Bearer {service.store.add_token(scope, [scope])}"}
            for scope in (Scope.WRITE, Scope.READ)
        )
        part, other = (received(service.store, PartState.REVIEW, name=name) for name in ("P17", "P170"))

        def listed(query: str, who: dict[str, str]) -> set[str]:
            return {found["id"] for found in client.get(f"/v1/parts{query}", headers=who).json()}

        for query in ("", "?state=review", "?name=%20"):
            assert client.get(f"/v1/parts{query}", headers=writes).status_code == 403
            assert listed(query, reads) == {part.id, other.id}
        assert listed("?name=p17", writes) == {part.id}
        assert listed("?name=P1", writes) == set()
        assert listed("?name=p17", reads) == {part.id, other.id}
        assert client.get(f"/v1/parts/{part.id}", headers=writes).json()["name"] == "P17"


def test_a_second_reader_does_not_see_over_http_what_the_first_has_read(tmp_path: Path) -> None:
    options = {"port": "0.0.0.0:8417", "review": {"second_reader": True}}
    with inline_service(tmp_path, **options) as (service, client):
        ada, ben, cleo = (
            {"Authorization": f"Bearer {service.store.add_token(name, [Scope.READ, Scope.REVIEW])}"}
            for name in ("Ada", "Ben", "Cleo")
        )
        address = f"/v1/parts/{received(service.store, PartState.REVIEW).id}"

        def state_after(who: dict[str, str], text: str) -> str:
            review = {"action": "correct", "text": text}
            state: str = client.post(f"{address}/review", json=review, headers=who).json()["state"]
            return state

        assert state_after(ada, "ZZ11") == "review"
        assert "ZZ11" in client.get(f"{address}/history", headers=ada).text
        for path in ("", "/history"):
            assert "ZZ11" not in client.get(f"{address}{path}", headers=ben).text
        assert state_after(ben, "ZZ22") == "review"
        assert "ZZ11" in client.get(f"{address}/history", headers=ben).text
        assert state_after(cleo, "ZZ11") == "reviewed"


def test_accepted_parts_are_drawn_and_their_audits_are_among_the_figures(tmp_path: Path, parts: Path) -> None:
    photo = {"photo": ("clean.png", (parts / "clean.png").read_bytes())}
    with inline_service(tmp_path / "service", review={"audit_per_thousand": 1000.0}) as (service, client):
        part = client.post("/v1/parts", files=photo).json()
        assert part["state"] == "accepted"
        assert [p.id for p in service.store.queue(audits=True)] == [part["id"]]
        told = client.get(f"{part['links']['history']}").text
        assert "audit" not in told  # who audits it may look there
        assert client.get("/v1/figures").json()["audits"] == {
            "drawn": 1, "waiting": 1, "disputed": 0, "not_judged": 0,
            "accepted_wrong": {"count": 0, "total": 0, "low": 0.0, "high": 1.0},
        }  # fmt: skip


def test_an_alert_is_shown_counted_and_put_into_the_outbox(tmp_path: Path) -> None:
    options = {"alerts": {"reject_rate": 0.3}, "mqtt": {"url": "mqtt://127.0.0.1:9"}}
    with inline_service(tmp_path, **options) as (service, client):
        for _ in range(200):
            received(service.store, PartState.REVIEW, readings=(reading("KX4", "fused", "reject"),))
        service.look_for_alerts()
        service.look_for_alerts()
        assert "200 of the last 200 parts were rejected; the limit is 30 %." in client.get("/dashboard").text
        assert "tactile_marks_alerts 1.0" in client.get("/metrics").text
        assert service.store.undelivered() == 1
