from __future__ import annotations

import asyncio
import os
import pickle
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.common.line_decision import LineDecision, decision_of
from pipeline.common.part_id import new_part_id
from pipeline.common.records import PartRecord, PartState, TouchWait
from pipeline.common.settings import ReadSettings
from pipeline.formats.npz import write_npz
from pipeline.formats.touch_file import read_scan
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from pipeline.service.app import Service
from pipeline.service.stage import FolderCamera, ScanOrder, SimulatedStage
from pipeline.service.stage.work import CameraWork, StageWork, TouchCall
from pipeline.service.touch_queue import STOPPED
from pipeline.service.web.problem import Problem
from tests.support.line_fakes import LONG_S
from tests.support.scans import feel_plan
from tests.support.service_fixtures import Served, inline_service, triggered
from tests.support.store_samples import STAGE_PLAN, reading
from tests.support.waiting import wait_until
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.stage_error import StageError


@pytest.fixture
def plates(tmp_path: Path) -> Path:
    """A folder with one plate, 20 x 10 mm, with a pit at (6, 4) mm."""
    folder = tmp_path / "plates"
    folder.mkdir()
    y, x = np.mgrid[0:101, 0:201] * 0.1
    z = -0.3 * np.exp(-((x - 6.0) ** 2 + (y - 4.0) ** 2) / 0.5)
    write_npz(folder / "plate.npz", HeightMap(z.astype(np.float32), 0.1))
    (folder / "plate.png").write_bytes(b"picture")
    (tmp_path / "outside.npz").write_bytes((folder / "plate.npz").read_bytes())
    return folder


def pit_mm(path: Path) -> tuple[float, float]:
    """Where the deepest place of a recording lies, in its frame."""
    edges = edge_map(read_scan(path))
    size = np.where(edges.valid, np.abs(edges.enhancement.mean(axis=0)), 0.0)
    weight = np.where(size > 0.5 * size.max(), size, 0.0)
    rows, cols = np.mgrid[0 : size.shape[0], 0 : size.shape[1]]
    x, y = (float((weight * k).sum() / weight.sum()) for k in (cols, rows))
    return (edges.origin_mm[0] + edges.pitch_mm * x, edges.origin_mm[1] + edges.pitch_mm * y)


@pytest.mark.parametrize("off", [(0.0, 0.0), (30.0, -12.0)])
def test_recording_lies_in_the_frame_of_the_order(
    plates: Path, tmp_path: Path, off: tuple[float, float]
) -> None:
    x0, y0, x1, y1 = STAGE_PLAN.region_mm
    # the middle of the picture lies over the middle of the plate, (10, 5) mm, wherever its frame has that
    plan = replace(
        STAGE_PLAN,
        region_mm=(x0 + off[0], y0 + off[1], x1 + off[0], y1 + off[1]),
        middle_mm=(10.0 + off[0], 5.0 + off[1]),
    )
    made = feel_plan(
        SimulatedStage(plates, ReadSettings(sensors="ideal")), ScanOrder("plate", plan), tmp_path
    )
    # half a line pitch
    assert pit_mm(made) == pytest.approx((6.0 + off[0], 4.0 + off[1]), abs=0.06)
    scan = read_scan(made)
    assert scan.part_id == "plate"
    assert [int(d) for d in scan.directions] == [0, 90, 180, 270]
    lines = scan.sweeps[0].plan.line_mm
    assert lines.min() == pytest.approx(y0 + off[1])


NAMES = [
    "../outside",
    "..",
    ".",
    "",
    "/etc/passwd",
    "a/../../outside",
    "..\\outside",
    "plate.npz\0",
    "link",
    "x" * 5000,
    "\u00fc" * 150,  # of a file's name 300 bytes
    "C:plate",
    "other",
    "a\nb",
]


@pytest.mark.parametrize("name", NAMES)
def test_stage_and_camera_never_leave_their_folder(plates: Path, tmp_path: Path, name: str) -> None:
    os.symlink(tmp_path / "outside.npz", plates / "link.npz")
    os.symlink(tmp_path / "outside.npz", plates / "link.png")
    with pytest.raises(StageError):
        feel_plan(SimulatedStage(plates), ScanOrder(name, STAGE_PLAN), tmp_path)
    with pytest.raises(StageError):
        take(plates, name, tmp_path, timeout_s=0.2, early_s=LONG_S)


