"""A watched folder as a camera: every photograph put into it is read once as a part.

    look --> new or changed --> next look --> unchanged: complete --> read, the oldest part first
                                         \\-> changed: looked at again

* A file is identified by its name, length and time: one that is overwritten is another photograph. One that is only
  moved to another subfolder is the same.
* It is complete when two looks, `LOOK_S` apart, find the same length and time. One whose end is missing has
  `unfinished_s` to be written to its end. Names of unfinished uploads are not looked at.
* Photographs of one part under several lights (part.light-1.png, part.light-2.png) are a set. It is complete when all
  its files are, and there are as many as expected, or, where none are expected, none was added or changed for
  `settle_s`. One that is added later makes it another set, which is read anew.
* In the transaction that writes a part, its files become idempotency keys, for as long as they are in the folder.
* A photograph that cannot be read, or that ends two workers, is a part for a person, and is not tried again until it
  changes. While the queue is full, or a file of the service cannot be used, files wait. Nothing in the folder changes.
* A part is felt at once only if its photograph has just come and is the latest: another one may lie under the whiskers
  by now. The others wait for a release.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import stat
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import structlog

from glyphs.errors import FileError
from glyphs.plain_text import visible
from pipeline.common.file_stamp import FileStamp, picture_key, stamp_of
from pipeline.common.private import open_no_link
from pipeline.common.records import EvidenceKind
from pipeline.errors import describe_fault
from pipeline.formats.kinds import (
    HEAD_BYTES,
    OF_SYSTEM,
    PHOTO_SUFFIXES,
    UNREAD_PICTURE_SUFFIXES,
    is_cut_short,
    is_system_folder,
    is_temporary,
    kind_of,
)
from pipeline.formats.part_files import set_of
from pipeline.formats.table_file import encoding_of
from pipeline.service.inputs.trigger import ANSWER_S
from pipeline.service.intake import Intake, NewPart, Touch
from pipeline.service.stage.work import TouchCall
from pipeline.service.tasks import end_tasks, repeat
from pipeline.service.web.problem import OwnProblem, Problem
from pipeline.service.web.uploads import MOST_NAME, Upload, check_count, sent_name, suffix_of
from pipeline.store.errors import StoreError, UnfitError
from pipeline.store.parts import IdempotencyKey

if TYPE_CHECKING:
    from pipeline.service.settings import WatchSettings

log = structlog.get_logger("tactile-marks")
LOOK_S = 1.0  # from one look to the next
# time without a change after which a set of any number is complete, s: lamps follow each other faster
SETTLE_S = 2.0
# time without a change after which a file whose end is missing, or a set with fewer than expected, is read as it is, s
UNFINISHED_S = 10.0
# least wait before the next look or attempt, in durations of the last one: neither may use the whole machine
PAUSE = 5.0
# least wait after a failed attempt
LEAST_PAUSE_S = 1.0
# time after which an unfinished upload, or a file that may not be opened, counts as left behind, s
LEFT_S = 60.0


@dataclass(frozen=True)
class WatchedPart:
    """The photographs of one part, by path."""

    name: str  # its subfolder and the file's stem, or the set's
    files: Mapping[str, FileStamp]
    moved: tuple[str, ...]  # keys of the same files, wherever they are moved to
    since_s: float  # time since which they stand unchanged, by the monotonic clock
    expected: str = ""

    @property
    def key(self) -> IdempotencyKey:
        key = IdempotencyKey.of_files(picture_key(path, state) for path, state in self.files.items())
        return replace(key, files=(*key.files, *self.moved))


class WatchedFolder:
    """Watch a folder and submit its photographs, named by their stems."""

    title = "watched folder"

    def __init__(
        self,
        settings: WatchSettings,
        intake: Intake,
        *,
        most_bytes: int,
        at_once: int,
        unfinished_s: float = UNFINISHED_S,
        settle_s: float = SETTLE_S,
    ) -> None:
        """Watch the folder of the settings, and read `at_once` parts at a time; one that is not complete within
        `unfinished_s` is read as it is. Raises FileError: no such folder."""
        if settings.folder is None or not settings.folder.is_dir():
            raise FileError(
                settings.folder or "watch.folder",
                "is not a folder that can be watched",
                "name another with --watch.folder",
            )
        self.folder = settings.folder.absolute()
        self._settings, self._intake, self._most_bytes = settings, intake, most_bytes
        self._at_once, self._unfinished_s, self._settle_s = at_once, unfinished_s, settle_s
        self._looking, self._stopping = asyncio.Lock(), False
        # why the folder cannot be looked at, without its path; empty while it can
        self.trouble = ""
        self._task: asyncio.Task[None] | None = None
        # files and sets as they stood at the last look, and since when
        self._last_look: dict[str, tuple[dict[str, FileStamp], float]] = {}
        # keys of files that are read, or cannot be used
        self._known_keys: set[str] = set()
        # keys of files that were there before the folder was watched; None until it is
        self._older: set[str] | None = None
        # keys of the files at the last look; None before, and while the folder cannot be looked at
        self._present: frozenset[str] | None = None
        # files and folders that are no photographs, as they stood, with the reason: named in the log once
        self._passed_over: dict[str, tuple[FileStamp, str]] = {}
        # attempts that came to nothing, by the part's key: why, and when the next one is due by the monotonic clock
        self._failures: dict[str, tuple[str, float]] = {}

    async def start(self) -> dict[str, object]:
        self._task = asyncio.create_task(repeat("look at the watched folder", self._round, every_s=LOOK_S))
        return {"folder": str(self.folder)}

    async def stop(self, *, grace_s: float) -> None:
        """Stop taking files; files in progress get `grace_s`, or are read after the next start."""
        self._stopping = True
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._looking.acquire(), grace_s)
        await end_tasks([] if self._task is None else [self._task])

    def renew_keys(self, *, before: datetime) -> bool:
        """Renew the store's keys of the folder's files that are from before a time; whether they are known."""
        if (present := self._present) is None:
            return False
        self._intake.store.renew_keys(present, before=before)
        return True

    async def look(self) -> float:
        limit = asyncio.Semaphore(self._at_once)

        async def take(part: WatchedPart) -> None:
            async with limit:
                await self._take(part, is_latest=part is complete[-1])

        async with self._looking:
            began_s = time.monotonic()
            complete = await asyncio.to_thread(self._complete)
            took_s = time.monotonic() - began_s
            keys = {part.key.key for part in complete}
            self._failures = {key: failure for key, failure in self._failures.items() if key in keys}
            await asyncio.gather(*map(take, complete))
        return took_s

    async def _round(self) -> None:
        await asyncio.sleep(PAUSE * await self.look())

    def _complete(self) -> list[WatchedPart]:
        began_s, groups = time.monotonic(), dict[str, dict[str, FileStamp]]()
        if (now := self._photographs()) is None:
            self._older = self._present = None
            return []
        for path, status in sorted(now.items()):
            # the files of a set stand under a name that no file can have
            several = os.path.join(os.path.dirname(path), set_of(path), "") if set_of(path) else path
            groups.setdefault(several, {})[path] = stamp_of(status)
        keys = {path: picture_key(path, stamp_of(status)) for path, status in now.items()}
        moved = {path: _moved_key(status) for path, status in now.items()}
        self._present = frozenset([*keys.values(), *moved.values()])
        self._known_keys &= self._present
        self._older = set(keys.values()) if self._older is None else self._older
        before, self._last_look, parts = self._last_look, {}, list[WatchedPart]()

        def is_new(files: Mapping[str, FileStamp]) -> bool:
            return not all(self._known_keys.intersection((keys[path], moved[path])) for path in files)

        for name, files in groups.items():
            stood, since_s = before.get(name, ({}, began_s))
            self._last_look[name] = files, since_s if stood == files else began_s
            if stood != files or not is_new(files) or began_s - since_s < self._wait_s(files, name in now):
                continue
            stem = Path(name).with_suffix("") if name in now else Path(name)
            part_name = "/".join(map(sent_name, stem.relative_to(self.folder).parts))[-MOST_NAME:]
            expected = _first_line(f"{stem}.txt") if self._settings.expected else ""
            parts.append(
                WatchedPart(part_name, files, tuple(map(moved.__getitem__, files)), since_s, expected)
            )
        self._known_keys |= self._intake.store.known_keys(key for part in parts for key in part.key.files)
        new = (part for part in parts if is_new(part.files))
        return sorted(new, key=lambda part: (min(ns for _, ns in part.files.values()), part.name))

    def _wait_s(self, files: Mapping[str, FileStamp], single: bool) -> float:
        expected = 1 if single else self._settings.photos
        if len(files) < expected or not _all_whole(files):
            return self._unfinished_s
        return 0.0 if expected else self._settle_s

    def _photographs(self) -> dict[str, os.stat_result] | None:
        files: dict[str, os.stat_result] = {}
        passed_over: dict[str, tuple[FileStamp, str]] = {}
        folders = [str(self.folder)]
        while folders:
            folder = folders.pop()
            try:
                with os.scandir(folder) as entries:
                    for entry in entries:
                        # removed meanwhile, or on a share that does not answer: checked again at the next look
                        with contextlib.suppress(OSError):
                            status = entry.stat(follow_symlinks=False)
                            if why := self._why_passed_over(entry, status):
                                passed_over[entry.path] = stamp_of(status), why
                            elif not is_temporary(entry.name) and not self._is_expected(entry.name):
                                if stat.S_ISDIR(status.st_mode):
                                    folders.append(entry.path)
                                else:
                                    files[entry.path] = status
            except OSError as error:
                why = f"cannot be looked at ({error.strerror})"
                if folder == str(self.folder):
                    if not self.trouble:
                        log.warning("watched folder cannot be looked at", folder=folder, why=error.strerror)
                    self.trouble = f"the watched folder {why}; see that it is there"
                    return None
                passed_over[folder] = (0, 0), why
        if self.trouble:
            log.info("watched folder is back", folder=str(self.folder))
        self.trouble = ""
        stems = {os.path.splitext(path) for path in files}
        readable = {stem for stem, suffix in stems if suffix.lower() in PHOTO_SUFFIXES}
        for stem, suffix in stems:
            if suffix.lower() in UNREAD_PICTURE_SUFFIXES and stem in readable:
                stamp = stamp_of(files.pop(path := f"{stem}{suffix}"))
                passed_over[path] = stamp, "stands beside a photograph of its name"
        for path in sorted(passed_over.keys() - self._passed_over.keys()):
            name = visible(os.path.relpath(path, self.folder))
            log.info("passed over in the watched folder", name=name, why=passed_over[path][1])
        self._passed_over = passed_over
        return files

    def _why_passed_over(self, entry: os.DirEntry[str], status: os.stat_result) -> str:
        suffix = os.path.splitext(entry.name)[1].lower()
        if is_temporary(entry.name):
            left = time.time() - status.st_mtime > LEFT_S
            return "has the name of an unfinished upload, or a hidden one" if left else ""
        if stat.S_ISDIR(status.st_mode):
            if is_system_folder(entry.name):
                return f"is a folder {OF_SYSTEM}"
            return ""
        if suffix in PHOTO_SUFFIXES or suffix in UNREAD_PICTURE_SUFFIXES or self._is_expected(entry.name):
            return ""
        stamp, why = self._passed_over.get(entry.path, (None, ""))
        if stamp == stamp_of(status):
            return why
        if stat.S_ISREG(status.st_mode):
            with open_no_link(Path(entry.path)) as source:
                if kind_of(source.read(HEAD_BYTES)) is not None:
                    return ""
        return "is no photograph"

    def _is_expected(self, name: str) -> bool:
        return self._settings.expected and name.lower().endswith(".txt")

    async def _take(self, part: WatchedPart, *, is_latest: bool) -> None:
        key, began_s = part.key, time.monotonic()
        _, due_s = self._failures.get(key.key, ("", 0.0))
        if self._stopping or began_s < due_s:
            return
        # a job whose file has changed is checked by a worker, for which `can_read` waits
        if not await asyncio.to_thread(self._intake.can_read, self._settings.job):
            return
        has_just_come = is_latest and not (self._older or set()).intersection(key.files)
        new = NewPart(
            part.name,
            expected=part.expected,
            job=self._settings.job,
            touch=Touch.STAGE if has_just_come else Touch.ASKED,
        )
        try:
            with self._intake.work_folder() as folder:
                photos, faults = await asyncio.to_thread(self._copies, part, folder)
                for name, why in faults.items():
                    log.warning("watched file left", file=visible(name), why=why)
                received = await self._intake.receive(
                    new,
                    photos,
                    idempotency=key,
                    call=TouchCall(part.since_s + ANSWER_S),
                    keep_unreadable=True,
                    unreadable="" if photos else "; ".join(faults.values()),
                )
                read = {"photos": len(photos), "part": received.part.id}
                log.info("watched file read", file=visible(part.name), **read)
        except Exception as error:
            if not self._is_final(part, error, began_s):
                return
        self._known_keys |= set(key.files)

    def _is_final(self, part: WatchedPart, error: Exception, began_s: float) -> bool:
        why, key = str(error), part.key.key
        if error.is_final if isinstance(error, Problem) else isinstance(error, UnfitError):
            log.warning("watched file left", file=visible(part.name), why=why)
            return True
        if not isinstance(error, (Problem, OSError, FileError, StoreError)):
            why = describe_fault(error)
            log.error("fault of the program for a watched file", file=visible(part.name), exc_info=error)
        now_s, (before, _) = time.monotonic(), self._failures.get(key, ("", 0.0))
        self._failures[key] = why, now_s + max(LEAST_PAUSE_S, PAUSE * (now_s - began_s))
        if before != why:
            log.warning("watched file waits", file=visible(part.name), why=why)
        return False

    def _copies(self, part: WatchedPart, folder: Path) -> tuple[list[Upload], dict[str, str]]:
        photos, faults = list[Upload](), dict[str, str]()
        with _noted_if_final(faults, part.name):
            check_count(len(part.files))
            for number, (path, state) in enumerate(part.files.items(), start=1):
                name = sent_name(os.path.basename(path))
                with _noted_if_final(faults, name):
                    copy = self._copy(Path(path), state, folder, number, since_s=part.since_s)
                    photos.append(Upload(copy, name, EvidenceKind.PHOTO))
        return photos, faults

    def _copy(self, path: Path, state: FileStamp, folder: Path, number: int, *, since_s: float) -> Path:
        name = sent_name(path.name)
        if state[0] > self._most_bytes:
            raise Problem(413, f"{name} has {state[0]:,} bytes; {self._most_bytes:,} may be")
        # reading a pipe or device could block, and a link may lead out of the folder
        if not stat.S_ISREG(path.stat(follow_symlinks=False).st_mode):
            raise Problem(415, f"{name} is not a regular file")
        if not state[0]:
            raise Problem(422, f"{name} is empty")
        try:
            opened = open_no_link(path)
        except PermissionError as error:
            if time.monotonic() - since_s < LEFT_S:  # the program that writes it may still lock it
                raise
            raise Problem(422, f"{name} may not be opened ({error.strerror})") from error
        with opened as source:
            copy = folder / f"watched-{number}{suffix_of('photo', name, source.read(HEAD_BYTES))}"
            source.seek(0)
            with copy.open("xb") as target:
                shutil.copyfileobj(source, target)
            if stamp_of(os.fstat(source.fileno())) != state:
                raise OwnProblem(f"{name} is still being written")
        return copy


@contextlib.contextmanager
def _noted_if_final(faults: dict[str, str], name: str) -> Iterator[None]:
    try:
        yield
    except Problem as problem:
        if not problem.is_final:
            raise
        faults[name] = problem.detail


def _all_whole(files: Iterable[str]) -> bool:
    try:
        return all(stat.S_ISREG(os.lstat(path).st_mode) and not is_cut_short(Path(path)) for path in files)
    except OSError:
        return False


def _first_line(file: str) -> str:
    try:
        with open_no_link(Path(file)) as source:
            head = source.read(4 * MOST_NAME)
            line = head.decode(encoding_of(head), "replace").partition("\n")[0]
    except OSError:
        return ""
    return "".join(char for char in line if char.isprintable()).strip()[:MOST_NAME]


def _moved_key(status: os.stat_result) -> str:
    """The key of a file that keeps its place on the disk when it is moved to another folder."""
    return f"moved {status.st_dev} {status.st_ino} {status.st_size} {status.st_mtime_ns}"
