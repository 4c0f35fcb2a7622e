"""Calls of worker processes: refused while the queue is full, repeated if a worker is lost. An unusable job or glyph
database is remembered until `recheck` finds it usable again."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from glyphs.errors import FileError
from pipeline.common.file_stamp import stamp_if_there
from pipeline.common.job_file import files_of
from pipeline.common.serial_format import outside_format
from pipeline.errors import FaultError, OwnFileError
from pipeline.reading.part_job import PartJob, check_settings, read_on_stage, read_sent
from pipeline.reading.sender_names import EXPECTED
from pipeline.reading.triage import ReadPart
from pipeline.reading.warm_up import warm_up
from pipeline.service.web.problem import OwnProblem, Problem, UnreadableProblem, UnverifiableProblem, busy
from pipeline.workers.executors import WorkerLostError
from pipeline.workers.pool import BusyError

if TYPE_CHECKING:
    from pipeline.common.settings import Limits, ReadSettings
    from pipeline.service.jobs import JobFolder
    from pipeline.service.metrics import Metrics
    from pipeline.service.stage.devices import ScanOrder
    from pipeline.workers.pool import WorkPool
    from whisker_array.scan.session import SessionStage

T = TypeVar("T")
log = structlog.get_logger("tactile-marks")
# Seconds that the check of a job may take; most take a tenth of a second.
CHECK_S = 10.0
# Seconds that it may wait for a worker; a part takes a second or two.
FREE_S = 5.0
# seconds between two checks of unusable files that have not changed: the cause may have passed
UNCHANGED_S = 60.0
# workers lost in a row after which the service is not ready, until a worker has read a clean part
MOST_LOST = 2


@dataclass
class WorkerCalls:
    """Functions called in the pool's workers; `jobs` are settings of reading and glyph databases, by name."""

    pool: WorkPool
    jobs: JobFolder
    limits: Limits
    metrics: Metrics
    _troubles: dict[tuple[str, str], str] = field(default_factory=dict, init=False)
    _last_checks: dict[tuple[str, str], tuple[object, ...]] = field(default_factory=dict, init=False)
    _lost: list[str] = field(default_factory=list, init=False)

    @property
    def troubles(self) -> dict[str, str]:
        return {job or database: why for (job, database), why in self._troubles.items() if job or database}

    def trouble(self, job: str) -> str:
        if known := self._troubles.get((job, "")):
            return known
        if len(self._lost) >= MOST_LOST:
            return f"the last {len(self._lost)} workers were lost, the latest so: {self._lost[-1]}"
        try:
            missing = [path.name for path in files_of(self.jobs.settings(job)) if not path.is_file()]
        except Problem as problem:
            return problem.detail
        return f"{missing[0]} is not there; put it back" if missing else ""

    async def recheck(self) -> None:
        """Check unusable jobs and files again; after lost workers, read a generated clean part."""
        if len(self._lost) >= MOST_LOST:
            with contextlib.suppress(Problem, WorkerLostError):
                await self._call_once(warm_up, self.jobs.settings(""), self.limits)
                log.info("a clean part is read again: the parts that have lost the workers are to blame")
        for job, database in tuple(self._troubles):
            try:
                async with self._note_fault(job, database):
                    await self._check_again(job, database)
            except Problem as problem:
                if problem.is_final:  # removed for good: there is nothing left to be put right
                    self._forget(job, database)
            except WorkerLostError:
                pass

    async def _check_again(self, job: str, database: str) -> None:
        settings = await self._settings_with(database, job)
        stamps = tuple(stamp_if_there(path) for path in files_of(settings))
        check = (settings, stamps, time.monotonic() // UNCHANGED_S)
        if self._last_checks.get((job, database)) == check:
            raise OwnProblem(self._troubles[job, database])
        self._last_checks[job, database] = check
        await self._call_once(check_settings, settings)

    async def _settings_with(self, database: str, job: str) -> ReadSettings:
        settings = await asyncio.to_thread(self.jobs.settings, job) if job else self.jobs.settings(job)
        if not database:
            return settings
        return settings.model_copy(update={"database": self.jobs.databases.find(database)})

    def outside_format(self, text: str, job: str) -> str:
        try:
            return outside_format(text, self.jobs.settings(job))
        except (Problem, FileError):
            return ""

    def check_expected(self, text: str, job: str) -> None:
        """Raises Problem: there is no such job, or the text does not fit its format."""
        settings = self.jobs.settings(job)
        if why := outside_format(text, settings):
            raise UnverifiableProblem(422, f"{EXPECTED}: is {text!r}, but {why}; correct one of them")

    async def read(
        self,
        part: PartJob,
        *,
        job: str,
        database: str,
        felt_by: tuple[SessionStage[ScanOrder], ScanOrder] | None = None,
    ) -> ReadPart:
        """Read a part in a worker, with the settings of its job; `felt_by` is the stage that feels it meanwhile. Raises
        StageError: nothing was felt. Problem: unusable files, a full queue, a lost worker. OwnProblem."""
        async with self._note_fault(job, database):
            settings = await self._settings_with(database, job)
            part = replace(part, settings=settings, limits=self.limits)
            if felt_by is None:
                return await self.call(read_sent, part)
            # a second try would scan the part again
            return await self.call(read_on_stage, part, *felt_by, tries=1)

    async def call(self, function: Callable[..., T], *arguments: Any, tries: int = 2) -> T:
        """Call a function in a worker, again if that is lost. Raises Problem: full queue, unusable files."""
        for lost in range(1, tries + 1):
            try:
                return await self._call_once(function, *arguments)
            except WorkerLostError as error:
                if lost == tries or error.timed_out or error.unstarted:
                    raise _lost_problem(error, lost) from error
        raise AssertionError("no try")

    def call_blocking(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function that checks a job, before the parts that wait, for at most `FREE_S` and `CHECK_S`. Raises
        Problem: no worker in time, or a lost one. MarksError: as in the function."""
        try:
            checked: T = self.pool.call(function, *arguments, free_s=FREE_S, timeout_s=CHECK_S)
        except BusyError as error:
            raise busy(error.retry_after_s) from error
        except WorkerLostError as error:
            log.warning("worker lost", why=str(error))
            if error.timed_out and not error.starved:
                raise Problem(422, f"it takes longer than {CHECK_S:g} s to check; make it simpler") from error
            if error.crashed:
                raise Problem(422, f"the worker that checked it was lost: {error}") from error
            raise _lost_problem(error, 1) from error
        return checked

    async def _call_once(self, function: Callable[..., T], *arguments: Any) -> T:
        try:
            done: T = await asyncio.wrap_future(self.pool.submit(function, *arguments))
        except BusyError as error:
            self.metrics.refused.inc()
            raise busy(error.retry_after_s) from error
        except WorkerLostError as error:
            self.metrics.lost_workers.inc()
            self._lost = [*self._lost[-99:], str(error)]
            log.warning("worker lost", why=str(error))
            raise
        except FileError as error:
            self._lost.clear()
            if isinstance(error, OwnFileError):
                raise OwnProblem(str(error)) from error
            if error.path.name == EXPECTED:
                raise UnverifiableProblem(422, str(error)) from error
            raise UnreadableProblem(500 if isinstance(error, FaultError) else 422, str(error)) from error
        self._lost.clear()
        return done

    @contextlib.asynccontextmanager
    async def _note_fault(self, job: str, database: str) -> AsyncIterator[None]:
        key = (job, database)
        try:
            yield
        except OwnProblem as problem:
            if self._troubles.get(key) != problem.detail:
                log.error("parts cannot be read", job=job, database=database, why=problem.detail)
            self._troubles[key] = problem.detail
            raise
        if self._forget(job, database):
            log.info("parts can be read again", job=job, database=database)

    def _forget(self, job: str, database: str) -> bool:
        self._last_checks.pop((job, database), None)
        return self._troubles.pop((job, database), None) is not None


def _lost_problem(error: WorkerLostError, lost: int) -> Problem:
    """The answer after lost workers: 422 if the same would happen again, 503 if it may pass."""
    if error.timed_out and not error.starved:
        return UnreadableProblem(422, f"{error}; send a smaller file, a simpler job, or raise limit_s")
    if error.timed_out:
        busy_machine = f"{error}, for most of which it waited; send it again later"
        return UnreadableProblem(503, busy_machine, headers={"Retry-After": "60"})
    if lost > 1:
        detail = f"it has ended {lost} workers, the last so: {error}; if it happens again, report it"
        later = None if error.crashed else {"Retry-After": "60"}
        return UnreadableProblem(422 if error.crashed else 503, detail, headers=later)
    return Problem(503, f"{error}; send it again", headers={"Retry-After": "5"})
