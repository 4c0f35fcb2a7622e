"""Jobs and glyph databases: the files of two folders, by name; jobs are also written, edited as text, and taught.

* A file is checked whenever its job is named, by a worker within its limits, so jobs can change while the service runs.
* A file that was there within the last hour may come back: requests that name it are asked to retry until then.
* A job that cannot be used affects only its own parts. One that worked before keeps its former settings.
"""

from __future__ import annotations

import re
import threading
import time
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import structlog

from glyphs.atomic import replacing
from glyphs.errors import FileError, MarksError
from pipeline.common.file_stamp import FileStamp, stamp_of
from pipeline.common.job_file import FILES, NAME, SUFFIX, JobFile, job_text, read_keys, with_whole_paths
from pipeline.common.settings import NamedLine, ReadSettings, SettingsError
from pipeline.errors import OwnFileError, describe_fault
from pipeline.reading.drift import EVERY, DriftWatch, watch_of
from pipeline.reading.readers import check_job, check_line
from pipeline.service.web.problem import OwnProblem, Problem, without_folders

# seconds for which a file that is gone may come back: a disk that is mounted anew, a file that is put back.
# After that its removal counts as meant.
MOST_AWAY_S = 3600.0
_FILES_BY_HAND = "is a file of the service's machine; name it in the job file itself"
_OF_THE_SERIAL = {"format", "lexicon", "region", "line"}
_NOT_TAKEN_OVER = {*_OF_THE_SERIAL, "mode", "certificate"}
log = structlog.get_logger("tactile-marks")


class RecentFiles:
    """The files of one folder with one suffix, without hidden ones; `needed` is one that the settings name."""

    def __init__(self, folder: Path, suffix: str, what: str, *, needed: str = "") -> None:
        self.folder, self._suffix, self._what, self.needed = folder, suffix, what, needed
        self._seen_s: dict[str, float] = {}

    def files(self) -> dict[str, Path]:
        files = {}
        try:
            paths = sorted(self.folder.glob(f"[!.]*{self._suffix}"))
            files = {path.stem: path for path in paths if is_text(path.name) and path.is_file()}
        except OSError as error:
            log.warning("folder cannot be looked at", folder=str(self.folder), why=str(error))
        self._seen_s |= dict.fromkeys(files, time.monotonic())
        return files

    def find(self, name: str) -> Path:
        """The file of a name. Raises OwnProblem: it was there lately, and is away. Problem: there is none."""
        files = self.files()
        if name in files:
            return files[name]
        seen_s = self._seen_s.get(name)
        if seen_s is not None and (name == self.needed or time.monotonic() - seen_s < MOST_AWAY_S):
            raise OwnProblem(f"the {self._what} {name} has disappeared; put {name}{self._suffix} back")
        usable = self.usable(files)
        there = f"choose one of {', '.join(usable)}" if usable else "there are none yet"
        raise Problem(422, f"there is no {self._what} {name[:100]!r}; {there}")

    def usable(self, names: Iterable[str]) -> list[str]:
        return list(names)


