"""Edit jobs: as text without paths of the service's machine, or by teaching from a part.

box, text --> Taught --into the job as it is, or a new one--> settings --JobFolder.save--> housing-left.toml
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError
from pipeline.common.job_file import FILES, NAME, job_text, with_whole_paths
from pipeline.common.settings import NamedLine, ReadSettings, Region
from pipeline.reading.job_check import check_line
from pipeline.service.job_folder import JobFolder, without_paths
from pipeline.service.web.problem import Problem

_FILES_BY_HAND = "is a file of the service's machine; name it in the job file itself"
_OF_THE_SERIAL = {"format", "lexicon", "check", "exclude", "region", "line"}
_NOT_TAKEN_OVER = {*_OF_THE_SERIAL, "mode", "certificate"}


def written_job(jobs: JobFolder, asked: Any) -> dict[str, Any]:
    """Convert requested settings to those of a job's file.

    Raises:
        Problem: invalid settings, or settings that name a file of the service's machine.
    """
    if not isinstance(asked, dict):
        raise Problem(422, "the body is not a JSON object of settings")
    try:
        settings: ReadSettings = jobs.call(partial(ReadSettings.of, **asked))
    except MarksError as error:
        raise Problem(422, str(error)) from error
    written: dict[str, Any] = settings.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    if settings.database is not None:
        written["database"] = str(jobs.databases.find(str(settings.database)))
    named: list[str] = [key for key in ("lexicon", "certificate") if key in written]
    named += [font for font in settings.font if Path(font).name != font or "." in font]
    if named:
        raise Problem(422, f"{named[0]} {_FILES_BY_HAND}")
    return written


def text_to_edit(jobs: JobFolder, name: str) -> str:
    """The settings of a job, with file names without paths; empty if its file cannot be used.

    Raises:
        Problem: 404, there is no such job.
    """
    try:
        written = jobs.written(name)
    except Problem:
        return ""
    if written is None:
        raise Problem(404, f"there is no job {name[:100]!r}; /jobs lists them")
    return job_text(without_paths(written), written.get("line", ()))


def save_edited(jobs: JobFolder, name: str, text: str, *, before: str) -> None:
    """Save the text of a job; files that it already names may stay.

    Args:
        jobs: jobs of the service.
        name: name of the job.
        text: edited text.
        before: text that was shown.

    Raises:
        Problem: no such job, one that has changed meanwhile, invalid settings.
    """
    with jobs.lock:
        if text_to_edit(jobs, name) != before:
            raise Problem(409, f"the job {name} has changed meanwhile; load the page again")
        try:
            asked = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            raise Problem(422, f"this is not TOML: {str(error)[:200]}") from error
        kept = (jobs.written(name) or {}) if before else {}
        shown = without_paths(kept)
        files = {key: kept[key] for key in FILES if key in kept and asked.get(key) == shown[key]}
        rest = {key: value for key, value in asked.items() if key not in files}
        jobs.save(name, {**written_job(jobs, rest), **files})


@dataclass(frozen=True)
class Taught:
    """A line of a part that a person has marked.

    Attributes:
        line: name; empty for the serial.
        text: text on the part.
        format: format of such texts.
        region: where its middle may lie.
        height_mm: height of its characters; None to measure it.
        database: name of the glyph database of a die that was learned; empty for none. Of the serial.
    """

    line: str
    text: str
    format: str
    region: Region
    height_mm: float | None = None
    database: str = ""


def teach(jobs: JobFolder, name: str, taught: Taught, *, replace: bool) -> None:
    """Add a line to a job; a new job starts with the service's own fonts, experts and thresholds.

    Args:
        jobs: jobs in which it is kept.
        name: name of the job.
        taught: the line.
        replace: whether a line of that name may stand there already.

    Raises:
        Problem: no such line can be, the text is not of its format, or the line stands in the job (409).
    """
    try:
        objections = jobs.call(check_line, taught.format, taught.text)
        line = NamedLine.parse(f"{taught.line}={taught.format}") if taught.line else None
    except (MarksError, ValueError) as error:
        raise Problem(422, str(error)) from error
    if objections:
        raise Problem(422, f"{taught.text!r} is not of the format {taught.format}: {objections[0]}")
    with jobs.lock:
        written = jobs.written(name)
        if written is None:
            own = with_whole_paths(jobs.own, Path())
            written = own.model_dump(mode="json", exclude_defaults=True, exclude=_NOT_TAKEN_OVER)
        lines = {one.name: one for one in map(NamedLine.parse, written.get("line", ()))}
        serial = bool(written.get("format") or written.get("region"))
        if not replace and (serial if line is None else line.name in lines):
            which = "a serial" if line is None else f"the line {line.name}"
            raise Problem(
                409,
                f"the job {name} has {which} already; name the line that you mean, or say that it may be replaced",
            )
        if line is not None:
            lines[line.name] = NamedLine(line.name, line.format, taught.region)
            written["line"] = list(map(str, lines.values()))
        else:
            written |= {"format": taught.format, "region": list(taught.region), "height_mm": taught.height_mm}
            if taught.database:
                written["database"] = str(jobs.databases.find(taught.database).absolute())
        jobs.save(name, {key: value for key, value in written.items() if value is not None})


def name_like(part_name: str) -> str:
    """A name for the job of parts with names like this one: housing-left of tray-7/housing-left-0012."""
    words = re.split(r"[/\\]", part_name)[-1]
    stem = re.sub(r"[^A-Za-z0-9_.-]+", "-", words).rstrip("0123456789").strip("-_.")
    return stem if re.fullmatch(NAME, stem) else ""
