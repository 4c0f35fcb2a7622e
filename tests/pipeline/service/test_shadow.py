"""A service in shadow mode: reads and compares, decides and publishes nothing, and goes live with what it kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from pipeline.common.line_decision import LineDecision, decision_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from tests.support.service_fixtures import Served, inline_service, triggered

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)
HOOK = {"webhook": {"url": "http://127.0.0.1:9/none"}}


class Bench:
    """Reads what a part is named: "KX40", "KX40?" unsurely, "" nothing; notes the orders."""

    def __init__(self) -> None:
        self.jobs: list[PartJob] = []

    def read(self, job: PartJob, *_: object) -> ReadPart:
        self.jobs.append(job)
        text = job.files.name.removesuffix("?").removeprefix("nothing")
        decision = "accept" if text == job.files.name else "review" if text else "reject"
        return ReadPart((ReadingRecord("fused" if job.files.scan else "vision", text, decision, 0.9),))


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def served(bench: Bench, tmp_path: Path) -> Iterator[Served]:
    camera = tmp_path / "camera"
    camera.mkdir()
    (camera / "KX40.png").write_bytes(PNG)
    settings = {
        "shadow": True,
        "camera": {"device": camera, "early_s": 3600.0},
        "device_timeout_s": 1.0,
        **HOOK,
    }
    with inline_service(tmp_path / "service", instead=bench.read, **settings) as both:
        yield both


def post(client: TestClient, name: str, expected: str = "", **more: Any) -> dict[str, Any]:
    answer = client.post(
        "/v1/parts", files={"photo": ("a.png", PNG)}, data={"name": name, "expected": expected, **more}
    )
    assert answer.status_code == 201, answer.text
    told: dict[str, Any] = answer.json()
    return told


@pytest.mark.parametrize(
    ("name", "expected", "shadow"),
    [
        ("KX40", "KX40", {"agreement": "same", "would_be": "accepted"}),
        ("KX40", "KX41", {"agreement": "other", "would_be": "accepted"}),
        ("KX40?", "KX41", {"agreement": "other", "would_be": "review"}),  # there is no stage to feel it
        ("nothing", "KX41", {"agreement": "nothing", "would_be": "review"}),
        ("KX40", "", {"agreement": "alone", "would_be": "accepted"}),
    ],
)
def test_nothing_is_decided(
    served: Served, bench: Bench, name: str, expected: str, shadow: dict[str, str]
) -> None:
    service, client = served
    part = post(client, name, expected, touch="stage")
    assert (part["state"], part["shadow"], part["expected"]) == ("shadow", shadow, expected)
    assert part["plan"] is None
    # the reader knows nothing of what the line's own has said
    assert [job.expected for job in bench.jobs] == [""]
    assert service.store.undelivered() == 0
    assert service.store.queue() == ()
    assert client.post(f"/v1/parts/{part['id']}/touch").status_code == 409


def test_what_the_stage_or_the_sender_would_feel_would_need_touch(
    served: Served, bench: Bench, tmp_path: Path
) -> None:
    planned = post(served[1], "KX40?", touch="plan")
    assert (planned["state"], planned["shadow"]["would_be"]) == ("shadow", "touch_needed")
    maps = tmp_path / "maps"
    maps.mkdir()
    with inline_service(tmp_path / "other", instead=bench.read, shadow=True, stage={"device": maps}) as both:
        unsure = post(both[1], "KX40?", touch="stage")
        assert (unsure["state"], unsure["shadow"]["would_be"]) == ("shadow", "touch_needed")


def test_what_no_serial_can_be_is_compared_all_the_same(served: Served) -> None:
    # with a format AA999999 it would be refused as expected text
    assert post(served[1], "KX40", "NO READ!")["shadow"]["agreement"] == "other"


def test_a_trigger_is_answered_without_a_decision(served: Served) -> None:
    part = triggered(served, "KX40")
    assert (part.state, decision_of(part)) == (PartState.SHADOW, LineDecision.SHADOW)


def test_a_scan_is_read_and_compared_too(served: Served, bench: Bench) -> None:
    _, client = served
    part = post(client, "KX40?", "KX40")
    read = client.post(f"/v1/parts/{part['id']}/scan", files={"scan": ("a.h5", b"\x89HDF\r\n\x1a\n")}).json()
    assert (read["state"], read["shadow"]) == ("shadow", {"agreement": "same", "would_be": "review"})
    assert [job.expected for job in bench.jobs] == ["", ""]


def test_a_review_says_who_was_right_and_is_not_published(served: Served) -> None:
    service, client = served
    part = post(client, "KX40", "KX41")
    body = {"action": "correct", "text": "KX41", "who": "Ada", "outside_format": True}
    assert client.post(f"/v1/parts/{part['id']}/review", json=body).status_code == 200
    assert service.store.undelivered() == 0
    assert "the line’s" in client.get("/shadow").text


def test_live_it_decides_and_leaves_what_was_compared(bench: Bench, tmp_path: Path) -> None:
    def serve(**settings: Any) -> Any:
        return inline_service(tmp_path / "service", instead=bench.read, **settings, **HOOK)

    with serve(shadow=True) as (service, client):
        before = post(client, "KX40?", "KX41")
    with serve() as (service, client):
        live = post(client, "KX40", "KX40")
        assert (live["state"], live["shadow"], bench.jobs[-1].expected) == ("accepted", None, "KX40")
        assert service.store.undelivered() == 1
        # a part of before stays undecided, whatever is added to it
        scan = {"scan": ("a.h5", b"\x89HDF\r\n\x1a\n")}
        read = client.post(f"/v1/parts/{before['id']}/scan", files=scan).json()
        assert read["state"] == "shadow"
        body = {"action": "confirm", "text": "KX40", "who": "Ada", "outside_format": True}
        assert client.post(f"/v1/parts/{before['id']}/review", json=body).status_code == 200
        assert service.store.undelivered() == 1
        page = client.get("/shadow").text
        assert "The service decides now" in page
        assert '<a href="./shadow"' not in client.get("/review").text
        ready = client.get("/readyz").json()
        assert "mode" not in ready
