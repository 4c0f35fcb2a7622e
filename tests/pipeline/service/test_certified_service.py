"""A service that a certificate allows to accept."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from pipeline.common.people_records import Person
from pipeline.common.records import PartState, ReviewAction
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.reading.drift import EVERY
from pipeline.reading.triage import ReadPart
from tests.support.certificates import measured, written
from tests.support.service_fixtures import FORMAT, inline_service, triggered
from tests.support.store_samples import reading

SETTINGS = ReadSettings(format=(FORMAT,), font=("gothic",), height_mm=5.0)
NOBODY = "http://127.0.0.1:9/none"


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> ReadSettings:
    """Settings with a certificate, which is of touch alone."""
    path = written(tmp_path_factory.mktemp("certified") / "c.json", SETTINGS)
    return SETTINGS.model_copy(update={"certificate": path})


def test_a_trigger_has_the_stage_feel_what_the_certificate_does_not_cover(
    certified: ReadSettings, parts: Path, tmp_path: Path
) -> None:
    around = {
        "stage": {"device": parts},
        "camera": {"device": parts, "early_s": 3600.0},
        "webhook": {"url": NOBODY},
    }
    with inline_service(tmp_path / "data", reading=certified, **around) as served:
        part, store = triggered(served, "clean"), served[0].store
        first, last = store.story(part.id).readings
        assert "the certificate does not cover this sense (vision)" in first.messages
        assert "touch_needed" in [event.kind for event in store.story(part.id).events]
        assert (first.source, last.source) == ("vision", "fused")
        assert last.passes
        assert store.undelivered() == 2  # that touch is needed, and what it has read
        assert part.state is not PartState.TOUCH_NEEDED
        store.review(part.id, action=ReviewAction.CONFIRM, text="", person=Person("Anna"))
        assert store.part(part.id).state is PartState.REVIEWED


def test_drift_is_told_at_readyz_in_the_metrics_and_on_the_page(
    certified: ReadSettings, tmp_path: Path
) -> None:
    with inline_service(tmp_path, reading=certified) as (service, client):
        watch = service.jobs.watch("")
        assert watch is not None
        assert client.get("/readyz").json() == {"status": "ready", "drift": "none"}
        assert "tactile_marks_drift 0.0" in client.get("/metrics").text
        assert 'class="drift"' not in client.get("/dashboard").text
        for part in measured(EVERY, rough_um=5.0):
            watch.add("tactile", part)
        answer = client.get("/readyz")
        assert (answer.status_code, answer.json()["status"]) == (200, "ready")
        assert "unlike the certified ones" in answer.json()["drift"]
        assert "tactile_marks_drift 1.0" in client.get("/metrics").text
        assert 'class="drift"' in client.get("/dashboard").text


def test_parts_are_compared_beside_the_event_loop(
    certified: ReadSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A comparison imports SciPy's statistics, for seconds in which no other request would be answered."""
    read, threads = list(measured(EVERY, rough_um=5.0)), list[threading.Thread]()

    def unlike(*_: Any) -> tuple[()]:
        threads.append(threading.current_thread())
        return ()

    def work(*_: object) -> ReadPart:
        return ReadPart((reading("KX40", "tactile"),), measures=read.pop())

    monkeypatch.setattr("pipeline.reading.drift.unlike", unlike)
    with inline_service(tmp_path, reading=certified, instead=work) as (service, client):
        assert client.portal is not None
        loop = client.portal.call(threading.current_thread)
        while read:
            assert client.post("/v1/parts", files={"scan": ("part.h5", b"\x89HDF\r\n\x1a\n")}).is_success
        watch = service.jobs.watch("")
    assert watch is not None
    assert watch.parts == EVERY
    assert len(threads) == 1
    assert threads[0] is not loop


def test_a_certificate_of_other_settings_does_not_start_a_service(tmp_path: Path) -> None:
    path = written(tmp_path / "c.json", ReadSettings(format=("AA99",)))
    other = SETTINGS.model_copy(update={"certificate": path})
    with (
        pytest.raises(SettingsError, match="other settings"),
        inline_service(tmp_path / "data", reading=other),
    ):
        pass
