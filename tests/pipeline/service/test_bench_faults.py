"""A recording with a dead whisker, from the file to the person: read all the same, and the whisker named everywhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glyphs import stamp
from pipeline.cli.main import main
from recognition.decide.decision import Decision
from tests.support.bench_faults import recorded
from tests.support.service_fixtures import inline_service
from whisker_array.estimation.faults import FaultKind
from whisker_array.scan.recording import save_scan
from whisker_array.scan.scan import trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.touch import default_touch

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
