"""What faults are tried on: each does a little work in a folder, says what it has done, and can tell what is wrong.

`prepare` is not disturbed; `work` is, and goes on after an error as a program would: it tries again, a few times.
`check` finds a folder as a fault has left it, takes it up as the next start of the program does, and asserts that
whatever was acknowledged is there, once and whole. It may ask for what was not.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from PIL import Image

from glyphs.errors import FileError, MarksError
from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartRecord, PartState, Scope
from pipeline.common.settings import ReadSettings
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob
from pipeline.reading.part_pictures import Picture
from pipeline.reading.triage import ReadPart
from pipeline.runs.journal import Journal
from pipeline.runs.options import RunOptions
from pipeline.runs.outputs import RunJournal, export
from pipeline.runs.run import open_run
from pipeline.service.inputs.watch_folder import WatchedFolder
from pipeline.service.intake import NewPart, Received
from pipeline.service.jobs import JobFolder
from pipeline.service.settings import WatchSettings
from pipeline.service.web.uploads import Upload
from pipeline.store.errors import AlreadyDoneError, StoreError
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store
from pipeline.workers.executors import Executor
from tests.support.run_tables import read_rows
from tests.support.store_samples import reading

T = TypeVar("T")
Say = Callable[[str], None]
TRIES = 3
N = 3


@dataclass(frozen=True)
class Subject:
    """What faults are tried on.

    Attributes:
        prepare: makes what is there before, in an empty folder.
        work: what is disturbed; tells what it has done.
        check: (folder, what was told, whether the power was lost) - an AssertionError where something is wrong.
    """

    prepare: Callable[[Path], object]
    work: Callable[[Path, Say], object]
    check: Callable[[Path, list[str], bool], object]


def tried(work: Callable[[], object], *expected: type[Exception]) -> bool:
    """Whether it was done in the end; errors that the program tells its user are tried again."""
    for _ in range(TRIES):
        try:
            work()
            return True
        except (MarksError, *expected):
            continue
    return False


def opened_at_last(start: Callable[[], T]) -> T | None:
    """What was opened in the end; errors that the program tells its user are tried again."""
    made: list[T] = []
    return made[0] if tried(lambda: made.append(start())) else None


# ---------------------------------------------------------------- a part with its photograph, as the service keeps it

CONTENTS = (b"photo one" * 900, b"photo two" * 900, b"photo one" * 900)


def _url(root: Path) -> str:
    return f"sqlite:///{root}/store.db"


@contextlib.contextmanager
def _store(root: Path) -> Iterator[Store]:
    with contextlib.closing(Store.open(_url(root))) as store:
        yield store


def _empty_store(root: Path) -> None:
    with _store(root):
        pass


def _keep_part(store: Store, evidence: EvidenceFolder, number: int) -> str:
    folder = evidence.new_work_folder()
    try:
        sent = folder / "photo.png"
        sent.write_bytes(CONTENTS[number])
        digest, n_bytes = evidence.keep(sent)
        try:
            return store.add_part(
                part_id=new_part_id(),
                name=f"part {number}",
                state=PartState.ACCEPTED,
                readings=(reading(),),
                evidence=(EvidenceRecord(EvidenceKind.PHOTO, digest, n_bytes, "photo.png", "image/png"),),
                targets=("webhook",),
                idempotency=IdempotencyKey(f"key {number}", "f"),
            ).id
        except AlreadyDoneError as done:
            return done.part_id
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _evidence_work(root: Path, say: Say) -> None:
    places = opened_at_last(lambda: (Store.open(_url(root)), EvidenceFolder(root / "evidence")))
    if places is None:
        return
    for number in range(N):
        tried(lambda k=number: say(f"{k} {_keep_part(*places, k)}"), OSError)  # type: ignore[misc]
    places[0].close()


def _whole_store(root: Path) -> None:
    with contextlib.closing(sqlite3.connect(root / "store.db")) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        assert not db.execute("PRAGMA foreign_key_check").fetchall()


def _whole_parts(root: Path) -> list[PartRecord]:
    """The parts of a whole store, the files of each as they were kept."""
    with _store(root) as store:
        _whole_store(root)
        for part in store.parts():
            files = store.evidence(part.id)
            assert files, "a part without its evidence"
            for file in files:
                kept = EvidenceFolder(root / "evidence").path(file.sha256)
                assert kept.is_file(), f"a part names a file that is not there: {file.name}"
                data = kept.read_bytes()
                assert hashlib.sha256(data).hexdigest() == file.sha256, (
                    f"{len(data)} bytes for {file.n_bytes}"
                )
        return sorted(store.parts(), key=lambda part: part.name)


def _evidence_check(root: Path, said: list[str], _: bool) -> None:
    _whole_parts(root)
    with _store(root) as store:
        evidence = EvidenceFolder(root / "evidence")
        answered = dict(word.split() for word in said)
        for number, part_id in answered.items():
            assert store.part(part_id).name == f"part {number}"
        for number in range(N):
            again = _keep_part(store, evidence, number)
            assert again == answered.get(str(number), again), "one key has made two parts"
        assert store.undelivered() == N
    assert [part.name for part in _whole_parts(root)] == [f"part {k}" for k in range(N)]


# -------------------------------------------------------------------------------------------- tables of runs


RUN = {"font": "gothic"}
NAMES = [f"part-{k}" for k in range(4)]


def _record(name: str) -> ReadingRecord:
    return ReadingRecord(part=name, source="tactile", text=f"KX{name}", decision="accept", confidence=0.9)


def _old_table(table: str, root: Path) -> None:
    with RunJournal(root / table, {"before": True}) as book:
        book.keep("before", ReadPart((_record("before"),)))
        export(book, ["before"])


def _table_work(table: str, root: Path, say: Say) -> None:
    def run() -> None:
        with RunJournal(root / table, RUN) as book:
            for name in reversed(NAMES):
                book.keep(name, ReadPart((_record(name),)))
                say(f"row {name}")
            export(book, NAMES)
        say("finished")

    tried(run)


def _table_check(table: str, root: Path, said: list[str], power: bool) -> None:
    path = root / table
    marker = path.with_name(f"{table}.unfinished")
    if "finished" in said:
        assert [row.part for row in read_rows(path)] == NAMES
    unfinished = marker.exists() and marker.stat().st_size > 0
    # its marker is the last to go, and nobody may have been told
    if unfinished or not path.exists() or _names_in(path) != NAMES:
        with RunJournal(path, RUN) as book:
            if not power and book.resumed:
                told = {word.split()[1] for word in said if word.startswith("row")}
                assert told <= set(book.done), f"lost {sorted(told - set(book.done))}"
            for name in reversed(NAMES):
                book.keep(name, ReadPart((_record(name),)))
            export(book, NAMES)
        assert not marker.exists()
    assert [row.part for row in read_rows(path)] == NAMES
    assert _names_in(path.with_name(f"{table}~")) == ["before"], "the table that stood there before is lost"


def _names_in(path: Path) -> list[str]:
    if path.name.endswith("~"):  # not a suffix that readers know
        path = Path(shutil.copyfile(path, path.with_name(f"kept-{path.name[:-1]}")))
    try:
        return [row.part for row in read_rows(path)]
    except FileError:
        return []


# ------------------------------------------------------------------------------------------ a run into a store


def _read(_: PartJob, listed: PartFiles) -> ReadPart:
    picture = Picture(
        EvidenceKind.EDGES_PICTURE, "crop.png", b"picture of " + listed.name.encode(), "image/png", {}
    )
    return ReadPart((_record(listed.name),), (picture,))


def _run_into_store(root: Path) -> None:
    os.chdir(root)
    options = RunOptions(out=_url(root), evidence=root / "evidence")
    with open_run(options, RUN) as run:
        parts = [PartFiles(name, height_map=f"{name}.npz") for name in NAMES]

        class NoReader(Executor):
            def calls(self, _function: Any, order: Any, tasks: Any) -> Any:
                return super().calls(_read, order, tasks)

        run.work(parts, PartJob(settings=ReadSettings()), NoReader())


def _run_work(root: Path, say: Say) -> None:
    if tried(lambda: _run_into_store(root)):
        say("finished")


def _run_check(root: Path, said: list[str], _: bool) -> None:
    # its marker is the last to go, and nobody may have been told
    finished = not list(root.glob("*.unfinished")) and len(_whole_parts(root)) == len(NAMES)
    if "finished" not in said and not finished:
        _run_into_store(root)
    assert [part.name for part in _whole_parts(root)] == NAMES


# ------------------------------------------------------------------------------------------- the watched folder


class _Parts:
    """What the folder submits to: evidence and store as the service's, without reading."""

    def __init__(self, root: Path) -> None:
        self.evidence, self.store = EvidenceFolder(root / "evidence"), Store.open(_url(root))

    def can_read(self, _job: str) -> bool:
        return True

    @contextlib.contextmanager
    def work_folder(self) -> Iterator[Path]:
        folder = self.evidence.new_work_folder()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    async def receive(
        self, new: NewPart, photos: Sequence[Upload], *, idempotency: IdempotencyKey, **_: object
    ) -> Received:
        try:
            digest, n_bytes = self.evidence.keep(photos[0].path)
            kept = (EvidenceRecord(EvidenceKind.PHOTO, digest, n_bytes, photos[0].name, "image/png"),)
            part = self._add(new, kept, idempotency)
        except FileError as error:
            raise StoreError(str(error)) from error
        return Received(part)

    def _add(self, new: NewPart, kept: tuple[EvidenceRecord, ...], idempotency: IdempotencyKey) -> PartRecord:
        try:
            return self.store.add_part(
                part_id=new_part_id(),
                name=new.name,
                state=PartState.ACCEPTED,
                readings=(reading(),),
                evidence=kept,
                idempotency=idempotency,
            )
        except AlreadyDoneError as done:
            return self.store.part(done.part_id)


