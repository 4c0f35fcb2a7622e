"""A job as a person edits it: the text of its file, without paths of the service's machine."""

from __future__ import annotations

import tomllib
from functools import partial
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError
from pipeline.common.job_file import FILES, job_text
from pipeline.common.settings import ReadSettings
from pipeline.service.job_folder import JobFolder, without_paths
from pipeline.service.web.problem import Problem

_FILES_BY_HAND = "is a file of the service's machine; name it in the job file itself"


def written_job(jobs: JobFolder, asked: Any) -> dict[str, Any]:
    """Settings that somebody asks for, as they are to stand in a job's file.

    Raises:
        Problem: settings that cannot be, or that name a file of the service's machine.
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
    """The settings of a job, with the names alone of files; empty where its file cannot be used as it is.

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
    """Save the text of a job; files that it names already may stay.

    Args:
        jobs: of the service.
        name: of the job.
        text: as it was edited.
        before: as it was shown.

    Raises:
        Problem: no such job, one that has changed meanwhile, settings that cannot be.
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
