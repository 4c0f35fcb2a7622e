"""A folder that is watched: every complete photograph becomes a part once, and nothing else does."""

from __future__ import annotations

import asyncio
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import structlog

from glyphs.errors import FileError
from pipeline.common.private import open_no_link
from pipeline.common.records import PartRecord, PartState
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from pipeline.service.inputs.watch_folder import LEFT_S, WatchedFolder
from pipeline.service.intake import NewPart, Received, Touch
from pipeline.service.settings import WatchSettings
from pipeline.service.web.problem import Problem
from pipeline.service.web.uploads import Upload
from pipeline.store.errors import StoreError
from pipeline.workers.executors import WorkerLostError
from tests.support.line_fakes import LONG_S, reading
from tests.support.service_fixtures import Served, inline_service
from tests.support.store_samples import received
from tests.support.waiting import wait_until

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100) + b"IEND"


class Bench:
    """A folder, and a service that looks at it when it is told to; `anew` is a restart."""

    def __init__(
        self, folder: Path, served: Served, *, a_set: int = 0, unfinished_s: float = 0.0, **settings: bool
    ) -> None:
        self.folder = folder / "in"
        self.folder.mkdir()
        service, client = served
        self.intake, self.store, self.portal = service.intake, service.store, client.portal
        self.settings, self.times = (
            {"photos": a_set, **settings},
            {"unfinished_s": unfinished_s, "settle_s": 0.0},
        )
        self.problem: Exception | None = None
        self.problems: dict[str, Exception] = {}
        self.tried: set[str] = set()
        self._receive = self.intake.receive
        self.intake.receive = self.receive  # type: ignore[method-assign]
        service.jobs.save("housing-left", {"format": "A9"})
        self.anew()

    async def receive(self, new: NewPart, photos: Sequence[Upload], **more: Any) -> Received:
        self.tried.add(new.name)
        if (problem := self.problems.get(new.name, self.problem)) is not None:
            raise problem
        return await self._receive(new, photos, **more)

    def anew(self) -> None:
        settings = WatchSettings(folder=self.folder, job="housing-left", **self.settings)
        self.watched = WatchedFolder(settings, self.intake, most_bytes=1000, at_once=1, **self.times)

    def put(self, name: str, data: bytes = PNG, *, at_s: float | None = None) -> Path:
        path = self.folder / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_bytes(data)
        if at_s is not None:
            os.utime(path, (at_s, at_s))
        return path

    def left(self) -> dict[str, list[str]]:
        """What is said of files that are left, by name, in four looks."""
        with structlog.testing.capture_logs() as logs:
            self.look(4)
        said: dict[str, list[str]] = {}
        for one in logs:
            if one["event"] == "watched file left":
                said.setdefault(one["file"], []).append(one["why"])
        return said

    def why_unread(self, name: str) -> str:
        """Why the photograph of a part for a person could not be read."""
        (part,) = [part for part in self.parts if part.name == name]
        assert (part.state, part.text, part.touch) == (PartState.REVIEW, "", None)
        assert part.reading is not None
        assert part.reading.decision == "reject"
        (message,) = part.reading.messages
        assert message.startswith("photograph cannot be read: ")
        return message

    @property
    def parts(self) -> list[PartRecord]:
        """All parts, the first one first."""
        return [*reversed(self.store.parts())]

    @property
    def names(self) -> list[str]:
        return [part.name for part in self.parts]

    def sent(self, index: int) -> list[tuple[str, bytes]]:
        """Name and content of the files kept for a part."""
        kept = self.store.evidence(self.parts[index].id)
        return [(one.name, self.intake.evidence.path(one.sha256).read_bytes()) for one in kept]

    def look(self, times: int = 2) -> list[str]:
        """Look so often; names of all parts so far."""
        for _ in range(times):
            self.portal.call(self.watched.look)
        return self.names


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    read = ReadPart((reading(),))
    with inline_service(tmp_path / "service", instead=lambda *_: read) as both:
        yield both


