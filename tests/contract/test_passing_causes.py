"""What is the service's own to mend is no verdict on what was sent, and one bad item does not stop the others."""

from __future__ import annotations

import io
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from PIL import Image

from glyphs import stamp
from tests.contract.front_doors import RunningService, main, run_service, status_of
from tests.support.waiting import wait_until

OPTIONS = ("--jobs", "1", "--format", "A9", "--height-mm", "4")


@pytest.fixture(scope="module")
def picture() -> bytes:
    """A photograph of a clean plate, as PNG."""
    buffer = io.BytesIO()
    Image.fromarray(stamp("K7", fonts="gothic", height_mm=4.0, seed=3).photograph().pixels).save(
        buffer, "png"
    )
    return buffer.getvalue()


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a glyph database, two jobs and a folder to watch."""
    folder = tmp_path_factory.mktemp("passing")
    assert main(["glyphs", "build", f"{folder}/g.glyphs", "gothic"]) == 0
    for name in ("watched", "s/jobs"):
        (folder / name).mkdir(parents=True)
    (folder / "s" / "jobs" / "line.toml").write_text(
        f'format = "A9"\nheight_mm = 4\ndatabase = "{folder}/g.glyphs"\n'
    )
    (folder / "s" / "jobs" / "other.toml").write_text('format = "A9"\nfont = "gothic"\nheight_mm = 4\n')
    return folder


@pytest.fixture(scope="module")
def hangups() -> Iterator[None]:
    """Hangups end what is started here, also where whoever runs the tests ignores them (`nohup`)."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="module")
def watching(place: Path, hangups: None) -> Iterator[RunningService]:
    """A service that watches a folder; by its clock the last sweep was more than ten years ago."""
    (place / "s" / "evidence" / "incoming").mkdir(parents=True)
    for name in ("incoming/left", "swept"):
        (place / "s" / "evidence" / name).touch()
        os.utime(place / "s" / "evidence" / name, (1e9, 1e9))
    options = (
        *OPTIONS,
        "--database",
        f"{place}/g.glyphs",
        "--drain-s",
        "0.2",
    )
    with run_service(
        place / "s", *options, "--watch.folder", f"{place}/watched", "--watch.job", "line"
    ) as running:
        yield running


def ready(service: RunningService) -> bool:
    return status_of(f"{service.url}/readyz") == 200


def send(service: RunningService, picture: bytes, **fields: str) -> httpx.Response:
    return httpx.post(
        f"{service.url}/v1/parts", files={"photo": ("a.png", picture)}, data=fields, timeout=60.0
    )


def names(service: RunningService) -> set[str]:
    return {part["name"] for part in httpx.get(f"{service.url}/v1/parts?limit=100").json()}


def is_passing(answer: httpx.Response) -> bool:
    return answer.status_code in (503, 507) and int(answer.headers["Retry-After"]) > 0


def test_a_file_whose_name_is_no_text_is_read_under_one_that_is(
    watching: RunningService, place: Path, picture: bytes
) -> None:
    odd = os.fsencode(place / "watched") + b"/St\xfcck-7.png"
    with open(odd, "wb") as stream:
        stream.write(picture)
    with open(odd.replace(b"ck-7", b"ck-8.light-1"), "wb") as stream:
        stream.write(picture)
    (place / "watched" / "after.png").write_bytes(picture)
    wait_until(lambda: {"after", "St_ck-7", "St_ck-8"} <= names(watching), watching.process)
    assert "Traceback" not in watching.log
    assert os.path.exists(odd)


@pytest.mark.parametrize("spoilt", ["g.glyphs", "s/jobs/line.toml"])
def test_a_file_of_the_service_that_is_away_for_a_while_costs_no_part(
    watching: RunningService, place: Path, picture: bytes, spoilt: str
) -> None:
    fresh = f"while-{Path(spoilt).stem}-was-away"
    (place / spoilt).rename(place / "away")
    try:
        wait_until(lambda: not ready(watching), watching.process)
        assert is_passing(send(watching, picture, job="line"))
        told = httpx.get(f"{watching.url}/readyz")
        assert is_passing(told)
        assert Path(spoilt).name in told.json()["detail"]
        assert "/" not in told.json()["detail"]
        (place / "watched" / f"{fresh}.png").write_bytes(picture)
    finally:
        (place / "away").rename(place / spoilt)
    wait_until(lambda: ready(watching), watching.process)
    assert send(watching, picture, job="line").status_code == 201
    wait_until(lambda: fresh in names(watching), watching.process)


def test_a_damaged_database_is_not_the_senders_fault(
    watching: RunningService, place: Path, picture: bytes
) -> None:
    whole = (place / "g.glyphs").read_bytes()
    (place / "g.glyphs").write_bytes(whole[: len(whole) // 2])
    try:
        answer = send(watching, picture)
        assert is_passing(answer)
        assert "g.glyphs" in answer.json()["detail"]
        other = send(watching, picture, job="other")
        assert other.status_code == 201, other.text
        assert not ready(watching)
    finally:
        (place / "g.glyphs").write_bytes(whole)
    wait_until(lambda: ready(watching), watching.process)


def test_a_job_that_cannot_be_written_is_not_the_senders_fault(watching: RunningService, place: Path) -> None:
    (place / "s" / "jobs").rename(place / "jobs-away")
    (place / "s" / "jobs").write_text("no folder")
    try:
        assert is_passing(httpx.put(f"{watching.url}/v1/jobs/fresh", json={"format": "A9"}))
    finally:
        (place / "s" / "jobs").unlink()
        (place / "jobs-away").rename(place / "s" / "jobs")
    assert httpx.put(f"{watching.url}/v1/jobs/fresh", json={"format": "A9"}).status_code == 201
    assert httpx.put(f"{watching.url}/v1/jobs/fresh", json={"format": "re:["}).status_code == 422


def test_a_clock_far_ahead_deletes_nothing_and_a_hangup_drains(watching: RunningService, place: Path) -> None:
    wait_until(lambda: "not swept" in watching.log, watching.process)
    assert (place / "s" / "evidence" / "incoming" / "left").exists()
    assert f"touch {place}/s/evidence/swept" in watching.log
    watching.process.send_signal(signal.SIGHUP)
    watching.process.wait(60.0)
    assert "Finished server process" in watching.log
