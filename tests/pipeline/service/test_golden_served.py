"""The golden part at the service: taken in, shown, told, and never among the parts."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.golden_record import GoldenMeasure, Measured
from pipeline.service import golden as module
from tests.support.service_fixtures import inline_service
from tests.support.store_samples import received

SCAN = {"scan": ("a.h5", b"\x89HDF\r\n\x1a\n")}


@pytest.fixture
def radius(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What every scan shows of the tip."""
    shown = [0.06]

    def measured(scan: Path, called: str, relief: Path) -> dict[GoldenMeasure, Measured]:
        assert scan.is_file()
        assert called == "a.h5"
        assert relief.name == "golden.npz"
        return {GoldenMeasure.RADIUS: Measured(shown[0], 0.001), GoldenMeasure.GAIN: Measured(1.0, 0.001)}

    monkeypatch.setattr(module, "measure_sent", measured)
    return shown


def test_wear_raises_an_alert_until_the_whiskers_are_new(tmp_path: Path, radius: list[float]) -> None:
    settings = {"golden": {"relief": tmp_path / "golden.npz", "every_h": 8.0}}
    with inline_service(tmp_path / "service", **settings) as (service, client):
        received(service.store)  # alerts go with the line's latest part

        def alerts() -> dict[str, str]:
            service.look_for_alerts()
            return {alert.name: alert.message for alert in service.store.alerts()}

        assert alerts() == {"golden_overdue": "the golden part was not scanned for 8 h; scan it"}
        first = client.post("/v1/golden", files=SCAN)
        assert (first.status_code, first.json()["reference"], first.json()["worn"]) == (201, True, [])
        assert alerts() == {}
        radius[0] = 0.11
        again = client.post("/v1/golden", files=SCAN).json()
        assert again["reference"] is False
        assert alerts() == {"golden": again["worn"][0]}
        assert "change the whiskers" in again["worn"][0]
        page = client.get("/dashboard").text
        assert "The tips are worn" in page
        assert "0.110" in page
        assert page.count(", the reference") == 1
        assert client.post("/v1/golden", files=SCAN, data={"reference": "true"}).json()["worn"] == []
        assert alerts() == {}
        assert [scan["reference"] for scan in client.get("/v1/golden").json()] == [True, False, True]
        assert client.get("/v1/figures").json()["parts"] == 1


def test_without_a_golden_part_none_is_taken(tmp_path: Path) -> None:
    with inline_service(tmp_path) as (service, client):
        refused = client.post("/v1/golden", files=SCAN)
        assert refused.status_code == 409
        assert "no golden part is set up" in refused.json()["detail"]
        assert client.get("/v1/golden").json() == []
        assert service.golden.faults() == {}
        assert "Golden part" not in client.get("/dashboard").text
