"""The jobs of a service: the files of one folder, by name.

    jobs/housing-left.toml --checked with all files that it names--> settings for parts of job housing-left

* A file is checked whenever its job is named, so jobs can be added, changed and removed while the service
  runs. A file that was there within the last hour may come back: until then, requests that name it are asked
  to retry.
* A job that cannot be used affects only its own parts: their requests are asked to retry. If the file of a
  working job becomes unusable, the job keeps its previous settings. The log and the list say so.
* Jobs that are added or changed while the service runs are checked by a worker process, within its limits.
* Without a name, parts are read by the service's own settings.
"""

from __future__ import annotations

import re
import threading
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import structlog

from glyphs.atomic import replacing
from glyphs.errors import FileError, MarksError
from pipeline.common.job_file import FILES, NAME, SUFFIX, JobFile, job_text, read_keys
from pipeline.common.settings import ReadSettings
from pipeline.errors import OwnFileError, describe_fault
from pipeline.reading.drift import EVERY, DriftWatch, watch_of
from pipeline.reading.job_check import check_job
from pipeline.service.recent_files import FileStamp, GlyphDatabases, RecentFiles, stamp_of
from pipeline.service.web.problem import OwnProblem, Problem, without_folders

log = structlog.get_logger("tactile-marks")


@dataclass(frozen=True)
class JobAnswer:
    """A job in the list.

    Attributes:
        name: name that requests use.
        settings: reading settings as its file states them; files by name only, a glyph database as requests name it.
        problem: why the file cannot be used as it is now; empty if it can.
    """

    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True)
class _Known:
    """A file at its last check; the job is from the last check that found a usable one."""

    state: FileStamp
    job: JobFile | None
    watch: DriftWatch | None
    problem: str = ""


