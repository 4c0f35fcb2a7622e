"""The whole service with people at it: whose name a review bears, parts drawn for audits, alerts."""

from __future__ import annotations

from pathlib import Path

from pipeline.common.records import PartState, Scope
from tests.support.service_fixtures import inline_service
from tests.support.store_samples import reading, received


def test_a_token_to_write_looks_up_a_part_but_does_not_list_parts(tmp_path: Path) -> None:
    with inline_service(tmp_path, host="0.0.0.0") as (service, client):
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
    options = {"host": "0.0.0.0", "review": {"second_reader": True}}
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
