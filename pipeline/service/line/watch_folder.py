"""A folder that is watched is a camera: every photograph that is put into it is read as a part, once.

    look --> new or changed --> next look --> unchanged: complete --> submitted --> written down
                                         \\-> changed: looked at again

* A file is known by its name, length and time: one that is written over is another photograph.
* It is complete when two looks, `every_s` apart, find the same length and time: one that is moved in, at its second.
* What was submitted stands in a journal, and in the store under an idempotency key: the first lasts for as long as the
  file lies there, the second fills the moment between the part's transaction and the journal's line.
* A file that cannot be used is named once, in the log, and left where it is. Nothing in the folder is ever changed.
* While the queue is full, files wait in the folder.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import stat
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import structlog

from glyphs.errors import FileError
from pipeline.common.atomic import replacing
from pipeline.common.line_journal import LineJournal
from pipeline.common.records import PartRecord
from pipeline.service.part_service import NewPart, PartService
from pipeline.service.problem import Problem
from pipeline.service.uploads import HEAD_BYTES, Upload, sent_name, suffix_of
from pipeline.store.store import IdempotencyKey, StoreError

if TYPE_CHECKING:
    from pipeline.service.settings import ServiceSettings

log = structlog.get_logger("tactile-marks")
BUSY = 503
REST = 5.0
"""Times that a look took, waited at least before the next: a folder of very many files is looked at less often."""
_SPARE = 1000
"""Entries of files that have left the folder, beyond as many as lie there, at which the journal is written anew."""


@dataclass(frozen=True)
class FileState:
    """How a file stands at a look."""

    n_bytes: int
    mtime_ns: int

    @classmethod
    def of(cls, status: os.stat_result) -> FileState:
        """Out of what the system says."""
        return cls(status.st_size, status.st_mtime_ns)


@dataclass(frozen=True)
class Handled:
    """What became of a file.

    Attributes:
        state: as it stood.
        part_id: of the part that it is; empty where it cannot be used.
        problem: why it cannot.
    """

    state: FileState
    part_id: str = ""
    problem: str = ""


class WatchJournal(LineJournal[Handled]):
    """What became of the files of a watched folder, by their paths."""

    kind: ClassVar[str] = "watched folder"
    version: ClassVar[int] = 1

    def encoded(self, kept: Handled) -> dict[str, Any]:
        """The entries of a file's line."""
        state = {"n_bytes": kept.state.n_bytes, "mtime_ns": kept.state.mtime_ns}
        return {**state, "part_id": kept.part_id, "problem": kept.problem}

    def decoded(self, line: Mapping[str, Any]) -> Handled:
        """The same, read."""
        state = FileState(int(line["n_bytes"]), int(line["mtime_ns"]))
        return Handled(state, str(line["part_id"]), str(line["problem"]))

    def keep_only(self, paths: Iterable[str]) -> None:
        """Forget all others.

        Raises:
            FileError: it cannot be written.
        """
        self.done = {path: self.done[path] for path in paths if path in self.done}
        kept, self.done = self.done, {}
        with replacing(self.path) as temporary:
            temporary.write_text(self._heading(), encoding="utf-8")
            fresh = type(self)(temporary, self.description)
            for path, one in kept.items():
                fresh.add(path, one)
        self.done = kept


def watch_journal(settings: ServiceSettings) -> WatchJournal | None:
    """The journal of the folder that the settings ask to watch; None where they ask for none.

    Raises:
        FileError: the folder is none, or the journal cannot be used.
    """
    if settings.watch is None:
        return None
    if not settings.watch.is_dir():
        raise FileError(settings.watch, "is no folder that can be watched", "name another with --watch")
    return WatchJournal.open(settings.watch_journal, {})