def _photos_wait(root: Path) -> None:
    _empty_store(root)
    EvidenceFolder(root / "evidence")
    (root / "in").mkdir()
    for number in range(N):
        path = root / "in" / f"part {number}.png"
        Image.new("L", (16, 16), 20 * number).save(path)
        os.utime(path, (1_790_000_000 + number,) * 2)


def _watch(root: Path) -> None:
    """As a service does from its start to its end."""
    parts = _Parts(root)
    watched = WatchedFolder(
        WatchSettings(folder=root / "in"),
        parts,  # type: ignore[arg-type]
        most_bytes=10_000,
        at_once=1,
        unfinished_s=0.1,
    )

    async def look() -> None:
        for _ in range(4):
            await watched.look()
        await watched.stop(grace_s=0.0)

    try:
        asyncio.run(look())
    finally:
        parts.store.close()


def _watch_work(root: Path, _: Say) -> None:
    tried(lambda: _watch(root))


def _watch_check(root: Path, _said: list[str], _power: bool) -> None:
    for path in sorted((root / "in").iterdir()):  # a copy keeps no times
        os.utime(path, (1_790_000_000 + int(path.stem.split()[1]),) * 2)
    _watch(root)
    assert [part.name for part in _whole_parts(root)] == [f"part {k}" for k in range(N)]


