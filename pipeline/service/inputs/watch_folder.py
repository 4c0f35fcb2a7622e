"""A folder that is watched is a camera: every photograph that is put into it is read as a part, once.

    look --> new or changed --> next look --> unchanged: complete --> submitted --> journal     (`resumable`)
                                         \\-> changed: looked at again

* A file is known by its name, length and time: one that is written over is another photograph.
* It is complete when two looks, `every_s` apart, find the same length and time: one that is moved in, at its second.
* What was submitted stands in a journal, and in the store under an idempotency key: the first lasts for as long as the
  file lies there, the second fills the moment between the part's transaction and the journal's line.
* A file that cannot be used is named once, in the log, and left where it is; of a set, the others are read. Nothing in
  the folder is ever changed.
* Only what is wrong with the file itself is final. While the queue is full, or something of the service's own is of no
  use, files wait in the folder. One over which workers or the program fail is named, and tried again after a rest.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import os
import shutil
import stat
import time
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import structlog

from glyphs.errors import FileError
from glyphs.plain_text import visible
from pipeline.common.records import EvidenceKind
from pipeline.errors import describe_fault
from pipeline.formats.kinds import HEAD_BYTES
from pipeline.runs.journal import resumable
from pipeline.service.inputs.watched_files import FileState, FolderLooks, Handled, WatchedPart, WatchJournal
from pipeline.service.intake import Intake
from pipeline.service.new_part import NewPart, Touch
from pipeline.service.recent_files import NO_TEXT, is_text
from pipeline.service.web.idempotency import Received
from pipeline.service.web.problem import OwnProblem, Problem
from pipeline.service.web.uploads import Upload, check_count, sent_name, suffix_of
from pipeline.store.errors import StoreError, UnfitError
from pipeline.store.parts import IdempotencyKey
from pipeline.workers.executors import ThreadExecutor

if TYPE_CHECKING:
    from pipeline.service.settings import WatchSettings

log = structlog.get_logger("tactile-marks")
REST = 5.0
"""Times that a look or an attempt took, waited at least before the next, so that neither takes all of the machine."""
LEAST_REST_S = 1.0
"""Least rest after an attempt that came to nothing."""


def open_no_link(path: Path) -> BinaryIO:
    """Open a file that may have become a link or a pipe since it was looked at; neither is followed or waited for."""
    flags = (getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
    return os.fdopen(os.open(path, sum(flags, os.O_RDONLY)), "rb")


class WatchedFolder:
    """Watches a folder and submits its photographs, named by their stems."""

    title = "watched folder"

    def __init__(
        self, settings: WatchSettings, intake: Intake, *, journal: Path, most_bytes: int, at_once: int
    ) -> None:
        """Open the journal; nothing is looked at yet.

        Args:
            settings: folder to watch; folders in it are not looked into.
            intake: reads the parts.
            journal: file that says what became of the photographs so far.
            most_bytes: of a photograph.
            at_once: photographs that are read at a time.

        Raises:
            FileError: no such folder, or an unusable journal.
        """
        if settings.folder is None or not settings.folder.is_dir():
            raise FileError(
                settings.folder or "watch.folder",
                "is no folder that can be watched",
                "name another with --watch.folder",
            )
        self.folder = settings.folder.absolute()
        self._settings, self._intake, self._most_bytes = settings, intake, most_bytes
        self._at_once = at_once
        self.journal = WatchJournal(journal, {})
        self._looks = FolderLooks(
            self.folder, self.journal, a_set=settings.photos, settle_s=settings.settle_s
        )
        self._stopping = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._began_s: dict[str, float] = {}
        # attempts that came to nothing: why, and when the next one is due by the monotonic clock
        self._failures: dict[str, tuple[str, float]] = {}
        self._receiving: set[Future[Received]] = set()

    async def start(self) -> dict[str, object]:
        """Begin to look; returns where, and how often."""
        self._task = asyncio.create_task(self._watch())
        return {"folder": str(self.folder), "every_s": self._settings.every_s}

    async def stop(self, *, grace_s: float) -> None:
        """Stop taking files; files in work get `grace_s`, then they are read after the next start."""
        self._stopping.set()
        if (task := self._task) is not None:
            await asyncio.wait([task], timeout=grace_s)
            for future in tuple(self._receiving):
                future.cancel()
            await task
        self.journal.close()

    async def look(self) -> None:
        """Look once, and submit what is complete."""
        await asyncio.to_thread(self._look, asyncio.get_running_loop())

    async def _watch(self) -> None:
        while not self._stopping.is_set():
            began = time.monotonic()
            try:
                await self.look()
            except Exception:
                log.exception("look at the watched folder failed")
            rest_s = max(self._settings.every_s, REST * self._looks.took_s) - (time.monotonic() - began)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), max(rest_s, 0.01))

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        complete, self._began_s = self._looks.complete(), {}
        self._failures = {p.key: kept for p in complete if (kept := self._failures.get(p.key)) is not None}
        with ThreadExecutor(self._at_once) as threads:
            for part, _ in resumable(
                self.journal, complete, threads, self._take, loop, lost=self._failed, name="key"
            ):
                self._failures.pop(part.key, None)

    def _failed(self, part: WatchedPart, error: Exception) -> Handled | None:
        """Give a part up if its files are what is wrong; else leave it for a later attempt."""
        if isinstance(error, CancelledError):  # the service stops
            return None
        if error.is_final if isinstance(error, Problem) else isinstance(error, UnfitError):
            log.warning("watched file left", file=visible(part.name), why=str(error))
            return Handled(part.files, problem=str(error))
        why = str(error)
        if not isinstance(error, (Problem, OSError, FileError, StoreError)):
            why = describe_fault(error)
            log.error("fault of the program over a watched file", file=visible(part.name), exc_info=error)
        now_s, (before, _) = time.monotonic(), self._failures.get(part.key, ("", 0.0))
        rest_s = max(LEAST_REST_S, REST * (now_s - self._began_s[part.key]))
        self._failures[part.key] = why, now_s + rest_s
        if before != why:
            log.warning("watched file waits", file=visible(part.name), why=why)
        return None

    def _take(self, loop: asyncio.AbstractEventLoop, part: WatchedPart) -> Handled | None:
        """Submit the files of a part; None if the part waits for a later look.

        Raises:
            Problem: the files cannot be used together, one was written to meanwhile, or the queue is full.
            OSError: a file cannot be read.
            StoreError: the store does not take the part.
        """
        self._began_s[part.key] = began_s = time.monotonic()
        _, due_s = self._failures.get(part.key, ("", 0.0))
        # a job whose file has changed is checked by a worker, for which `can_read` waits
        if self._stopping.is_set() or began_s < due_s or not self._intake.can_read(self._settings.job):
            return None
        check_count(len(part.files))
        photos, problems, part_id = [], [], ""
        with self._intake.work_folder() as folder:
            for number, (path, state) in enumerate(part.files.items(), start=1):
                file = Path(path)
                try:
                    copy = self._copy(file, state, folder, number)
                except Problem as problem:
                    if not problem.is_final:
                        raise
                    log.warning("watched file left", file=visible(file.name), why=problem.detail)
                    problems.append(problem.detail)
                else:
                    photos.append(Upload(copy, sent_name(file.name), EvidenceKind.PHOTO))
            if photos:
                new = NewPart(name=sent_name(part.name), job=self._settings.job, touch=Touch.STAGE)
                digest = hashlib.sha256(os.fsencode(part.key)).hexdigest()
                key = IdempotencyKey(f"watch:{digest}", digest)
                received = self._intake.receive(new, photos, idempotency=key)
                future = asyncio.run_coroutine_threadsafe(received, loop)
                self._receiving.add(future)
                future.add_done_callback(self._receiving.discard)
                part_id = future.result().part.id
                log.info("watched file read", file=visible(part.name), photos=len(photos), part=part_id)
        return Handled(part.files, part_id, "\n".join(problems))

    def _copy(self, path: Path, state: FileState, folder: Path, number: int) -> Path:
        """A copy under a name that says what it holds.

        Raises:
            Problem: no picture, or too large a one.
            OwnProblem: the file is no longer as it was.
            OSError: it cannot be read.
        """
        if not is_text(path.name):
            raise Problem(415, f"{visible(path.name)}: {NO_TEXT}")
        name = sent_name(path.name)
        if state.n_bytes > self._most_bytes:
            raise Problem(
                413, f"{name} has {state.n_bytes:,} bytes; {self._most_bytes:,} may be (limits.upload_mb)"
            )
        # reading a pipe or device could block, and a link may lead out of the folder
        if not stat.S_ISREG(path.stat(follow_symlinks=False).st_mode):
            raise Problem(415, f"{name} is no regular file")
        with open_no_link(path) as source:
            copy = folder / f"watched-{number}{suffix_of('photo', name, source.read(HEAD_BYTES))}"
            source.seek(0)
            with copy.open("xb") as target:
                shutil.copyfileobj(source, target)
            if FileState.of(os.fstat(source.fileno())) != state:
                raise OwnProblem(f"{name} is still being written")
        return copy
