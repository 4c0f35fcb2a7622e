"""Reading orders: a part's files go to a worker, and what comes of them into the evidence folder.

photos, scan   --> work folder --> worker: readings, pictures            --> evidence folder
stage, a pass after the other --> worker: readings, pictures, recording --> evidence folder
"""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from glyphs.errors import FaultError, FileError, OwnFileError
from pipeline.common.job_file import files_of
from pipeline.common.records import EvidenceKind, EvidenceRecord
from pipeline.common.serial_format import outside_format
from pipeline.reading.part_orders import Done, PartOrder, check_settings, read_on_stage, read_order
from pipeline.reading.warm_up import warm_up
from pipeline.service.web.problem import OwnProblem, Problem, no_room
from pipeline.service.web.uploads import Upload
from pipeline.workers.executors import WorkerLostError
from pipeline.workers.pool import BusyError

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.formats.touch_file import Limits
    from pipeline.service.metrics import Metrics
    from pipeline.service.stage.devices import ScanOrder
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.workers.pool import WorkPool
    from whisker_array.scan.session import SessionStage

T = TypeVar("T")
log = structlog.get_logger("tactile-marks")
MOST_LOST = 2
"""Workers lost in a row, from which on the service doubts itself and not the parts, until it has read a clean one."""


class ReadingOrders:
    """Has files read by the pool's workers, and keeps them with what was made of them.

    * A work folder lasts as long as its request; what is to be kept is moved out of it.
    * Every file of a returned record is on the disk.
    * A job or database that turns out to be of no use is remembered until `recheck` finds that it is again.
    """

    def __init__(
        self,
        *,
        evidence: EvidenceFolder,
        pool: WorkPool,
        databases: Callable[[str], Path | None],
        settings: Callable[[str], ReadSettings],
        limits: Limits,
        metrics: Metrics,
    ) -> None:
        """Take what it works with.

        Args:
            evidence: where files are kept.
            pool: where parts are read.
            databases: file of the glyph database of a name; raises Problem for one that is not there.
            settings: how parts of a job are read, by its name; raises Problem for one that is not there.
            limits: of files.
            metrics: what is counted.
        """
        self._evidence, self._pool, self._databases = evidence, pool, databases
        self._settings, self._limits, self._metrics = settings, limits, metrics
        self._troubles: dict[tuple[str, str], str] = {}
        self._lost: list[str] = []

    def trouble(self, job_name: str) -> str:
        """What keeps the parts of a job from being read now, without paths; empty where nothing is known to."""
        if known := self._troubles.get((job_name, "")):
            return known
        if len(self._lost) >= MOST_LOST:
            return f"the last {len(self._lost)} workers were lost, the latest so: {self._lost[-1]}"
        try:
            missing = [path.name for path in files_of(self._settings(job_name)) if not path.is_file()]
        except Problem as problem:
            return problem.detail
        return f"{missing[0]} is not there; put it back" if missing else ""

    @property
    def troubles(self) -> dict[str, str]:
        """What is wrong with jobs and databases that callers have named, in words, by name."""
        return {job or database: why for (job, database), why in self._troubles.items() if job or database}

    async def recheck(self) -> None:
        """Look again at what was of no use; where workers were lost, read a clean part of the program's own."""
        if len(self._lost) >= MOST_LOST:
            with contextlib.suppress(Problem, WorkerLostError):
                await self._in_one_worker(warm_up, self._settings(""), self._limits)
                log.info("a clean part is read again: the parts that have lost the workers are to blame")
        for job_name, database in tuple(self._troubles):
            with contextlib.suppress(Problem, WorkerLostError):
                async with self._noted(job_name, database):
                    settings = await asyncio.to_thread(self._settings, job_name)
                    if (glyphs := self._databases(database)) is not None:
                        settings = settings.model_copy(update={"database": glyphs})
                    await self._in_one_worker(check_settings, settings)

    @contextlib.asynccontextmanager
    async def _noted(self, job_name: str, database: str) -> AsyncIterator[None]:
        """Remember what is wrong with a job or a database, for as long as something is."""
        key = (job_name, database)
        try:
            yield
        except OwnProblem as problem:
            if self._troubles.get(key) != problem.detail:
                log.error("parts cannot be read", job=job_name, database=database, why=problem.detail)
            self._troubles[key] = problem.detail
            raise
        if self._troubles.pop(key, None) is not None:
            log.info("parts can be read again", job=job_name, database=database)

    def outside_format(self, text: str, job_name: str) -> str:
        """What speaks against a text as a serial of a job's format; empty where nothing does, or the job is gone."""
        try:
            return outside_format(text, self._settings(job_name))
        except (Problem, FileError):
            return ""

    @property
    def busy(self) -> float | None:
        """Seconds after which to ask again, while no more parts are taken in; None while they are."""
        return self._pool.retry_after_s()

    async def read(
        self,
        photos: Sequence[Upload],
        scan: Upload | None,
        *,
        name: str,
        expected: str,
        database: str,
        job_name: str = "",
        earlier_photos: tuple[Path, ...] = (),
    ) -> tuple[Done, list[EvidenceRecord]]:
        """Read the files in a worker; keep them and what was made of them.

        Args:
            photos: as they were sent.
            scan: recording or height map.
            name: what the line calls the part.
            expected: text that it should read.
            database: name of the glyph database.
            job_name: of the job that says how to read.
            earlier_photos: the photographs from before.

        Raises:
            Problem: files that cannot be used, no room in the queue, a worker that was lost, a full disk.
            OwnProblem: a file of the service's own that cannot be used.
        """
        raw = [*((EvidenceKind.PHOTO, photo) for photo in photos)]
        if scan is not None:
            raw.append((scan.touch_kind(), scan))
        felt = {kind: upload.path for kind, upload in raw}
        with self.work_folder() as folder:
            async with self._noted(job_name, database):
                settings = await asyncio.to_thread(self._settings, job_name)
                part = PartOrder(
                    folder=folder,
                    photos=tuple(photo.path for photo in photos),
                    scan=felt.get(EvidenceKind.SCAN),
                    height_map=felt.get(EvidenceKind.HEIGHT_MAP),
                    earlier_photos=earlier_photos,
                    part_name=name,
                    expected=expected,
                    database=self._databases(database),
                    names={upload.path: upload.name for _, upload in raw},
                )
                done = await self.in_worker(read_order, part, settings, self._limits)
            return done, await self._kept(raw, done)

    async def feel(
        self,
        stage: SessionStage[ScanOrder],
        order: ScanOrder,
        *,
        expected: str,
        database: str,
        job_name: str,
        earlier_photos: tuple[Path, ...],
    ) -> tuple[Done, list[EvidenceRecord]]:
        """Have a worker feel a part pass by pass and read it; keep the recording and what was made of it.

        Args:
            stage: opens a session in the worker.
            order: the part, and where to feel it.
            expected: text that it should read.
            database: name of the glyph database.
            job_name: of the job that says how to read, and for how many stage seconds at most.
            earlier_photos: the photographs from before.

        Raises:
            StageError: nothing could be felt.
            Problem: as `read`.
        """
        with self.work_folder() as folder:
            async with self._noted(job_name, database):
                settings = await asyncio.to_thread(self._settings, job_name)
                part = PartOrder(
                    folder=folder,
                    earlier_photos=earlier_photos,
                    part_name=order.part_name,
                    expected=expected,
                    database=self._databases(database),
                )
                read = partial(read_on_stage, budget_s=settings.budget_s)
                # what a stage has felt is felt once
                done = await self.in_worker(read, part, settings, self._limits, stage, order, tries=1)
            return done, await self._kept([], done)

    async def _kept(self, raw: Sequence[tuple[EvidenceKind, Upload]], done: Done) -> list[EvidenceRecord]:
        try:
            return await asyncio.to_thread(self._keep, raw, done)
        except FileError as problem:
            raise no_room(problem) from problem

    def _keep(self, raw: Sequence[tuple[EvidenceKind, Upload]], done: Done) -> list[EvidenceRecord]:
        kept = []
        for kind, upload in raw:
            sha256, n_bytes = self._evidence.keep(upload.path)
            kept.append(
                EvidenceRecord(kind, sha256, n_bytes, name=upload.name, media_type=upload.media_type(kind))
            )
        for made in done.made:
            sha256, n_bytes = self._evidence.keep(made.path)
            kept.append(
                EvidenceRecord(
                    made.kind, sha256, n_bytes, name=made.name, media_type=made.media_type, meta=made.meta
                )
            )
        return kept

    async def in_worker(self, function: Callable[..., T], *arguments: Any, tries: int = 2) -> T:
        """What a function returns that a worker calls; where the worker is lost, another one is asked.

        Raises:
            Problem: no room in the queue, files that cannot be used, workers that were lost.
        """
        lost = 0
        while True:
            try:
                return await self._in_one_worker(function, *arguments)
            except WorkerLostError as error:
                lost += 1
                if lost == tries or error.timed_out or error.unstarted:
                    raise _lost_problem(error, lost) from error

    async def _in_one_worker(self, function: Callable[..., T], *arguments: Any) -> T:
        try:
            done: T = await asyncio.wrap_future(self._pool.submit(function, *arguments))
            self._lost.clear()
            return done
        except BusyError as error:
            self._metrics.refused.inc()
            raise busy_problem(error) from error
        except OwnFileError as problem:
            self._lost.clear()
            raise OwnProblem(str(problem)) from problem
        except FileError as problem:
            self._lost.clear()
            status = 500 if isinstance(problem, FaultError) else 422
            raise Problem(status, str(problem)) from problem
        except WorkerLostError as error:
            self._metrics.lost_workers.inc()
            self._lost = [*self._lost[-99:], str(error)]
            log.warning("worker lost", why=str(error))
            raise

    @contextlib.contextmanager
    def work_folder(self) -> Iterator[Path]:
        """A folder for the length of a request."""
        folder = self._evidence.new_work_folder()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def called_by(pool: WorkPool, function: Callable[..., T], *arguments: Any, timeout_s: float) -> T:
    """What a function returns that a worker calls; this thread waits for it.

    Raises:
        Problem: no room in the queue, a worker that was lost.
        MarksError: as the function does.
    """
    try:
        found: T = pool.submit(function, *arguments, timeout_s=timeout_s).result()
    except BusyError as error:
        raise busy_problem(error) from error
    except WorkerLostError as error:
        log.warning("worker lost", why=str(error))
        if error.timed_out:
            raise Problem(422, f"it takes longer than {timeout_s:g} s to check; make it simpler") from error
        if error.crashed:
            raise Problem(422, f"the worker that checked it was lost: {error}") from error
        raise Problem(503, f"{error}; send it again", headers={"Retry-After": "5"}) from error
    return found


def busy_problem(error: BusyError) -> Problem:
    """The answer while as many parts wait as may."""
    return Problem(503, str(error), headers={"Retry-After": str(max(1, round(error.retry_after_s)))})


def _lost_problem(error: WorkerLostError, lost: int) -> Problem:
    """The answer where workers were lost over a part; no verdict, for a limit or this program may be to blame."""
    later = {"Retry-After": "60"}
    if error.timed_out:
        return Problem(503, f"{error}; send it again later, or a smaller file", headers=later)
    if error.crashed and lost > 1:
        detail = f"it has ended {lost} workers, the last so: {error}; if it happens again, report it"
        return Problem(503, detail, headers=later)
    return Problem(503, f"{error}; send it again", headers={"Retry-After": "5"})
