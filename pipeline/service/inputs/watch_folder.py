"""A watched folder as a camera: every photograph put into it is read once as a part.

    look --> new or changed --> next look --> unchanged: complete --> read, the oldest part first
                                         \\-> changed: looked at again

* A file is identified by its name, length and time: one that is overwritten is another photograph.
* It is complete when two looks, `every_s` apart, find the same length and time: one that is moved in, at its second.
* Photographs of one part under several lights (part.light-1.png, part.light-2.png) are a set. A set is complete when
  all its files are, and there are as many as expected, or none was added or changed for a while. One that is added
  later makes it another set, which is read anew.
* The store remembers what was read: in the transaction that writes a part, its files become idempotency keys, for ever.
* A file that cannot be used is named in the log, and left until it changes or the service starts again; of a set, the
  others are read. Nothing in the folder is ever changed.
* Only a fault of the file itself is final. While the queue is full, or a job or file of the service cannot be used,
  files wait in the folder. One that makes workers or the program fail is named, and tried again after a rest.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import stat
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import structlog

from glyphs.errors import FileError
from glyphs.plain_text import visible
from pipeline.common.private import open_no_link
from pipeline.common.records import EvidenceKind
from pipeline.errors import describe_fault
from pipeline.formats.kinds import HEAD_BYTES
from pipeline.formats.part_files import set_of
from pipeline.service.intake import Intake, NewPart, Touch
from pipeline.service.jobs import NO_TEXT, FileStamp, is_text, stamp_of
from pipeline.service.tasks import end_tasks, repeat
from pipeline.service.web.problem import OwnProblem, Problem
from pipeline.service.web.uploads import Upload, check_count, sent_name, suffix_of
from pipeline.store.errors import StoreError, UnfitError
from pipeline.store.parts import IdempotencyKey

if TYPE_CHECKING:
    from pipeline.service.settings import WatchSettings

log = structlog.get_logger("tactile-marks")
REST = 5.0
"""Least wait before the next look or attempt, in durations of the last one, so that neither uses the whole machine."""
LEAST_REST_S = 1.0
"""Least wait after a failed attempt."""


@dataclass(frozen=True)
class WatchedPart:
    """The photographs of one part.

    Attributes:
        name: name of the part: the file's stem, or the set's.
        files: size and time of each file, by path.
    """

    name: str
    files: Mapping[str, FileStamp]

    @property
    def key(self) -> IdempotencyKey:
        """The key of the part, with those of its present files."""
        return IdempotencyKey.of_files(_key(path, state) for path, state in self.files.items())


class WatchedFolder:
    """Watch a folder and submit its photographs, named by their stems."""

    title = "watched folder"

    def __init__(self, settings: WatchSettings, intake: Intake, *, most_bytes: int, at_once: int) -> None:
        """Set the folder; nothing is read yet.

        Args:
            settings: folder to watch; folders in it are not looked into.
            intake: reads the parts.
            most_bytes: greatest size of a photograph.
            at_once: parts that are read at a time.

        Raises:
            FileError: no such folder.
        """
        if settings.folder is None or not settings.folder.is_dir():
            raise FileError(
                settings.folder or "watch.folder",
                "is not a folder that can be watched",
                "name another with --watch.folder",
            )
        self.folder = settings.folder.absolute()
        self._settings, self._intake, self._most_bytes = settings, intake, most_bytes
        self._at_once = at_once
        self._looking, self._stopping, self._away = asyncio.Lock(), False, False
        self._task: asyncio.Task[None] | None = None
        # each file or set as it stood at the last look, and since when it has stood so
        self._seen: dict[str, tuple[dict[str, FileStamp], float]] = {}
        # keys of files that are read, or cannot be used
        self._known: set[str] = set()
        # attempts that came to nothing, by the part's key: why, and when the next one is due by the monotonic clock
        self._failures: dict[str, tuple[str, float]] = {}

    async def start(self) -> dict[str, object]:
        """Start to watch; return the folder and the interval."""
        every_s = self._settings.every_s
        self._task = asyncio.create_task(repeat("look at the watched folder", self._round, every_s=every_s))
        return {"folder": str(self.folder), "every_s": every_s}

    async def stop(self, *, grace_s: float) -> None:
        """Stop taking files; files in progress get `grace_s`, or are read after the next start."""
        self._stopping = True
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._looking.acquire(), grace_s)
        await end_tasks([] if self._task is None else [self._task])

    async def look(self) -> float:
        """Look once, and submit what is complete.

        Returns:
            Seconds that the look itself took.

        Raises:
            StoreError: the store does not answer.
        """
        limit = asyncio.Semaphore(self._at_once)

        async def take(part: WatchedPart) -> None:
            async with limit:
                await self._take(part)

        async with self._looking:
            began_s = time.monotonic()
            complete = await asyncio.to_thread(self._complete)
            took_s = time.monotonic() - began_s
            keys = {part.key.key for part in complete}
            self._failures = {key: failure for key, failure in self._failures.items() if key in keys}
            await asyncio.gather(*map(take, complete))
        return took_s

    async def _round(self) -> None:
        await asyncio.sleep(REST * await self.look())

    def _complete(self) -> list[WatchedPart]:
        """Parts whose files are new and unchanged since the last look, the oldest first."""
        began_s, groups = time.monotonic(), dict[str, dict[str, FileStamp]]()
        if (now := self._files()) is None:
            return []
        for path, state in sorted(now.items()):
            groups.setdefault(set_of(path) or path, {})[path] = state
        keys = {path: _key(path, state) for path, state in now.items()}
        self._known.intersection_update(keys.values())
        before, self._seen, found = self._seen, {}, list[WatchedPart]()
        for name, files in groups.items():
            stood, since_s = before.get(name, ({}, began_s))
            self._seen[name] = files, since_s if stood == files else began_s
            settled = began_s - since_s >= self._settings.settle_s
            # a file that is empty may be about to be written
            still = stood == files and (settled or all(n_bytes for n_bytes, _ in files.values()))
            whole = len(files) == self._settings.photos or settled
            known = self._known.issuperset(keys[path] for path in files)
            if still and (name in now or whole) and not known:
                found.append(WatchedPart(Path(name).stem if name in now else name, files))
        self._known |= self._intake.store.known_keys(key for part in found for key in part.key.files)
        new = (part for part in found if not self._known.issuperset(part.key.files))
        return sorted(new, key=lambda one: (min(ns for _, ns in one.files.values()), one.name))

    def _files(self) -> dict[str, FileStamp] | None:
        """The files in the folder; None if the folder is missing.

        Hidden ones, which programs write before they rename them, do not count.
        """
        found = {}
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    # removed meanwhile, or on a share that does not answer: checked again at the next look
                    with contextlib.suppress(OSError):
                        if not entry.name.startswith(".") and not entry.is_dir(follow_symlinks=False):
                            found[entry.path] = stamp_of(entry.stat(follow_symlinks=False))
        except OSError as error:
            if not self._away:
                log.warning("watched folder cannot be looked at", folder=str(self.folder), why=error.strerror)
            self._away = True
            return None
        if self._away:
            log.info("watched folder is back", folder=str(self.folder))
        self._away = False
        return found

    async def _take(self, part: WatchedPart) -> None:
        """Submit the files of a part, unless it has to wait for a later look."""
        key, began_s = part.key, time.monotonic()
        _, due_s = self._failures.get(key.key, ("", 0.0))
        if self._stopping or began_s < due_s:
            return
        # a job whose file has changed is checked by a worker, for which `can_read` waits
        if not await asyncio.to_thread(self._intake.can_read, self._settings.job):
            return
        try:
            with self._intake.work_folder() as folder:
                photos = await asyncio.to_thread(self._copies, part, folder)
                if photos:
                    new = NewPart(sent_name(part.name), job=self._settings.job, touch=Touch.STAGE)
                    received = await self._intake.receive(new, photos, idempotency=key)
                    read = {"photos": len(photos), "part": received.part.id}
                    log.info("watched file read", file=visible(part.name), **read)
        except Exception as error:
            if not self._is_final(part, error, began_s):
                return
        self._known |= set(key.files)

    def _is_final(self, part: WatchedPart, error: Exception, began_s: float) -> bool:
        """Give up a part if its files are wrong; otherwise leave it for a later attempt."""
        why, key = str(error), part.key.key
        if error.is_final if isinstance(error, Problem) else isinstance(error, UnfitError):
            log.warning("watched file left", file=visible(part.name), why=why)
            return True
        if not isinstance(error, (Problem, OSError, FileError, StoreError)):
            why = describe_fault(error)
            log.error("fault of the program for a watched file", file=visible(part.name), exc_info=error)
        now_s, (before, _) = time.monotonic(), self._failures.get(key, ("", 0.0))
        self._failures[key] = why, now_s + max(LEAST_REST_S, REST * (now_s - began_s))
        if before != why:
            log.warning("watched file waits", file=visible(part.name), why=why)
        return False

    def _copies(self, part: WatchedPart, folder: Path) -> list[Upload]:
        """Copy a part's photographs; name unusable ones in the log and leave them out.

        Raises:
            Problem: there are too many, or one was written to meanwhile.
            OSError: a file cannot be read.
        """
        check_count(len(part.files))
        photos = []
        for number, (path, state) in enumerate(part.files.items(), start=1):
            file = Path(path)
            try:
                copy = self._copy(file, state, folder, number)
            except Problem as problem:
                if not problem.is_final:
                    raise
                log.warning("watched file left", file=visible(file.name), why=problem.detail)
            else:
                photos.append(Upload(copy, sent_name(file.name), EvidenceKind.PHOTO))
        return photos

    def _copy(self, path: Path, state: FileStamp, folder: Path, number: int) -> Path:
        """Copy a file under a name with the suffix of its content.

        Raises:
            Problem: no picture, or too large a one.
            OwnProblem: the file is no longer as it was.
            OSError: it cannot be read.
        """
        if not is_text(path.name):
            raise Problem(415, f"{visible(path.name)}: {NO_TEXT}")
        name = sent_name(path.name)
        if state[0] > self._most_bytes:
            raise Problem(
                413, f"{name} has {state[0]:,} bytes; {self._most_bytes:,} may be (limits.upload_mb)"
            )
        # reading a pipe or device could block, and a link may lead out of the folder
        if not stat.S_ISREG(path.stat(follow_symlinks=False).st_mode):
            raise Problem(415, f"{name} is not a regular file")
        if not state[0]:
            raise Problem(422, f"{name} is empty")
        with open_no_link(path) as source:
            copy = folder / f"watched-{number}{suffix_of('photo', name, source.read(HEAD_BYTES))}"
            source.seek(0)
            with copy.open("xb") as target:
                shutil.copyfileobj(source, target)
            if stamp_of(os.fstat(source.fileno())) != state:
                raise OwnProblem(f"{name} is still being written")
        return copy


def _key(path: str, state: FileStamp) -> str:
    return f"watch {state[0]} {state[1]} {path}"
