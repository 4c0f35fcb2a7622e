"""The jobs that a service knows: the files of one folder, by name.

    jobs/housing-left.toml --checked with all that it names--> settings of reading of whoever names housing-left

* A file is looked at whenever its job is named, so jobs are made, changed and taken away while the service runs. One
  that was there within the last hour may come back: until then whoever names it is asked to come again.
* At the start every job must be one that can be used. One that is spoilt later goes on as it was before; the log and
  the list say so.
* Without a name, parts are read by the service's own settings.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import structlog

from glyphs.errors import FileError, MarksError, fault_of
from glyphs.stamping.database import DatabaseError
from pipeline.common.atomic import replacing
from pipeline.common.job_file import FILES, NAME, SUFFIX, JobFile, job_of, job_text, read_job_file
from pipeline.common.settings import ReadSettings
from pipeline.reading.certificate import certificate_of
from pipeline.reading.drift import EVERY, DriftWatch
from pipeline.reading.readers import files_of
from pipeline.service.glyph_databases import GlyphDatabases
from pipeline.service.recent_files import RecentFiles
from pipeline.service.web.problem import OwnProblem, Problem, no_room

log = structlog.get_logger("tactile-marks")
_State = tuple[int, int]


@dataclass(frozen=True)
class JobAnswer:
    """A job as the list has it.

    Attributes:
        name: that requests call it by.
        settings: of reading, as its file has them; of files the names.
        problem: why the file cannot be used as it is now; empty where it can.
    """

    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True)
class _Known:
    """A file as it was last looked at; the job is of the last look that found one."""

    state: _State
    job: JobFile | None
    watch: DriftWatch | None
    problem: str = ""


class JobFolder:
    """Jobs by name. Threads may share it.

    Attributes:
        folder: of the files.
        own: settings of parts that name no job.
        databases: that a job may be given by name.
        lock: held by whoever changes a job by what stands in it.
    """

    def __init__(
        self, folder: Path, *, own: ReadSettings, databases: GlyphDatabases | None = None, needed: str = ""
    ) -> None:
        """Take the folder, and look at every job in it.

        Args:
            folder: of the files; it need not be there.
            own: settings of parts that name no job.
            databases: that a job may be given by name; those beside the jobs unless given.
            needed: job that the service's own settings name: where it is away, it is to come back.

        Raises:
            FileError: a job that cannot be used.
            SettingsError: settings that name a certificate that does not hold for them.
        """
        self.folder, self.own = folder, own
        self.databases = databases or GlyphDatabases(folder)
        self._own_watch = _watch_of(own)
        self._known: dict[str, _Known] = {}
        self._recent, self._needed = RecentFiles(folder, SUFFIX), needed
        self.lock = threading.RLock()
        for name, path in self._recent.files().items():
            job, watch = _read(path)
            self._known[name] = _Known(_state_of(path), job, watch)

    def settings(self, name: str) -> ReadSettings:
        """How parts of a job are read.

        Raises:
            OwnProblem: its file is away, or cannot be used.
            Problem: there is none of that name.
        """
        return self.own if not name else self._job(name).settings

    def watch(self, name: str) -> DriftWatch | None:
        """What compares a job's parts with those of its certificate; None where it has none."""
        if not name:
            return self._own_watch
        with self.lock:
            known = self._known.get(name)
            return None if known is None else known.watch

    @property
    def watched(self) -> bool:
        """Whether anything is certified."""
        with self.lock:
            return self._own_watch is not None or any(known.watch for known in self._known.values())

    def drifts(self) -> dict[str, str | None]:
        """How each job's parts differ from the certified ones; None where too few were read to tell."""
        watches = {"": self._own_watch}
        with self.lock:
            watches |= {name: known.watch for name, known in self._known.items()}
        return {
            name: watch.message() if watch.parts >= EVERY else None
            for name, watch in watches.items()
            if watch is not None
        }

    @property
    def drift(self) -> str:
        """How parts differ from the certified ones; empty where they do not, or nothing is certified."""
        said = [] if self._own_watch is None else [self._own_watch.message()]
        with self.lock:
            for name, known in sorted(self._known.items()):
                message = "" if known.watch is None else known.watch.message()
                said.append(f"job {name}: {message}" if message else "")
        return "; ".join(filter(None, said))

    def listed(self) -> list[JobAnswer]:
        """Every job, by name."""
        found = []
        for name in self._recent.files():
            known = self._look(name)
            if known is None:
                continue
            written = {} if known.job is None else known.job.written
            shown = {key: Path(value).name if key in FILES else value for key, value in written.items()}
            found.append(JobAnswer(name, shown, known.problem))
        return found

    def written(self, name: str) -> dict[str, Any] | None:
        """What stands in the file of a job, with lines as `ReadSettings.line`; None where there is none.

        Raises:
            Problem: a file that cannot be used.
        """
        if re.fullmatch(NAME, name) is None or name not in self._recent.files():
            return None
        job = self._job(name)
        lines = {"line": list(job.settings.line)} if job.settings.line else {}
        return {**job.written, **lines}

    def save(self, name: str, written: Mapping[str, Any]) -> bool:
        """Write a job; whether it is a new one.

        Args:
            name: of the job.
            written: settings, as they are to stand in the file.

        Raises:
            OwnProblem: the file cannot be written, or one that it names cannot be used.
            Problem: the settings cannot be.
        """
        if re.fullmatch(NAME, name) is None:
            raise Problem(
                422, f"{name[:100]!r} is no name for a job; write letters, digits, _, - and ., a letter first"
            )
        path = self.folder / f"{name}{SUFFIX}"
        with self.lock:
            new = not path.exists()
            try:
                text, job = job_text(written), job_of(path, written)
            except MarksError as error:
                raise Problem(422, _unplaced(error, self.folder)) from error
            try:
                _checked(job)
            except FileError as error:
                said = _unplaced(error, self.folder)
                own = error.path in files_of(job.settings) or isinstance(error.__cause__, DatabaseError)
                raise OwnProblem(said) if own else Problem(422, said) from error
            try:
                self.folder.mkdir(exist_ok=True)
                with replacing(path) as temporary:
                    temporary.write_text(text, encoding="utf-8")
            except (FileError, OSError) as error:
                raise no_room(error) from error
            self._look(name)
        return new

    def _job(self, name: str) -> JobFile:
        known = self._look(name) if re.fullmatch(NAME, name) else None
        there = self._recent.files()
        if known is None:
            if self._recent.is_away(name, for_ever=name == self._needed):
                raise OwnProblem(f"the job {name} was there and is not; put {name}{SUFFIX} back")
            named = ", ".join(there) or "none at all"
            raise Problem(422, f"there is no job {name[:100]!r}; there is {named}")
        if known.job is None:
            raise OwnProblem(f"the job {name} cannot be used: {known.problem}")
        return known.job

    def _look(self, name: str) -> _Known | None:
        """A job as it now is; None where there is none."""
        path = self.folder / f"{name}{SUFFIX}"
        with self.lock:
            before = self._known.get(name)
            try:
                state = _state_of(path)
            except OSError:
                self._known.pop(name, None)
                return None
            if before is not None and before.state == state:
                return before
            try:
                job, watch = _read(path)
            except MarksError as error:
                problem = _unplaced(error, self.folder)
                log.warning("job cannot be used", job=name, why=problem, goes_on=before is not None)
                kept = (None, None) if before is None else (before.job, before.watch)
                self._known[name] = _Known(state, *kept, problem)
            else:
                log.info("job", job=name, sha256=job.sha256)
                self._known[name] = _Known(state, job, watch)
            return self._known[name]


