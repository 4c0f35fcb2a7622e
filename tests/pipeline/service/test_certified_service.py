"""A service that a certificate allows to accept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.drift import EVERY
from pipeline.service.app import Service
from tests.support.certificates import measured, written
from tests.support.service_fixtures import FORMAT, inline_service

SETTINGS = ReadSettings(format=(FORMAT,), font=("gothic",), height_mm=5.0)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Service, TestClient]]:
    folder = tmp_path_factory.mktemp("certified")
    path = written(folder / "c.json", SETTINGS)
    reading = SETTINGS.model_copy(update={"certificate": path})
    with inline_service(folder / "data", reading=reading) as both:
        yield both


def test_what_the_certificate_says_nothing_of_goes_on_to_touch(
    served: tuple[Service, TestClient], tmp_path: Path
) -> None:
    write_part(SynthSpec(format=FORMAT, seed=21), tmp_path / "clean", 0, photos=True)
    picture = ("clean.png", (tmp_path / "clean.png").read_bytes())
    part = served[1].post("/v1/parts", files={"photo": picture}, data={"touch": "plan"}).json()
    assert part["state"] == "touch_needed"  # the certificate is of touch alone
    assert "the certificate says nothing of what is read so (vision)" in part["reading"]["messages"]


def test_drift_is_told_at_readyz_in_the_metrics_and_on_the_page(served: tuple[Service, TestClient]) -> None:
    service, client = served
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


def test_a_certificate_of_other_settings_does_not_start_a_service(tmp_path: Path) -> None:
    path = written(tmp_path / "c.json", ReadSettings(format=("AA99",)))
    other = SETTINGS.model_copy(update={"certificate": path})
    with (
        pytest.raises(SettingsError, match="other settings"),
        inline_service(tmp_path / "data", reading=other),
    ):
        pass