PNG = b"\x89PNG\r\n\x1a\n" + bytes(100) + b"IEND"
JPEG = b"\xff\xd8" + bytes(100) + b"\xff\xd9"


def take(
    pictures: Path,
    name: str,
    into: Path,
    *,
    timeout_s: float = LONG_S,
    early_s: float = 0.0,
    meanwhile: Callable[[], object] = list,
) -> list[tuple[str, bytes]]:
    """Name and content of the photographs that a folder camera gives to a trigger; something happens meanwhile."""
    work = CameraWork(FolderCamera(pictures, early_s), timeout_s=timeout_s)

    async def trigger() -> list[tuple[str, bytes]]:
        taking = asyncio.create_task(work.take(name, into, known=lambda _: ()))
        await asyncio.sleep(0.2)
        await asyncio.to_thread(meanwhile)
        return [(photo.name, photo.path.read_bytes()) for photo in (await taking).photos]

    return asyncio.run(trigger())


def test_a_camera_of_several_lights_gives_them_all(tmp_path: Path) -> None:
    def save() -> None:
        for name in ("a.light-2.png", "a.light-1.png", "ab.light-1.png", "a.light-3.txt"):
            (tmp_path / name).write_bytes(PNG)

    into = tmp_path / "into"
    into.mkdir()
    taken = take(tmp_path, "a", into, meanwhile=save)
    assert [name for name, _ in taken] == ["a.light-1.png", "a.light-2.png"]
    # one that is named as the part goes before
    taken = take(tmp_path, "a", into, meanwhile=lambda: (save(), (tmp_path / "a.png").write_bytes(PNG)))
    assert [name for name, _ in taken] == ["a.png"]


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_trigger_waits_for_a_picture_newer_than_itself_until_it_is_whole(
    tmp_path: Path, suffix: str
) -> None:
    whole = {".png": PNG, ".jpg": JPEG}[suffix]
    path = tmp_path / f"nest1{suffix}"
    path.write_bytes(whole + b"of the part before")

    def save() -> None:
        path.write_bytes(whole[:50])
        time.sleep(0.7)  # it stands still for a while, but is not whole
        path.write_bytes(whole)

    (tmp_path / "into").mkdir()
    assert take(tmp_path, "nest1", tmp_path / "into", meanwhile=save) == [(path.name, whole)]


def test_a_picture_from_before_the_trigger_counts_only_if_the_settings_say_so(tmp_path: Path) -> None:
    (tmp_path / "nest1.png").write_bytes(PNG)
    (tmp_path / "into").mkdir()
    with pytest.raises(StageError, match=r"no new photograph of nest1 .* after 0.3 s; .*camera.early_s"):
        take(tmp_path, "nest1", tmp_path / "into", timeout_s=0.3)
    assert take(tmp_path, "nest1", tmp_path / "into", early_s=LONG_S) == [("nest1.png", PNG)]
    os.utime(tmp_path / "nest1.png", (time.time() - 2.0 * LONG_S,) * 2)
    with pytest.raises(StageError, match="no new photograph"):
        take(tmp_path, "nest1", tmp_path / "into", timeout_s=0.3, early_s=LONG_S)


def test_a_wrong_job_or_expected_text_takes_no_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with inline_service(tmp_path) as served:
        service, client = served

        def take(*_: object, **__: object) -> None:
            raise AssertionError("the camera was asked")

        monkeypatch.setattr(service.intake.camera, "take", take)
        with pytest.raises(Problem, match="no job 'nope'"):
            triggered(served, "nest1", "nope")
        trigger = partial(service.intake.trigger, "nest1", expected="XX")
        with pytest.raises(Problem, match="expected: is 'XX', but it does not fit the format AA99"):
            client.portal.call(trigger)


def test_one_picture_is_read_for_one_part_also_after_a_restart(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "nest1.png").write_bytes(PNG)
    camera = {"device": pictures, "early_s": LONG_S}

    def read(*_: object) -> ReadPart:
        return ReadPart((reading(source="vision"),))

    for start in range(2):
        with inline_service(tmp_path / "s", instead=read, camera=camera, device_timeout_s=1.0) as served:
            assert served[1].portal is not None

            async def trigger(service: Service, times: int) -> list[object]:
                calls = [service.intake.trigger("nest1") for _ in range(times)]
                return await asyncio.gather(*calls, return_exceptions=True)

            answers = served[1].portal.call(trigger, served[0], 3)
            assert sum(isinstance(answer, PartRecord) for answer in answers) == (start == 0)
            assert len(served[0].store.parts()) == 1