@pytest.fixture
def bench(tmp_path: Path, served: Served) -> Bench:
    return Bench(tmp_path, served)


def test_a_photograph_is_submitted_once_it_has_stood_still(bench: Bench) -> None:
    bench.put("part-3.png")
    assert bench.look(1) == []
    assert bench.look(1) == ["part-3"]
    assert bench.look(3) == ["part-3"]
    assert (bench.parts[0].job, bench.sent(0)) == ("housing-left", [("part-3.png", PNG)])
    assert (bench.folder / "part-3.png").read_bytes() == PNG
    assert not list(bench.intake.evidence.incoming.iterdir())


def test_one_that_is_being_written_waits(tmp_path: Path, served: Served) -> None:
    bench = Bench(tmp_path, served, unfinished_s=LONG_S)
    for n in range(1, 4):
        bench.put("a.png", PNG[: 30 * n])
        assert bench.look(3) == []  # it stands still, but its end is missing
    bench.put("empty.png", b"")
    bench.put("a.png")
    assert bench.look(3) == ["a"]


def test_one_that_stays_empty_or_is_no_file_is_a_part_for_a_person(tmp_path: Path, served: Served) -> None:
    bench = Bench(tmp_path, served, unfinished_s=0.2)
    bench.put("empty.png", b"")
    os.mkfifo(bench.folder / "pipe.png")
    assert bench.left() == {}
    time.sleep(0.2)
    assert bench.left() == {
        "empty.png": ["empty.png is empty"],
        "pipe.png": ["pipe.png is not a regular file"],
    }
    assert "empty.png is empty" in bench.why_unread("empty")
    assert "not a regular file" in bench.why_unread("pipe")
    bench.put("empty.png")
    assert bench.look(2) == ["empty", "pipe", "empty"]


def test_one_that_is_written_to_while_it_is_copied_waits(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = bench.put("a.png")
    kept = shutil.copyfileobj

    def slowly(source: Any, target: Any) -> None:
        kept(source, target)
        with path.open("ab") as stream:
            stream.write(b"more")

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "copyfileobj", slowly)
        assert bench.look(2) == []
    assert bench.look(2) == ["a"]
    assert bench.sent(0) == [("a.png", PNG + b"more")]


def test_a_restart_submits_nothing_twice(bench: Bench) -> None:
    bench.put("a.png")
    bench.look()
    bench.anew()
    bench.put("b.png")
    assert bench.look(3) == ["a", "b"]


def test_a_photograph_taken_out_of_a_set_makes_no_other_part_after_a_restart(bench: Bench) -> None:
    files = [bench.put(f"a.light-{number}.png") for number in (1, 2, 3)]
    assert bench.look() == ["a"]
    files[1].unlink()
    assert bench.look(3) == ["a"]
    bench.anew()
    assert bench.look(3) == ["a"]


def test_a_name_used_again_is_another_part(bench: Bench) -> None:
    bench.put("latest.png", at_s=1e9)
    bench.look()
    bench.put("latest.png", at_s=1e9 + 1)
    bench.look()
    bench.put("latest.png", PNG + b"x", at_s=1e9 + 1)
    assert bench.look() == ["latest"] * 3


def test_the_eldest_goes_first(bench: Bench) -> None:
    for k, name in enumerate(("c", "a", "b")):
        bench.put(f"{name}.png", at_s=1e9 + k)
    assert bench.look() == ["c", "a", "b"]


