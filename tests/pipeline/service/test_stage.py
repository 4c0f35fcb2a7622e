from __future__ import annotations

import asyncio
import os
import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from pipeline.formats.npz import write_npz
from pipeline.formats.touch_file import read_scan
from pipeline.reading.triage import ReadPart
from pipeline.service.stage import FolderCamera, ScanOrder, SimulatedStage
from pipeline.service.stage.work import CameraWork, StageWork
from tests.support.scans import feel_plan
from tests.support.service_fixtures import inline_service
from tests.support.store_samples import STAGE_PLAN, reading
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
    made = feel_plan(SimulatedStage(plates, noise=False), ScanOrder("plate", plan), tmp_path)
    # half a line pitch
    assert pit_mm(made) == pytest.approx((6.0 + off[0], 4.0 + off[1]), abs=0.06)
    scan = read_scan(made)
    assert scan.part_id == "plate"
    assert [int(d) for d in scan.directions] == [0, 90, 180, 270]
    lines = scan.sweeps[0].plan.line_mm
    assert lines.min() == pytest.approx(y0 + off[1])


def test_the_same_part_gives_the_same_moments(plates: Path, tmp_path: Path) -> None:
    moments = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        made = feel_plan(SimulatedStage(plates, seed=3), ScanOrder("plate", STAGE_PLAN), tmp_path / name)
        moments.append(read_scan(made).sweeps[0].moment_n_mm)
    np.testing.assert_array_equal(*moments)


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
        FolderCamera(plates).take(name)


def test_a_camera_of_several_lights_gives_them_all(tmp_path: Path) -> None:
    for name in ("a.light-2.png", "a.light-1.png", "ab.light-1.png", "a.light-3.txt"):
        (tmp_path / name).touch()
    taken = FolderCamera(tmp_path).take("a")
    assert [path.name for path in taken] == ["a.light-1.png", "a.light-2.png"]  # type: ignore[union-attr]
    # one that is named as the part goes before
    (tmp_path / "a.png").touch()
    assert FolderCamera(tmp_path).take("a") == tmp_path.resolve() / "a.png"


def test_map_that_cannot_be_felt_is_told_without_folders(plates: Path, tmp_path: Path) -> None:
    (plates / "broken.npz").write_bytes(b"no map")
    with pytest.raises(StageError) as caught:
        feel_plan(SimulatedStage(plates), ScanOrder("broken", STAGE_PLAN), tmp_path)
    assert str(plates) not in str(caught.value)
    assert "broken.npz" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("", "the part has no name; give the name of its file without the ending"),
        ("P17", "there is no photograph of P17 in the folder .*; put it there as P17.png"),
        ("plate.png", "there is no photograph of plate.png in the folder .*; name the part without .png"),
    ],
)
def test_a_missing_photograph_has_a_hint(plates: Path, name: str, says: str) -> None:
    with pytest.raises(StageError, match=says):
        FolderCamera(plates).take(name)


def test_camera_finds_the_photograph_of_the_part(plates: Path) -> None:
    assert FolderCamera(plates).take("plate").read_bytes() == b"picture"


def test_where_there_is_no_stage_or_camera_the_hint_says_so(tmp_path: Path) -> None:
    with pytest.raises(StageError, match="send a scan"):
        asyncio.run(StageWork(None).scan(ScanOrder("plate", STAGE_PLAN), tmp_path))
    with pytest.raises(StageError, match="send a photograph"):
        asyncio.run(CameraWork(None).take("plate", tmp_path))


def test_stage_errors_survive_pickling() -> None:
    error = pickle.loads(pickle.dumps(StageError("jammed", "free it")))
    assert (error.what, error.hint, str(error)) == ("jammed", "free it", "jammed; free it")


def test_a_part_whose_file_never_comes_says_what_is_waited_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    maps = tmp_path / "maps"
    maps.mkdir()

    def read(_order: object, _settings: object, _limits: object, *felt_by: Any) -> ReadPart:
        if felt_by:
            stage, scan = felt_by
            stage.open(scan)
        return ReadPart((reading(source="vision", decision="review"),), plan=STAGE_PLAN)

    with inline_service(tmp_path / "s", instead=read, stage={"folder": maps}) as (
        service,
        client,
    ):
        photo = {"photo": ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(100))}
        part = client.post("/v1/parts", files=photo, data={"name": "P17", "touch": "stage"}).json()
        assert part["state"] == "touch_needed"
        said = caplog.text + capsys.readouterr().out
        assert "part not felt yet" in said
        assert str(maps) in said
        assert "waits_another_s" in said
        page = client.get(f"/parts/{part['id']}", headers={"accept": "text/html"}).text
        assert "there is no height map of P17 in the folder maps; put it there as P17.npz." in page
        assert "A person gets it if it is not scanned by" in page
        assert client.portal is not None
        client.portal.call(service.intake.touching.look)
        waits = client.get("/readyz").json()["touch"]
        assert re.fullmatch(
            r"1 part waits for the stage; it is given up in \d+ s; its page and the log say why", waits
        )
        asked = client.post("/v1/parts", files=photo, data={"name": "P18"}).json()
        assert f"/v1/parts/{asked['id']}/touch" in client.get(f"/parts/{asked['id']}").text