def test_a_picture_that_stays_cut_short_is_a_part_for_a_person(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "nest1.png").write_bytes(PNG[:50])
    camera = {"device": pictures, "early_s": LONG_S}

    def fail(*_: object) -> ReadPart:
        raise FileError("nest1.png", "is cut short", "copy it again")

    with inline_service(tmp_path / "s", instead=fail, camera=camera, device_timeout_s=0.5) as served:
        part = triggered(served, "nest1")
        assert (part.state, part.text) == (PartState.REVIEW, "")
        assert part.reading is not None
        assert part.reading.messages == ("photograph cannot be read: nest1.png: is cut short; copy it again",)
        assert decision_of(part) is LineDecision.REJECT


def test_map_that_cannot_be_felt_is_told_without_folders(plates: Path, tmp_path: Path) -> None:
    (plates / "broken.npz").write_bytes(b"no map")
    with pytest.raises(StageError) as caught:
        feel_plan(SimulatedStage(plates), ScanOrder("broken", STAGE_PLAN), tmp_path)
    assert str(plates) not in str(caught.value)
    assert "broken.npz" in str(caught.value)


def test_stage_errors_survive_pickling() -> None:
    error = pickle.loads(pickle.dumps(StageError("jammed", "free it")))
    assert (error.what, error.hint, str(error)) == ("jammed", "free it", "jammed; free it")


class Nest:
    """A stage that has a part or not; it remembers what it has felt."""

    air = True
    felt: ClassVar[list[str]] = []
    there: str | None = None

    def feel(self, order: ScanOrder, into: Path) -> Path:
        if not Nest.air:
            raise StageError("the air pressure is low", "check the compressor")
        Nest.felt.append(order.part_name)
        path = into / "felt.h5"
        path.write_bytes(b"recording")
        return path


class NestWithSwitch(Nest):
    """A stage that knows which part it has."""

    def is_in_place(self, part_name: str) -> bool:
        return Nest.there == part_name


@pytest.fixture
def nest(monkeypatch: pytest.MonkeyPatch) -> type[Nest]:
    Nest.air, Nest.felt, Nest.there = True, [], None
    monkeypatch.setattr("pipeline.formats.synth.nest", Nest, raising=False)
    monkeypatch.setattr("pipeline.formats.synth.nest_with_switch", NestWithSwitch, raising=False)
    return Nest


def read_unsurely(job: PartJob, *_: object) -> ReadPart:
    """The camera is unsure of every part, touch of none."""
    if job.files.scan:
        return ReadPart((reading("KX407251", "fused"),))
    return ReadPart((reading("KX4O7251", source="vision", decision="review"),), plan=STAGE_PLAN)


PHOTO = {"photo": ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(100))}
TRIGGER = {"name": "P17", "touch": "stage"}


def looks(served: Served, n: int = 3) -> None:
    """Let the queue look so often."""
    assert served[1].portal is not None
    for _ in range(n):
        served[1].portal.call(served[0].intake.touching.look)


def test_a_driver_that_knows_its_part_has_it_felt_as_soon_as_it_lies_there(
    tmp_path: Path, nest: type[Nest]
) -> None:
    stage = {"device": "pipeline.formats.synth:nest_with_switch"}
    with inline_service(tmp_path / "s", instead=read_unsurely, stage=stage) as served:
        served[0].intake.touching.retry_s = 0.0
        part = served[1].post("/v1/parts", files=PHOTO, data=TRIGGER).json()
        assert part["state"] == "touch_needed"
        looks(served)
        assert nest.felt == []
        nest.there = "P17"
        wait_until(lambda: looks(served, 1) or served[0].store.part(part["id"]).state is PartState.ACCEPTED)
        assert nest.felt == ["P17"]
        # it is taken away while it is felt
        nest.there = "P18"
        feel = nest.feel

        def lifted(self: Nest, order: ScanOrder, into: Path) -> Path:
            nest.there = None
            return feel(self, order, into)

        nest.feel = lifted  # type: ignore[method-assign]
        try:
            other = served[1].post("/v1/parts", files=PHOTO, data=TRIGGER | {"name": "P18"}).json()
        finally:
            nest.feel = feel  # type: ignore[method-assign]
        assert other["state"] == "touch_needed"
        assert nest.felt == ["P17", "P18"]