def test_a_photograph_that_cannot_even_be_taken_is_a_part_for_a_person_once(bench: Bench) -> None:
    bench.put("part.png", b"named as a picture")
    bench.put("large.png", PNG + bytes(1000))
    bench.put("phone.heic", b"\0\0\0\x18ftypheic" + bytes(50))
    (bench.folder / "link.png").symlink_to(bench.put("good.png"))
    said = bench.left()
    assert sorted(said) == ["large.png", "link.png", "part.png", "phone.heic"]
    for name, why in (
        ("large", "may be"),
        ("link", "link.png is not a regular file"),
        ("part", "PNG, JPEG, BMP, TIFF, WebP or GIF"),
        ("phone", "is a HEIC file, which is not read"),
    ):
        assert why in said[next(file for file in said if file.startswith(name))][0]
        assert why in bench.why_unread(name)
    bench.anew()
    assert bench.left() == {}
    assert sorted(bench.names) == ["good", "large", "link", "part", "phone"]
    assert len(list(bench.folder.iterdir())) == 5


def test_what_is_no_photograph_is_named_once(bench: Bench, tmp_path: Path) -> None:
    bench.put("notes.txt", b"no picture")
    bench.put("a.png")
    bench.put("a.dng", b"II*\0" + bytes(50))  # the raw data of a.png
    bench.put("picture-without-a-suffix")
    (tmp_path / "elsewhere").mkdir()
    (bench.folder / "link").symlink_to(tmp_path / "elsewhere")
    with structlog.testing.capture_logs() as logs:
        assert bench.look(4) == ["a", "picture-without-a-suffix"]
        bench.put("notes.txt", b"still no picture")
        assert bench.look(4) == ["a", "picture-without-a-suffix"]
        bench.put("notes.txt")
        assert bench.look(4) == ["a", "picture-without-a-suffix", "notes"]
    passed_over = sorted(log["name"] for log in logs if "passed over" in log["event"])
    assert passed_over == ["a.dng", "link", "notes.txt"]


@pytest.mark.parametrize("temporary", ["P17.jpg.part", ".P17.jpg.Xa1b2C"])
def test_an_upload_under_a_temporary_name_is_one_part_once_it_is_renamed(
    bench: Bench, temporary: str
) -> None:
    path = bench.put(temporary)
    assert bench.look(3) == []
    path.rename(bench.folder / "P17.jpg")
    assert bench.look(3) == ["P17"]


def test_subfolders_are_watched_and_stand_in_the_names_of_their_parts(bench: Bench) -> None:
    bench.put("part-1.png", at_s=1e9)
    bench.put("2026-11-29/part-1.png", at_s=1e9 + 1)
    bench.put("2026-11-30/tray 7/part-1.light-1.png", at_s=1e9 + 2)
    bench.put("2026-11-30/tray 7/part-1.light-2.png", at_s=1e9 + 2)
    bench.put("uploading.tmp/part-1.png")
    names = ["part-1", "2026-11-29/part-1", "2026-11-30/tray 7/part-1"]
    assert bench.look(3) == names
    assert len(bench.sent(2)) == 2
    (bench.folder / "uploading.tmp").rename(bench.folder / "2026-12-01")
    assert bench.look(3) == [*names, "2026-12-01/part-1"]
    bench.anew()
    assert len(bench.look(3)) == 4


def test_a_photograph_that_is_moved_into_a_subfolder_is_not_read_again(bench: Bench) -> None:
    path = bench.put("a.png")
    bench.look()
    (bench.folder / "done").mkdir()
    path.rename(bench.folder / "done" / "a.png")
    assert bench.look(3) == ["a"]
    bench.anew()
    assert bench.look(3) == ["a"]


def test_a_text_beside_a_photograph_is_the_serial_expected_of_it(tmp_path: Path, served: Served) -> None:
    bench = Bench(tmp_path, served, expected=True)
    bench.put("day/a.txt", b"\xef\xbb\xbfKX407251\r\nmore\r\n")
    bench.put("day/a.png")
    bench.put("b.png")
    bench.look(2)
    assert {part.name: part.expected for part in bench.parts} == {"day/a": "KX407251", "b": ""}