# --------------------------------------------------------------------------------------- a journal of lines alone

_FILES = [f"/in/{k}.png" for k in range(6)]


class _Lines(Journal[str]):
    kind: ClassVar[str] = "work"
    keeps: ClassVar[Any] = str


def _journal_work(root: Path, say: Say) -> None:
    journal = opened_at_last(lambda: _Lines(root / "lines.db", {}))
    if journal is None:
        return
    with journal:
        for path in _FILES:
            # the service goes on where a line cannot be written
            with contextlib.suppress(FileError):
                journal.keep(path, path)
                say(path)


def _journal_check(root: Path, said: list[str], power: bool) -> None:
    kept = [path for path in _FILES if path in said]
    with _Lines(root / "lines.db", {}) as again:
        if not power:
            assert set(kept) <= set(again.done), "a line that was written is lost"
        for path in _FILES:
            again.keep(path, path)
    with _Lines(root / "lines.db", {}) as again:
        assert set(again.done) == set(_FILES)


# ---------------------------------------------------------------------------------- small things of the service

_BEFORE, _AFTER = {"format": "AA99", "height_mm": 4.0}, {"format": "AA999999", "height_mm": 5.0}
_OWN = ReadSettings(format=("A99",), font=("gothic",))


def _jobs_before(root: Path) -> None:
    JobFolder(root / "jobs", default=_OWN).save("left", _BEFORE)


def _jobs_work(root: Path, say: Say) -> None:
    from pipeline.service.web.problem import Problem

    jobs = JobFolder(root / "jobs", default=_OWN)
    for name, written in (("left", _AFTER), ("right", _AFTER)):
        if tried(lambda n=name, w=written: jobs.save(n, w), Problem):  # type: ignore[misc]
            say(name)


def _jobs_check(root: Path, said: list[str], _: bool) -> None:
    jobs = JobFolder(root / "jobs", default=_OWN)
    left, right = jobs.written("left"), jobs.written("right")
    assert left in ((_AFTER,) if "left" in said else (_BEFORE, _AFTER)), left
    assert right in ((_AFTER,) if "right" in said else (None, _AFTER)), right


def _tokens_before(root: Path) -> None:
    with _store(root) as store:
        (root / "old").write_text(store.add_token("old", [Scope.READ]))


def _tokens_work(root: Path, say: Say) -> None:
    store = opened_at_last(lambda: Store.open(_url(root)))
    if store is None:
        return
    names = iter(range(10))
    tried(lambda: say(f"new {store.add_token(f'new {next(names)}', [Scope.READ])}"))
    tried(lambda: (store.revoke("old"), say("revoked -")))
    store.close()


def _tokens_check(root: Path, said: list[str], _: bool) -> None:
    with _store(root) as store:
        _whole_store(root)
        told = dict(word.split() for word in said)
        if "new" in told:
            assert store.token(told["new"]) is not None, "a token that was given out is unknown"
        if "revoked" in told:
            assert store.token((root / "old").read_text()) is None, "a revoked token holds again"


def _store_made(root: Path, say: Say) -> None:
    if tried(lambda: _empty_store(root)):
        say("made")


def _store_check(root: Path, _said: list[str], _power: bool) -> None:
    with _store(root) as store:
        store.add_token("first", [Scope.READ])
    _whole_store(root)


SUBJECTS = {
    "evidence": Subject(_empty_store, _evidence_work, _evidence_check),
    **{
        name: Subject(*(partial(step, name) for step in (_old_table, _table_work, _table_check)))
        for name in ("rows.csv", "rows.jsonl", "rows.parquet")
    },
    "run into a store": Subject(_empty_store, _run_work, _run_check),
    "watched folder": Subject(_photos_wait, _watch_work, _watch_check),
    "journal of lines": Subject(lambda root: None, _journal_work, _journal_check),
    "jobs": Subject(_jobs_before, _jobs_work, _jobs_check),
    "tokens": Subject(_tokens_before, _tokens_work, _tokens_check),
    "new store": Subject(lambda root: None, _store_made, _store_check),
}