class WatchedFolder:
    """Watches a folder and submits its photographs, named by their stems."""

    def __init__(
        self,
        folder: Path,
        parts: PartService,
        *,
        journal: WatchJournal,
        job: str = "",
        every_s: float,
        most_bytes: int,
        at_once: int,
    ) -> None:
        """Take what it works with; nothing is looked at yet.

        Args:
            folder: to watch; folders in it are not looked into.
            parts: reads them.
            journal: what became of them so far.
            job: that the photographs are read by.
            every_s: between two looks.
            most_bytes: of a photograph.
            at_once: photographs that are read at a time.
        """
        self.folder = folder.absolute()
        self._parts, self._job, self._every_s, self._most_bytes = parts, job, every_s, most_bytes
        self._at_once = asyncio.Semaphore(at_once)
        self._journal = journal
        self._seen: dict[str, FileState] = {}
        self._gone, self._looked_s = False, 0.0
        self._stopping = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to look."""
        self._task = asyncio.create_task(self._watch())

    async def stop(self, *, grace_s: float) -> None:
        """Take no more files; those under way get `grace_s` to be read, else they are read after the next start."""
        self._stopping.set()
        if self._task is not None:
            done, _ = await asyncio.wait([self._task], timeout=grace_s)
            if not done:
                self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task

    async def look(self) -> None:
        """Look once, and submit what is complete."""
        complete = await asyncio.to_thread(self._complete)
        async with asyncio.TaskGroup() as group:
            for path, state in complete:
                group.create_task(self._take(path, state))

    async def _watch(self) -> None:
        while not self._stopping.is_set():
            began = time.monotonic()
            try:
                await self.look()
            except Exception:
                log.exception("look at the watched folder failed")
            rest_s = max(self._every_s, REST * self._looked_s) - (time.monotonic() - began)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), max(rest_s, 0.01))

    def _complete(self) -> list[tuple[Path, FileState]]:
        """Files that are new and stand as at the last look, the eldest first."""
        began = time.monotonic()
        now = self._files()
        self._looked_s = time.monotonic() - began
        if now is None:
            return []
        complete = []
        for path, state in now.items():
            known = self._journal.done.get(path)
            if self._seen.get(path) == state and state.n_bytes and (known is None or known.state != state):
                complete.append((Path(path), state))
        self._seen = now
        # an empty folder may be a drive that is away
        if now and len(self._journal.done) > 2 * len(now) + _SPARE:
            self._journal.keep_only(now)
        return sorted(complete, key=lambda one: (one[1].mtime_ns, one[0]))

    def _files(self) -> dict[str, FileState] | None:
        """The files that lie there; None where the folder is away.

        Hidden ones, which programs write before they rename them, do not count.
        """
        found = {}
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    with contextlib.suppress(FileNotFoundError):  # taken away meanwhile
                        if entry.name.startswith(".") or entry.is_dir(follow_symlinks=False):
                            continue
                        found[entry.path] = FileState.of(entry.stat(follow_symlinks=False))
        except OSError as error:
            if not self._gone:
                log.warning("watched folder cannot be looked at", folder=str(self.folder), why=error.strerror)
            self._gone = True
            return None
        if self._gone:
            log.info("watched folder is back", folder=str(self.folder))
        self._gone = False
        return found

    async def _take(self, path: Path, state: FileState) -> None:
        """Submit a file, and write down what became of it."""
        async with self._at_once:
            if self._stopping.is_set():
                return
            try:
                part = await self._submitted(path, state)
            except Problem as problem:
                if problem.status == BUSY:
                    return  # the next look finds it again
                log.warning("watched file left", file=path.name, why=problem.detail)
                handled = Handled(state, problem=problem.detail)
            except (OSError, StoreError) as error:
                log.warning("watched file waits", file=path.name, why=str(error))
                return
            else:
                if part is None:
                    return
                handled = Handled(state, part.id)
            try:
                await asyncio.to_thread(self._journal.add, str(path), handled)
            except FileError as error:
                log.error("watched file not written down", file=path.name, why=str(error))
                self._journal.done[str(path)] = handled

    async def _submitted(self, path: Path, state: FileState) -> PartRecord | None:
        """The part of a file; None where it was written to meanwhile.

        Raises:
            Problem: it cannot be used, or there is no room in the queue.
            OSError: it cannot be read.
        """
        name = sent_name(path.name)
        if state.n_bytes > self._most_bytes:
            raise Problem(
                413, f"{name} has {state.n_bytes:,} bytes; {self._most_bytes:,} may be (max_upload_mb)"
            )
        with self._parts.jobs.work_folder() as folder:
            copy = await asyncio.to_thread(_copied, path, state, folder)
            if copy is None:
                return None
            key = f"watch:{path}:{state.n_bytes}:{state.mtime_ns}"
            received = await self._parts.receive(
                NewPart(name=sent_name(path.stem), job=self._job, touch=True),
                photo=Upload(copy, name),
                idempotency=IdempotencyKey(key, key),
            )
        log.info("watched file read", file=path.name, part=received.part.id)
        return received.part


def _copied(path: Path, state: FileState, folder: Path) -> Path | None:
    """A copy under a name that says what it holds; None where the file is no longer as it was.

    Raises:
        Problem: no picture.
        OSError: it cannot be read.
    """
    # a pipe or device would be waited for, and a link may show what is none of the folder's
    if not stat.S_ISREG(path.stat(follow_symlinks=False).st_mode):
        raise Problem(415, f"{path.name} is no regular file")
    with path.open("rb") as source:
        copy = folder / f"watched{suffix_of('photo', sent_name(path.name), source.read(HEAD_BYTES))}"
        source.seek(0)
        with copy.open("xb") as target:
            shutil.copyfileobj(source, target)
        after = FileState.of(os.fstat(source.fileno()))
    return copy if after == state else None