@pytest.mark.parametrize("written", ["kx407251".encode("utf-16"), b"KX407251;lot 7"])
def test_a_part_whose_expected_text_cannot_be_a_serial_is_read_and_goes_to_a_person(
    written: bytes, tmp_path: Path
) -> None:
    jobs: list[PartJob] = []

    def read(job: PartJob) -> ReadPart:
        jobs.append(job)
        if job.expected:
            raise FileError("expected", f"is {job.expected!r}, but it does not fit", "correct one of them")
        return ReadPart((reading(),))

    with inline_service(tmp_path / "s", instead=read) as served:
        bench = Bench(tmp_path, served, expected=True)
        bench.put("a.txt", written)
        bench.put("a.png")
        bench.look(2)
        (part,) = bench.parts
    assert [job.expected for job in jobs] == [part.expected, ""]
    assert part.expected in ("kx407251", "KX407251;lot 7")
    assert part.state is PartState.REVIEW
    assert part.reading is not None
    assert part.reading.text == reading().text
    assert part.reading.messages[-1] == (
        f"not verified: expected: is {part.expected!r}, but it does not fit; correct one of them"
    )


def test_only_the_latest_photograph_that_came_just_now_is_felt_at_once(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    touches: dict[str, Touch] = {}
    receive = bench.intake.receive

    async def noted(new: NewPart, photos: Sequence[Upload], **more: Any) -> Received:
        touches[new.name] = new.touch
        return await receive(new, photos, **more)

    monkeypatch.setattr(bench.intake, "receive", noted)
    bench.put("there before.png")
    bench.look()
    bench.put("first.png", at_s=1e9)
    bench.put("second.png", at_s=1e9 + 1)
    bench.look()
    assert touches == {"there before": Touch.ASKED, "first": Touch.ASKED, "second": Touch.STAGE}


def test_a_file_that_has_become_a_link_or_a_pipe_is_neither_followed_nor_waited_for(tmp_path: Path) -> None:
    (tmp_path / "link.png").symlink_to(__file__)
    with pytest.raises(OSError, match="link"):
        open_no_link(tmp_path / "link.png")
    os.mkfifo(tmp_path / "pipe.png")
    with open_no_link(tmp_path / "pipe.png") as stream:
        assert not stream.read(1)


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (FileError("a.png", "is cut short", "copy it again"), "is cut short"),
        (WorkerLostError("the part took longer than 9 s and was stopped", timed_out=True), "longer than 9 s"),
        (WorkerLostError("the worker has ended (exit code -9)"), "it has ended 2 workers"),
    ],
)
def test_a_photograph_that_cannot_be_read_is_a_part_for_a_person_once(
    bench: Bench, served: Served, fault: Exception, why: str
) -> None:
    pool, tries = served[0].pool, []

    def fail(*_: object) -> ReadPart:
        tries.append(1)
        raise fault

    bench.put("a.png")
    read, pool.instead = pool.instead, fail  # type: ignore[attr-defined]
    bench.look(4)
    assert why in bench.why_unread("a")
    assert bench.sent(0) == [("a.png", PNG)]
    assert len(tries) == (2 if "ended 2 workers" in why else 1)
    bench.anew()
    assert bench.look(4) == ["a"]
    pool.instead = read  # type: ignore[attr-defined]
    bench.put("a.png", PNG + b"the rest")
    wait_until(lambda: bench.look(1) == ["a", "a"])  # after lost workers a clean part is read first


def test_what_cannot_be_taken_now_waits(bench: Bench) -> None:
    busy = bench.problems = {
        "full": Problem(503, "full"),
        "fault": Problem(500, "fault of the program"),
        "away": StoreError("away"),
        "locked": PermissionError(13, "locked"),
        "no room": FileError("evidence", "cannot be kept", "make room"),
        "unforeseen": RuntimeError("unforeseen"),
    }
    for name in busy:
        bench.put(f"{name}.png")

    async def looks() -> None:
        while bench.tried != set(busy):
            await bench.watched.look()
        assert bench.names == []
        bench.problems = {}
        while sorted(bench.names) != sorted(busy):
            await bench.watched.look()
            await asyncio.sleep(0.01)

    bench.portal.call(asyncio.wait_for, looks(), LONG_S)