def _read(path: Path) -> tuple[JobFile, DriftWatch | None]:
    """The job in a file; what watches its parts.

    Raises:
        FileError: it cannot be used, for whatever reason: one job may not cost the others.
    """
    try:
        return _checked(read_job_file(path))
    except MarksError:
        raise
    except Exception as error:
        log.exception("fault of the program while reading a job", job=path.stem)
        raise FileError(path, fault_of(error), "take it away, and report it") from error


def _checked(job: JobFile) -> tuple[JobFile, DriftWatch | None]:
    """The job, once everything that it names is found to be of use; what watches its parts.

    Raises:
        FileError: something is not.
    """
    from pipeline.reading.readers import open_reader

    try:
        open_reader(job.settings)
        return job, _watch_of(job.settings)
    except FileError:
        raise
    except MarksError as error:
        raise FileError(f"{job.name}{SUFFIX}", error.what, error.hint) from error


def _watch_of(settings: ReadSettings) -> DriftWatch | None:
    certificate = certificate_of(settings)
    return None if certificate is None else DriftWatch(certificate)


def _state_of(path: Path) -> _State:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


def _unplaced(error: MarksError, folder: Path) -> str:
    # paths of the server are nobody's business
    return str(error).replace(f"{folder.absolute()}/", "").replace(f"{folder}/", "")