def _call_here(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


class JobFolder(RecentFiles):
    """Jobs by name. Threads may share it.

    Attributes:
        folder: folder of the files.
        own: settings of parts that name no job.
        databases: glyph databases that a job may name.
        lock: held while a job is changed from its present content; reading parts does not need it.
        call: calls a function in a worker, as `call(check_job, path, written)`; raises Problem if it cannot.
    """

    def __init__(
        self,
        folder: Path,
        *,
        own: ReadSettings,
        databases: GlyphDatabases | None = None,
        needed: str = "",
        call: Callable[..., Any] = _call_here,
    ) -> None:
        """Open the folder and check every job in it.

        Args:
            folder: folder of the files; it need not exist.
            own: settings of parts that name no job.
            databases: glyph databases that a job may name (default: those in the jobs' folder).
            needed: job that the service's own settings name; a missing file of it is expected to come back.
            call: calls a function in a worker (default: in this process).

        Raises:
            SettingsError: settings name a certificate that is not valid for them.
        """
        super().__init__(folder, SUFFIX, "job", needed=needed)
        self.own = own
        self.databases = databases or GlyphDatabases(folder)
        # the service's own settings are the job without a name; each change is one operation of the dict, so
        # threads need no lock
        self._known = {"": _Known((0, 0), JobFile("", own, {}, ""), watch_of(own))}
        self.lock = threading.RLock()
        self.call = _call_here  # workers start later
        for name in self.files():
            self._refresh(name)
        self.call = call

    def settings(self, name: str) -> ReadSettings:
        """Reading settings of a job.

        Raises:
            OwnProblem: its file is missing or cannot be used.
            Problem: no job has that name.
        """
        return self._job(name).settings

    def watch(self, name: str) -> DriftWatch | None:
        """The drift watch of a job; None for one that is not certified."""
        known = self._known.get(name)
        return None if known is None else known.watch

    def drifts(self) -> dict[str, str | None]:
        """Drift message of each certified job, empty without drift; None if too few parts were read."""
        watches = {name: known.watch for name, known in sorted(self._known.copy().items())}
        return {
            name: watch.message() if watch.parts >= EVERY else None
            for name, watch in watches.items()
            if watch is not None
        }

    @property
    def drift(self) -> str:
        """Drift messages of all certified jobs; empty without drift."""
        return "; ".join(f"job {name}: {why}" if name else why for name, why in self.drifts().items() if why)

    def listed(self) -> list[JobAnswer]:
        """Every job, by name."""
        known = {name: self._refresh(name) for name in self.files()}
        return [
            JobAnswer(name, without_paths(one.job.written if one.job else {}), one.problem)
            for name, one in known.items()
            if one is not None
        ]

    def answer(self, name: str) -> JobAnswer:
        """A job in the list.

        Raises:
            Problem: 404, there is none.
        """
        found = {job.name: job for job in self.listed()}
        if name not in found:
            raise Problem(404, f"there is no job {name[:100]!r}; somebody may have deleted it")
        return found[name]

    def written(self, name: str) -> dict[str, Any] | None:
        """Content of a job's file, with lines as `ReadSettings.line`; None if there is no file.

        Raises:
            Problem: the file cannot be used.
        """
        if name not in self.files():
            return None
        job = self._job(name)
        lines = {"line": list(job.settings.line)} if job.settings.line else {}
        return {**job.written, **lines}

    def save(self, name: str, written: Mapping[str, Any]) -> bool:
        """Write a job, and return whether it is new.

        Args:
            name: name of the job.
            written: settings for the file.

        Raises:
            OwnProblem: a file that the job names cannot be used.
            FileError, OSError: the job's own file cannot be written.
            Problem: the name or the settings are not valid.
        """
        if re.fullmatch(NAME, name) is None:
            raise Problem(
                422,
                f"{name[:100]!r} is not a name for a job; use letters, digits, _, - and ., with a letter first",
            )
        path = self.folder / f"{name}{SUFFIX}"
        with self.lock:
            new = not path.exists()
            try:
                job, watch = _check(path, written, call=self.call)
            except OwnFileError as error:
                raise OwnProblem(without_folders(str(error))) from error
            except MarksError as error:
                raise Problem(422, without_folders(str(error))) from error
            text = job_text(written, job.settings.line)
            self.folder.mkdir(exist_ok=True)
            with replacing(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
            state = stamp_of(path.stat())
            job = replace(job, written=tomllib.loads(text), sha256=sha256(text.encode()).hexdigest())
            self._known[name] = _Known(state, job, watch)
        log.info("job", job=name, sha256=job.sha256)
        return new

    def delete(self, name: str) -> None:
        """Delete a job.

        Raises:
            Problem: 404, it does not exist; 409, the watched folder uses it.
            OSError: its file cannot be removed.
        """
        path = self.files().get(name)
        if path is None:
            raise Problem(404, f"there is no job {name[:100]!r}; /v1/jobs lists them")
        if name == self.needed:
            raise Problem(409, f"the watched folder uses the job {name}; set watch.job to another first")
        with self.lock:
            path.unlink(missing_ok=True)
            self.forget(name)
            self._known.pop(name, None)
        log.info("job deleted", job=name)

    def _job(self, name: str) -> JobFile:
        if name:
            self.find(name)
        known = self._refresh(name) if name else self._known[name]
        if known is None or known.job is None:
            why = "its file is gone" if known is None else known.problem
            raise OwnProblem(f"the job {name} cannot be used: {why}")
        return known.job

    def _refresh(self, name: str) -> _Known | None:
        """Check a job again if its file has changed; None if there is none."""
        path = self.folder / f"{name}{SUFFIX}"
        before = self._known.get(name)
        try:
            state = stamp_of(path.stat())
        except OSError:
            self._known.pop(name, None)
            return None
        if before is not None and before.state == state:
            return before
        try:
            job, watch = _check(path, call=self.call)
        except Problem:
            if before is None:
                raise
            return before  # no worker could check it; the next check may succeed
        except MarksError as error:
            problem = without_folders(str(error))
            log.warning("job cannot be used", job=name, why=problem, goes_on=before is not None)
            found = replace(before or _Known(state, None, None), state=state, problem=problem)
        else:
            log.info("job", job=name, sha256=job.sha256)
            found = _Known(state, job, watch)
        self._known[name] = found
        return found


def without_paths(written: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a job, with file names without paths; a glyph database has its name in requests."""
    named = {key: Path(written[key]).name for key in FILES if written.get(key) is not None}
    if "database" in named:
        named["database"] = Path(named["database"]).stem
    return {**written, **named}


def _check(path: Path, *keys: Any, call: Callable[..., Any]) -> tuple[JobFile, DriftWatch | None]:
    """Check a file, or keys to be written to it; return its job and drift watch.

    Raises:
        FileError: it cannot be used, for any reason: one bad job must not affect the others.
        Problem: no worker has checked it.
    """
    try:
        job: JobFile = call(check_job, path, *(keys or read_keys(path)))
        return job, watch_of(job.settings)
    except (MarksError, Problem):
        raise
    except Exception as error:
        log.exception("fault of the program while reading a job", job=path.stem)
        raise FileError(path, describe_fault(error), "remove it and report this") from error