def test_a_folder_that_is_away_comes_back(bench: Bench, tmp_path: Path) -> None:
    bench.put("a.png")
    bench.look()
    os.rename(bench.folder, tmp_path / "away")
    with structlog.testing.capture_logs() as logs:
        bench.look(3)
    assert [one["event"] for one in logs] == ["watched folder cannot be looked at"]
    assert "the watched folder cannot be looked at (No such file or directory)" in bench.watched.trouble
    os.rename(tmp_path / "away", bench.folder)
    bench.put("b.png")
    assert bench.look(3) == ["a", "b"]
    assert bench.watched.trouble == ""


def test_without_its_watched_folder_a_service_is_not_ready_and_says_why(tmp_path: Path) -> None:
    watched = tmp_path / "in"
    watched.mkdir()
    with inline_service(tmp_path / "service", watch={"folder": watched}) as (service, client):
        wait_until(lambda: client.get("/readyz").status_code == 200)
        received(service.store)
        watched.rename(tmp_path / "away")
        wait_until(lambda: client.get("/readyz").status_code == 503)
        assert "the watched folder cannot be looked at" in client.get("/readyz").json()["detail"]
        service.look_for_alerts()
        assert [alert.name for alert in service.store.alerts()] == ["watched_folder"]
        (tmp_path / "away").rename(watched)
        wait_until(lambda: client.get("/readyz").status_code == 200)


def test_what_has_left_is_forgotten_and_what_comes_back_is_not_read_again(
    bench: Bench, tmp_path: Path
) -> None:
    for k in range(8):
        bench.put(f"{k}.png")
    bench.look()
    aside = tmp_path / "aside"
    aside.mkdir()
    for k in range(7):
        os.rename(bench.folder / f"{k}.png", aside / f"{k}.png")
    bench.look(1)
    assert sum(key.endswith("/7.png") for key in bench.watched._known_keys) == 1
    assert len(bench.watched._known_keys) == 2
    for k in range(7):
        os.rename(aside / f"{k}.png", bench.folder / f"{k}.png")
    assert len(bench.look(3)) == 8