def is_text(name: str) -> bool:
    """Whether a file's name can be stored: one that is not UTF-8 has half surrogates."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


class GlyphDatabases(RecentFiles):
    """Glyph databases by name; looked up on every use, so that one may be added while the service runs."""

    def __init__(self, folder: Path, *, default: Path | None = None) -> None:
        """Raises SettingsError: the database of parts that name none is not there."""
        super().__init__(folder, ".glyphs", "glyph database")
        self._default = default
        if default is not None and not default.is_file():
            raise SettingsError(
                f"there is no glyph database {default}", hint="make it with enroll, or name another"
            )

    def listed(self) -> list[dict[str, Any]]:
        default = None if self._default is None else self._default.absolute()
        return [{"name": name, "default": path.absolute() == default} for name, path in self.files().items()]


@dataclass(frozen=True)
class JobAnswer:
    """A job in the list: its settings as its file states them, files by name only, and why it cannot be used now."""

    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True)
class _CheckedJob:
    state: FileStamp
    job: JobFile | None
    watch: DriftWatch | None
    problem: str = ""


def _call_here(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


class JobFolder(RecentFiles):
    """Jobs by name; threads may share it. `lock` is held while a job is changed from its present content."""

    def __init__(
        self,
        folder: Path,
        *,
        default: ReadSettings,
        databases: GlyphDatabases | None = None,  # that a job may name (default: in the folder)
        needed: str = "",  # job that the service's own settings name; a missing file of it is expected back
        call: Callable[..., Any] = _call_here,
    ) -> None:
        """Check every job in the folder. Raises SettingsError: settings name a certificate that is not valid for them.
        `call` calls a function in a worker, or raises Problem (default: in this process)."""
        super().__init__(folder, SUFFIX, "job", needed=needed)
        self.default = default
        self.databases = databases or GlyphDatabases(folder)
        # the service's own settings are the job without a name; each change is one operation of the dict, so
        # threads need no lock
        self._checked = {"": _CheckedJob((0, 0), JobFile("", default, {}, ""), watch_of(default))}
        self.lock = threading.RLock()
        self.call = _call_here  # workers start later
        for name in self.files():
            self._refresh(name)
        self.call = call

    def settings(self, name: str) -> ReadSettings:
        """Reading settings of a job. Raises OwnProblem: its file cannot be used. Problem: no job has that name."""
        return self._job(name).settings

    def watch(self, name: str) -> DriftWatch | None:
        known = self._checked.get(name)
        return None if known is None else known.watch

    def drifts(self) -> dict[str, str | None]:
        """Drift message of each certified job, empty without drift; None if too few parts were read."""
        watches = {name: known.watch for name, known in sorted(self._checked.copy().items())}
        return {
            name: watch.message() if watch.parts >= EVERY else None
            for name, watch in watches.items()
            if watch is not None
        }

    @property
    def drift(self) -> str:
        return "; ".join(f"job {name}: {why}" if name else why for name, why in self.drifts().items() if why)

    def listed(self) -> list[JobAnswer]:
        known = {name: self._refresh(name) for name in self.files()}
        return [
            JobAnswer(name, without_paths(job.job.written if job.job else {}), job.problem)
            for name, job in known.items()
            if job is not None
        ]

    def answer(self, name: str) -> JobAnswer:
        jobs = {job.name: job for job in self.listed()}
        if name not in jobs:
            raise Problem(404, f"there is no job {name[:100]!r}; somebody may have deleted it")
        return jobs[name]

    def written(self, name: str) -> dict[str, Any] | None:
        """Content of a job's file, with whole lines; None without a file. Raises Problem: the file cannot be used."""
        if name not in self.files():
            return None
        job = self._job(name)
        lines = {"line": list(job.settings.line)} if job.settings.line else {}
        return {**job.written, **lines}

    def save(self, name: str, written: Mapping[str, Any]) -> bool:
        """Write a job, and return whether it is new. Raises Problem: the name or the settings are not valid.
        OwnProblem: a file that the job names cannot be used. FileError, OSError: it cannot be written."""
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
            self._checked[name] = _CheckedJob(state, job, watch)
        log.info("job", job=name, sha256=job.sha256)
        return new

    def delete(self, name: str) -> None:
        """Delete a job. Raises Problem: 404 without one, 409 if the watched folder uses it. OSError: it stays."""
        path = self.files().get(name)
        if path is None:
            raise Problem(404, f"there is no job {name[:100]!r}; /v1/jobs lists them")
        if name == self.needed:
            raise Problem(409, f"the watched folder uses the job {name}; set watch.job to another first")
        with self.lock:
            path.unlink(missing_ok=True)
            self._seen_s.pop(name, None)  # it is not expected back
            self._checked.pop(name, None)
        log.info("job deleted", job=name)

    def usable(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name not in self._checked or self._checked[name].job is not None]

    def _job(self, name: str) -> JobFile:
        if name:
            self.find(name)
        known = self._refresh(name) if name else self._checked[name]
        if known is None or known.job is None:
            why = "its file is gone" if known is None else known.problem
            raise OwnProblem(f"the job {name} cannot be used: {why}")
        return known.job

    def _refresh(self, name: str) -> _CheckedJob | None:
        path = self.folder / f"{name}{SUFFIX}"
        before = self._checked.get(name)
        try:
            state = stamp_of(path.stat())
        except OSError:
            self._checked.pop(name, None)
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
            checked = replace(before or _CheckedJob(state, None, None), state=state, problem=problem)
        else:
            log.info("job", job=name, sha256=job.sha256)
            checked = _CheckedJob(state, job, watch)
        self._checked[name] = checked
        return checked


