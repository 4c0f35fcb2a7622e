"""Stages with sessions: felt pass by pass, closed whatever happens, and failing between two passes."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ScanPlanRecord
from pipeline.common.records import PartState
from pipeline.common.settings import ReadSettings
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_reader import PartReader
from pipeline.reading.readers import open_reader
from pipeline.service.stage import ScanOrder, SimulatedStage
from pipeline.service.stage.devices import BenchStage
from pipeline.service.stage.driver import DriverThread, StageLink
from tests.support.bench import HEIGHT_MM, a_pass, bench_settings, stamped
from tests.support.emulator.bench import EmulatedBench
from tests.support.scans import Jamming, feel_plan
from tests.support.service_fixtures import FORMAT, Served, inline_service
from tests.support.store_samples import STAGE_PLAN
from whisker_array.scan.recording import load_scan
from whisker_array.scan.session import StageSession
from whisker_array.scan.stage_error import StageError

PLAN = replace(STAGE_PLAN, region_mm=(100.0, 50.0, 160.0, 65.0), seconds=90.0)


class Iron:
    """A driver with sessions, as an integrator writes one; its iron is a simulated stage, and may jam."""

    folder: Path
    fails_after: int | None = None
    fault: type[Exception] = StageError
    opened: list[Jamming]

    def open(self, order: ScanOrder) -> Jamming:
        within = SimulatedStage(self.folder, seed=3).open(order)
        Iron.opened.append(Jamming(within, Iron.fails_after, Iron.fault))
        return Iron.opened[-1]


@pytest.fixture(scope="module")
def plan(parts: Path) -> ScanPlanRecord:
    """Of the whole plate, in a frame whose middle is elsewhere."""
    from pipeline import read_height_map

    width, height = read_height_map(parts / "clean.npz").size_mm
    region = (100.0, 50.0, 100.0 + width, 50.0 + height)
    return replace(PLAN, region_mm=region, middle_mm=(100.0 + 0.5 * width, 50.0 + 0.5 * height))


@pytest.fixture(scope="module")
def served(parts: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    from pipeline.formats import synth

    Iron.folder, Iron.opened = parts, []
    synth.iron_stage = Iron  # type: ignore[attr-defined]
    try:
        with inline_service(
            tmp_path_factory.mktemp("s"), stage={"device": "pipeline.formats.synth:iron_stage"}
        ) as both:
            yield both
    finally:
        del synth.iron_stage  # type: ignore[attr-defined]


@pytest.fixture(autouse=True)
def sound_iron() -> Iterator[None]:
    yield
    Iron.fails_after, Iron.fault, Iron.opened = None, StageError, []


def touched(served: Served, plan: ScanPlanRecord) -> tuple[int, dict[str, Any], str]:
    """Status and body of the answer where the stage feels a part that waits for touch, and its id."""
    service, client = served
    part_id = new_part_id()
    service.store.add_part(part_id=part_id, name="clean", state=PartState.TOUCH_NEEDED, plan=plan)
    answer = client.post(f"/v1/parts/{part_id}/touch")
    return answer.status_code, answer.json(), part_id


def recording_of(served: Served, part_id: str, folder: Path) -> Path:
    """The recording kept for a part."""
    service, client = served
    kept = next(e for e in service.store.evidence(part_id) if e.kind == "scan")
    path = folder / "kept.h5"
    path.write_bytes(client.get(f"/v1/parts/{part_id}/evidence/{kept.sha256}").content)
    return path


def test_a_driver_with_sessions_is_felt_until_the_serial_is_sure(
    served: Served, parts: Path, plan: ScanPlanRecord, tmp_path: Path
) -> None:
    status, part, part_id = touched(served, plan)
    assert (status, part["state"], part["text"]) == (200, "accepted", (parts / "clean.txt").read_text())
    (session,) = Iron.opened
    reading = part["reading"]
    assert session.closed == 1
    assert reading["stopped"] == "sure"
    assert len(reading["passes"]) == session.felt
    spent = [p["stage_s"] for p in reading["passes"]]
    assert spent == sorted(spent)
    assert reading["stage_s"] == spent[-1] < 0.5 * plan.seconds
    assert reading["passes"][-1]["text"] == part["text"].replace(" ", "")
    # in the frame of the order, lines and boxes alike
    x0, y0, x1, y1 = plan.region_mm
    for one in reading["passes"]:
        low, high = (x0, x1) if one["direction_deg"] in (0, 180) else (y0, y1)
        assert low - 0.1 <= one["along_mm"][0] < one["along_mm"][1] <= high + 0.1
    for character in reading["characters"]:
        assert x0 < character["box_mm"][0] < x1
        assert y0 < character["box_mm"][1] < y1
    # what is kept is read as a whole, and has every choice in its log
    reader = open_reader(ReadSettings(format=(FORMAT,), font=("gothic",), height_mm=5.0))
    path = recording_of(served, part_id, tmp_path)
    again = PartReader(reader).read(PartFiles("part", scan=str(path)))
    assert again.text == part["text"]
    assert again.confidence == pytest.approx(reading["confidence"], abs=0.005)
    log = load_scan(path).log
    assert log is not None
    assert [p.order.direction for p in log.passes] == [p["direction_deg"] for p in reading["passes"]]


def test_a_stage_that_fails_between_passes_gives_what_was_felt_to_review(
    served: Served, plan: ScanPlanRecord
) -> None:
    Iron.fails_after = 3
    status, part, _ = touched(served, plan)
    assert (status, part["state"]) == (200, "review")
    reading = part["reading"]
    assert reading["stopped"] == "stage failed"
    assert len(reading["passes"]) == 3
    assert any("failed after 3 passes: the array has jammed" in message for message in reading["messages"])
    assert [s.closed for s in Iron.opened] == [1]


@pytest.mark.parametrize(
    ("fault", "answered", "says"),
    [
        (StageError, 422, "the array has jammed"),
        (ValueError, 503, "the stage's driver has a fault (ValueError: the array has jammed)"),
    ],
)
def test_a_stage_that_feels_nothing_leaves_the_part_waiting(
    served: Served, plan: ScanPlanRecord, fault: type[Exception], answered: int, says: str
) -> None:
    Iron.fails_after, Iron.fault = 0, fault
    status, problem, part_id = touched(served, plan)
    assert status == answered
    assert says in problem["detail"]
    part = served[1].get(f"/v1/parts/{part_id}").json()
    assert part["state"] == "touch_needed"
    history = served[1].get(f"/v1/parts/{part_id}/history").json()
    assert history["events"][-1]["kind"] == "touch_failed"
    assert [s.closed for s in Iron.opened] == [1]


def test_a_stage_that_cannot_open_says_why(served: Served, plan: ScanPlanRecord) -> None:
    status, problem, _ = touched(served, replace(plan, middle_mm=(500.0, 500.0)))
    assert status == 422
    assert "is not on the field" in problem["detail"]
    assert Iron.opened == []


def test_a_link_that_no_worker_comes_to_ends() -> None:
    class Never:
        def open(self, order: ScanOrder) -> StageSession:
            raise AssertionError("nobody asked")

    link = StageLink(Never(), DriverThread("stage", timeout_s=5.0))
    asyncio.run(link.close())
    with pytest.raises(OSError):  # noqa: PT011 - whichever the system says of a socket that is gone
        link.stage.open(ScanOrder("part", PLAN))


def order(region_mm: tuple[float, float, float, float]) -> ScanOrder:
    """Of a photograph whose middle is its (20, 10), taken over the middle of the field, (7, 5)."""
    return ScanOrder(
        "plate 7",
        ScanPlanRecord(
            region_mm=region_mm, directions_deg=(0,), passes=1, line_pitch_mm=0.075, sample_pitch_mm=0.0375,
            speed_mm_s=40.0, preload_mm=0.6, seconds=9.0, height_mm=HEIGHT_MM, reason="to try it",
            middle_mm=(20.0, 10.0),
        ),
    )  # fmt: skip


def test_the_service_feels_in_the_photographs_frame(tmp_path: Path) -> None:
    with EmulatedBench(stamped(), bench_settings(), seed=1) as emulated:
        stage = BenchStage(emulated.settings)
        session = stage.open(order((14.0, 6.0, 30.0, 14.0)))
        # the region, as far as the field reaches: its right end lies at 7 + (30 - 20) = 17 of 14 mm
        assert session.fitting.field_mm == (14.0, 6.0, 27.0, 14.0)
        # 13 mm right and 5 mm below: the same place of the plate
        sweep = session.feel(a_pass(at_mm=(19.0, 10.0)))
        assert not sweep.flags.any()
        assert sweep.plan.line_mm[0].tolist() == [7.0, 10.0, 13.0]
        assert (
            emulated.world.place_mm["X"] > 30.0 + 9.0 - 2.0
        )  # 9 mm on the plate, the tip 2 mm ahead of its axis
        session.close()
        with pytest.raises(StageError, match="no longer on the stage"):
            session.feel(a_pass())
        with pytest.raises(StageError, match="not on the field"):
            stage.open(order((40.0, 6.0, 60.0, 14.0)))
        scan = load_scan(feel_plan(stage, order((16.0, 8.0, 20.0, 11.5)), tmp_path))
        assert scan.part_id == "plate 7"
        assert scan.sweeps[0].plan.line_mm.min() == 8.0
