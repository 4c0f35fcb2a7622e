"""What measurements say of whiskers, bench and parts: the golden part, a dead whisker, drift."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs import stamp
from pipeline.cli.main import main
from pipeline.common.golden_record import GoldenMeasure, Measured
from pipeline.common.people_records import Person
from pipeline.common.records import PartState, ReviewAction
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.reading.drift import EVERY
from pipeline.reading.triage import ReadPart
from pipeline.service import golden as module
from recognition.decide.decision import Decision
from tests.support.bench_faults import recorded
from tests.support.certificates import measured, written
from tests.support.service_fixtures import FORMAT, inline_service, triggered
from tests.support.store_samples import reading, received
from whisker_array.estimation.faults import FaultKind
from whisker_array.scan.recording import save_scan
from whisker_array.scan.scan import trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.touch import default_touch

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


TEXT = "KX40"
DEAD = "whisker 3, dead whisker: gives"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """dead.h5 and sound.h5, of one part."""
    folder = tmp_path_factory.mktemp("recordings")
    surface = stamp(TEXT, fonts="gothic", height_mm=5.0, seed=3).height_map
    plan = default_plan((0.0, 0.0, *surface.size_mm), character_height_mm=5.0)
    scan = trace_scan(surface, touch=default_touch(5.0), plan=plan, fidelity=Fidelity.POINTWISE)
    for name, fault in (("dead", FaultKind.DEAD), ("sound", None)):
        save_scan(recorded(scan, rng=np.random.default_rng(0), fault=fault, whisker=3), folder / f"{name}.h5")
    return folder


@pytest.mark.usefixtures("inline")
def test_inspect_reads_on_and_says_what_to_do(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = ["--format", "AA99", "--font", "gothic", "--height-mm", "5"]
    picture = tmp_path / "dead.png"
    assert main(["inspect", str(recordings / "dead.h5"), *named, "--out", str(picture)]) == 0
    printed = capsys.readouterr().out
    assert TEXT in printed
    assert DEAD in printed
    assert "check for breakage, gauge and wire" in printed


def test_the_service_tells_it_after_the_second_part_until_parts_are_sound(
    recordings: Path, tmp_path: Path
) -> None:
    with inline_service(tmp_path / "service") as (service, client):

        def send(name: str) -> dict[str, object]:
            scan = (f"{name}.h5", (recordings / f"{name}.h5").read_bytes())
            return client.post("/v1/parts", files={"scan": scan}).json()["reading"]

        first = send("dead")
        assert first["text"] == TEXT
        assert first["decision"] == Decision.ACCEPT.value
        (fault,) = first["faults"]
        assert fault.startswith(DEAD)
        assert fault in first["messages"]
        assert client.get("/readyz").json() == {"status": "ready", "bench": "none"}
        send("dead")
        assert client.get("/readyz").json()["bench"] == fault
        assert "tactile_marks_bench_fault 1.0" in client.get("/metrics").text
        service.look_for_alerts()
        assert "dead whisker" in client.get("/dashboard").text
        assert send("sound")["faults"] == []
        send("sound")
        assert client.get("/readyz").json() == {"status": "ready", "bench": "none"}
        service.look_for_alerts()
        assert "dead whisker" not in client.get("/dashboard").text


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