def test_a_part_is_not_felt_for_a_caller_that_has_gone(nest: type[Nest], tmp_path: Path) -> None:
    async def has_gone() -> bool:
        return True

    work = StageWork(nest())
    with pytest.raises(StageError, match="its caller has gone"):
        asyncio.run(work.scan(ScanOrder("P17", STAGE_PLAN), tmp_path, TouchCall(has_gone=has_gone)))
    assert nest.felt == []


def test_a_part_is_not_felt_after_the_time_of_its_trigger(tmp_path: Path, nest: type[Nest]) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / "P17.png").write_bytes(PNG)
    settings = {
        "stage": {"device": "pipeline.formats.synth:nest"},
        "camera": {"device": pictures, "early_s": 60},
    }
    with inline_service(tmp_path / "s", instead=read_unsurely, **settings) as served:
        assert served[1].portal is not None
        part = served[1].portal.call(partial(served[0].intake.trigger, "P17", within_s=0.1))
        assert part.state is PartState.REVIEW
        assert "the time of its trigger is over" in part.not_felt
        assert nest.felt == []


def test_why_a_part_was_not_felt_is_shown_and_a_person_may_have_it_felt(
    tmp_path: Path, nest: type[Nest]
) -> None:
    nest.air = False
    stage = {"device": "pipeline.formats.synth:nest"}
    with inline_service(tmp_path / "s", instead=read_unsurely, stage=stage) as served:
        part = served[1].post("/v1/parts", files=PHOTO, data=TRIGGER).json()
        page = served[1].get(f"/parts/{part['id']}", headers={"accept": "text/html"}).text
        assert "the air pressure is low" in page
        assert f'action="../parts/{part["id"]}/touch"' in page
        nest.air = True  # a person has put it back, and says so
        assert served[1].post(f"/parts/{part['id']}/touch", follow_redirects=True).status_code == 200
        released = served[1].get(f"/v1/parts/{part['id']}").json()
        assert (released["state"], released["text"], released["not_felt"]) == ("accepted", "KX407251", "")
        assert nest.felt == ["P17"]
        assert served[1].post(f"/v1/parts/{part['id']}/touch").status_code == 409


def test_a_part_that_a_kill_has_left_to_the_stage_goes_to_a_person_at_the_next_start(
    tmp_path: Path, nest: type[Nest]
) -> None:
    stage = {"device": "pipeline.formats.synth:nest"}
    settings: dict[str, Any] = {"instead": read_unsurely, "stage": stage}
    with inline_service(tmp_path / "s", **settings) as served:
        store = served[0].store
        until = datetime.now(UTC) + timedelta(seconds=900.0)
        unsure = (reading("KX4O7251", source="vision", decision="review"),)
        waits = {"state": PartState.TOUCH_NEEDED, "readings": unsure, "plan": STAGE_PLAN}
        left, asked, elsewhere = new_part_id(), new_part_id(), new_part_id()
        store.add_part(part_id=left, name="P17", touch=TouchWait(True, until), **waits)
        store.add_part(part_id=asked, name="P18", touch=TouchWait(False, until), **waits)
        store.add_part(part_id=elsewhere, name="P19", touch=TouchWait(True, until), line="paint", **waits)
    with inline_service(tmp_path / "s", **settings) as served:
        looks(served)
        store = served[0].store
        part = store.part(left)
        assert (part.state, part.not_felt, part.plan) == (PartState.REVIEW, STOPPED, STAGE_PLAN)
        assert {store.part(other).state for other in (asked, elsewhere)} == {PartState.TOUCH_NEEDED}
        assert nest.felt == []


def test_a_name_has_one_form_and_hidden_characters_are_refused(tmp_path: Path) -> None:
    part = ReadPart((reading("KX40", "tactile"),))
    with inline_service(tmp_path, instead=lambda *_: part) as served:

        def sent(**fields: str) -> Any:
            return served[1].post("/v1/parts", files={"scan": ("a.npz", b"x")}, data=fields)

        assert sent(name=" Gehause\u0308  7").json()["name"] == "Gehausë 7"
        assert served[1].get("/v1/parts", params={"name": "GEHAUSË"}).json()[0]["name"] == "Gehausë 7"
        for fields in ({"name": "a\u202eb"}, {"name": "a\U000e0041"}, {"expected": "K1\u3164"}):
            answer = sent(**fields)
            assert (answer.status_code, answer.headers["content-type"]) == (422, "application/problem+json")
        with pytest.raises(Problem) as caught:
            triggered(served, "a\u200bb")
        assert caught.value.status == 422
