"""A job taught from a part: where a line stands on it and what it reads, put into the job's file.

box, text --> Taught --into the job as it is, or a new one--> settings --JobFolder.save--> housing-left.toml
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError
from pipeline.common.job_file import NAME, with_whole_paths
from pipeline.common.settings import NamedLine, ReadSettings, Region
from pipeline.reading.job_check import check_line
from pipeline.service.job_folder import JobFolder
from pipeline.service.web.problem import Problem

_OF_THE_SERIAL = {"format", "lexicon", "check", "exclude", "region", "line"}
_NOT_TAKEN_OVER = {*_OF_THE_SERIAL, "mode", "certificate"}


@dataclass(frozen=True)
class Taught:
    """A line of a part, as a person has shown it.

    Attributes:
        line: name; empty for the serial.
        text: that stands there.
        format: of such texts.
        region: where its middle lies.
        height_mm: of its characters; None to measure it.
        database: name of the glyph database of a die that was learned; empty for none. Of the serial.
    """

    line: str
    text: str
    format: str
    region: Region
    height_mm: float | None = None
    database: str = ""


def teach(jobs: JobFolder, name: str, taught: Taught, *, replace: bool) -> None:
    """Put a line into a job; a new one begins with the service's own settings of fonts, experts and thresholds.

    Args:
        jobs: where it is kept.
        name: of the job.
        taught: the line.
        replace: whether a line of that name may stand there already.

    Raises:
        Problem: no such line can be, the text is not of its format, or the line stands in the job (409).
    """
    try:
        objections = jobs.call(check_line, taught.format, taught.text)
        line = None
        if taught.line:
            line = NamedLine.parse(f"{taught.line}={taught.format}")
            line = NamedLine(line.name, line.format, taught.region)
    except (MarksError, ValueError) as error:
        raise Problem(422, str(error)) from error
    database = jobs.databases.path(taught.database) if taught.database else None
    if objections:
        raise Problem(422, f"{taught.text!r} is not of the format {taught.format}: {objections[0]}")
    with jobs.lock:
        before = jobs.written(name)
        if before is not None and not replace and _stands_in(before, taught.line):
            which = f"the line {taught.line}" if taught.line else "a serial"
            raise Problem(
                409,
                f"the job {name} has {which} already; name the line that you mean, or say that it may be replaced",
            )
        jobs.save(name, _written(_of_service(jobs.own) if before is None else before, taught, line, database))


def _stands_in(written: Mapping[str, Any], line: str) -> bool:
    if not line:
        return bool(written.get("format") or written.get("region"))
    return line in {NamedLine.parse(text).name for text in written.get("line", ())}


def _of_service(own: ReadSettings) -> dict[str, Any]:
    settings = with_whole_paths(own, Path())
    return settings.model_dump(mode="json", exclude_defaults=True, exclude=_NOT_TAKEN_OVER)


def _written(
    before: Mapping[str, Any], taught: Taught, line: NamedLine | None, database: Path | None
) -> dict[str, Any]:
    written = dict(before)
    if line is None:
        written["format"], written["region"] = taught.format, list(taught.region)
        written.pop("height_mm", None)
        if taught.height_mm is not None:
            written["height_mm"] = taught.height_mm
        if database is not None:
            written["database"] = str(database.absolute())
        return written
    others = [text for text in before.get("line", ()) if NamedLine.parse(text).name != line.name]
    written["line"] = [*others, str(line)]
    return written


def name_like(part_name: str) -> str:
    """A name for the job of parts that are called like this one: housing-left of tray-7/housing-left-0012."""
    words = re.split(r"[/\\]", part_name)[-1]
    stem = re.sub(r"[^A-Za-z0-9_.-]+", "-", words).rstrip("0123456789").strip("-_.")
    return stem if re.fullmatch(NAME, stem) else ""