def without_paths(written: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a job, with file names without paths; a glyph database has its name in requests."""
    named = {key: Path(written[key]).name for key in FILES if written.get(key) is not None}
    if "database" in named:
        named["database"] = Path(named["database"]).stem
    return {**written, **named}


def _check(path: Path, *keys: Any, call: Callable[..., Any]) -> tuple[JobFile, DriftWatch | None]:
    try:
        job: JobFile = call(check_job, path, *(keys or read_keys(path)))
        return job, watch_of(job.settings)
    except (MarksError, Problem):
        raise
    except Exception as error:
        log.exception("fault of the program while reading a job", job=path.stem)
        raise FileError(path, describe_fault(error), "remove it and report this") from error


def written_job(jobs: JobFolder, body: Any) -> dict[str, Any]:
    """Convert requested settings to those of a job's file. Raises Problem: they are invalid, or name a file."""
    if not isinstance(body, dict):
        raise Problem(422, "the body is not a JSON object of settings")
    try:
        settings: ReadSettings = jobs.call(partial(ReadSettings.of, **body))
    except MarksError as error:
        raise Problem(422, str(error)) from error
    written: dict[str, Any] = settings.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    if settings.database is not None:
        written["database"] = str(jobs.databases.find(str(settings.database)))
    named: list[str] = [key for key in ("lexicon", "certificate", "whisker") if key in written]
    named += [font for font in settings.font if Path(font).name != font or "." in font]
    if named:
        raise Problem(422, f"{named[0]} {_FILES_BY_HAND}")
    return written


def text_to_edit(jobs: JobFolder, name: str) -> str:
    """A job as text, files without paths; empty if its file cannot be used. Raises Problem: 404, no such job."""
    try:
        written = jobs.written(name)
    except Problem:
        return ""
    if written is None:
        raise Problem(404, f"there is no job {name[:100]!r}; /jobs lists them")
    return job_text(without_paths(written), written.get("line", ()))


def save_edited(jobs: JobFolder, name: str, text: str, *, before: str) -> None:
    """Save the text of a job; files that it already names may stay. Raises Problem: changed meanwhile, or invalid."""
    with jobs.lock:
        if text_to_edit(jobs, name) != before:
            raise Problem(409, f"the job {name} has changed meanwhile; load the page again")
        try:
            keys = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            raise Problem(422, f"this is not TOML: {str(error)[:200]}") from error
        present = (jobs.written(name) or {}) if before else {}
        shown = without_paths(present)
        files = {key: present[key] for key in FILES if key in present and keys.get(key) == shown[key]}
        settings = {key: value for key, value in keys.items() if key not in files}
        jobs.save(name, {**written_job(jobs, settings), **files})


def teach(
    jobs: JobFolder,
    name: str,
    line: NamedLine,
    text: str,
    *,
    height_mm: float | None = None,
    database: str = "",
    replace: bool = False,
) -> None:
    """Add a line that a person has marked to a job; a new job starts with the service's own fonts and thresholds.
    `line` has no name for the serial; without `height_mm` its characters are measured. Raises Problem: no such line can
    be, the text is not of its format, or the line stands in the job (409)."""
    serial = not line.name
    try:
        objections = jobs.call(check_line, line.format, text)
        line = line if serial else NamedLine.parse(str(line))
    except (MarksError, ValueError) as error:
        raise Problem(422, str(error)) from error
    if objections:
        raise Problem(422, f"{text!r} is not of the format {line.format}: {objections[0]}")
    with jobs.lock:
        written = jobs.written(name)
        if written is None:
            settings = with_whole_paths(jobs.default, Path())
            written = settings.model_dump(mode="json", exclude_defaults=True, exclude=_NOT_TAKEN_OVER)
        lines = {line.name: line for line in map(NamedLine.parse, written.get("line", ()))}
        taken = (written.get("format") or written.get("region")) if serial else line.name in lines
        if taken and not replace:
            which = "a serial" if serial else f"the line {line.name}"
            hint = "name the line that you mean, or say that it may be replaced"
            raise Problem(409, f"the job {name} has {which} already; {hint}")
        if serial:
            region = line.region and list(line.region)
            written |= {"format": line.format, "region": region, "height_mm": height_mm}
            if database:
                written["database"] = str(jobs.databases.find(database).absolute())
        else:
            written["line"] = list(map(str, {**lines, line.name: line}.values()))
        jobs.save(name, {key: value for key, value in written.items() if value is not None})


def name_like(part_name: str) -> str:
    """A name for the job of parts with names like this one: housing-left of tray-7/housing-left-0012."""
    words = re.split(r"[/\\]", part_name)[-1]
    stem = re.sub(r"[^A-Za-z0-9_.-]+", "-", words).rstrip("0123456789").strip("-_.")
    return stem if re.fullmatch(NAME, stem) else ""