def test_keys_are_kept_as_long_as_their_files_are_in_the_folder_and_some_months(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b", "c"):
        bench.put(f"{name}.png")
    assert not bench.watched.renew_keys(before=datetime.now(UTC))  # nothing is known before the first look
    assert bench.look(3) == ["a", "b", "c"]
    for name in ("b", "c"):
        os.rename(bench.folder / f"{name}.png", bench.folder.parent / f"{name}.png")
    for name, days in (("b", 80), ("c", 100)):
        later = datetime.now(UTC) + timedelta(days=days)
        monkeypatch.setattr(bench.store, "_now", lambda later=later: later)
        bench.look(1)
        assert bench.watched.renew_keys(before=later - timedelta(days=1))
        bench.store.forget_keys(later, files_before=later - timedelta(days=90))
        os.rename(bench.folder.parent / f"{name}.png", bench.folder / f"{name}.png")
        bench.anew()
        bench.look(3)
    assert bench.names == ["a", "b", "c", "c"]  # c was away for more than 90 days


def test_a_stop_does_not_wait_for_ever_and_what_it_cuts_short_is_read_later(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = asyncio.Event()

    async def forever(*_: object, **__: object) -> Received:
        begun.set()
        await asyncio.Event().wait()
        raise AssertionError

    async def watched() -> None:
        await bench.watched.start()
        await asyncio.wait_for(begun.wait(), LONG_S)
        await asyncio.wait_for(bench.watched.stop(grace_s=0.05), LONG_S)

    for name in ("a", "b"):
        bench.put(f"{name}.png")
    with monkeypatch.context() as patch:
        patch.setattr(bench.intake, "receive", forever)
        bench.portal.call(watched)
    assert bench.names == []
    bench.anew()
    assert bench.look(3) == ["a", "b"]


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(FileError, match=r"is not a folder that can be watched.*--watch"),
        inline_service(tmp_path / "service", watch={"folder": tmp_path / "none"}),
    ):
        pass


def test_photographs_of_several_lights_are_one_part(bench: Bench) -> None:
    for number in (2, 1, 10):
        bench.put(f"part-3.light-{number}.png", PNG + bytes([number]))
    bench.put("part-4.png")
    assert sorted(bench.look()) == ["part-3", "part-4"]
    names = {name for name, _ in bench.sent(bench.names.index("part-3"))}
    assert names == {f"part-3.light-{number}.png" for number in (1, 2, 10)}
    bench.anew()
    assert len(bench.look(3)) == 2


def test_a_set_waits_for_its_last_light(tmp_path: Path, served: Served) -> None:
    bench = Bench(tmp_path, served, a_set=3, unfinished_s=LONG_S)
    for number in (1, 2):
        bench.put(f"a.light-{number}.png")
    assert bench.look(4) == []
    bench.put("a.light-3.png")
    assert bench.look() == ["a"]


def test_a_set_that_nothing_is_added_to_is_read_as_it_is(tmp_path: Path, served: Served) -> None:
    bench = Bench(tmp_path, served, a_set=3, unfinished_s=0.2)
    bench.put("a.light-1.png")
    assert bench.look() == []
    time.sleep(0.25)
    assert bench.look(1) == ["a"]
    # the lamp that came late makes it another set
    bench.put("a.light-2.png")
    bench.look()
    time.sleep(0.25)
    assert bench.look(1) == ["a", "a"]
    assert [name for name, _ in bench.sent(1)] == ["a.light-1.png", "a.light-2.png"]


def test_a_set_of_any_number_is_read_when_nothing_is_added_for_a_while(bench: Bench) -> None:
    bench.times["settle_s"] = 0.2
    bench.anew()
    bench.put("a.light-1.png")
    assert bench.look() == []
    time.sleep(0.25)
    assert bench.look(1) == ["a"]


def test_one_of_a_set_that_is_no_picture_costs_itself_alone(bench: Bench) -> None:
    bench.put("a.light-1.png")
    broken = bench.put("a.light-2.png", b"no picture at all")
    ((why,),) = (said := bench.left()).values()
    assert bench.names == ["a"]
    assert [name for name, _ in bench.sent(0)] == ["a.light-1.png"]
    assert list(said) == [broken.name]
    assert "not a picture" in why
    bench.anew()
    assert bench.look(3) == ["a"]


def test_a_set_of_too_many_is_left_and_said(bench: Bench) -> None:
    for number in range(13):
        bench.put(f"a.shot-{number}.png")
    ((why,),) = bench.left().values()
    assert "12 of a part" in why
    assert "12 of a part" in bench.why_unread("a")


def test_hidden_characters_of_a_file_s_name_are_replaced_and_letters_composed(bench: Bench) -> None:
    for name in ("tray-7\u202e3-trap.png", "a\u200bb.png", "Gehause\u0308.png"):
        bench.put(name)
    assert sorted(bench.look()) == ["Gehausë", "a_b", "tray-7_3-trap"]


def test_folders_of_the_system_and_hidden_files_are_named_once(bench: Bench) -> None:
    bench.put("a.png")
    bench.put("$RECYCLE.BIN/b.png")
    bench.put(".archive/c.png")
    hidden = bench.put(".x.png")
    long_ago_s = time.time() - 2.0 * LEFT_S
    os.utime(hidden, (long_ago_s, long_ago_s))
    with structlog.testing.capture_logs() as logs:
        assert bench.look(4) == ["a"]
    assert sorted((log["name"], log["why"]) for log in logs if "passed over" in log["event"]) == [
        ("$RECYCLE.BIN", "is a folder of the system"),
        (".x.png", "has the name of an unfinished upload, or a hidden one"),
    ]
