"""Check a job before it is used: its settings and all files named in them. This runs in a worker process.

Formats, fonts and glyph databases from outside may take any amount of work; a worker's is limited.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from glyphs.errors import FileError, MarksError
from pipeline.common.job_file import SUFFIX, JobFile, files_of, job_of
from pipeline.errors import OwnFileError


def check_job(path: Path, written: Mapping[str, Any], digest: str = "") -> JobFile:
    """Read a job, and check that everything named in it can be used.

    Args:
        path: path of the file, which need not exist.
        written: its keys.
        digest: SHA-256 of the file.

    Raises:
        OwnFileError: a file that it names cannot be used.
        FileError: its settings cannot be used.
    """
    from pipeline.reading.readers import open_reader

    job = job_of(path, written, digest)
    try:
        open_reader(job.settings)
    except MarksError as error:
        if not isinstance(error, FileError):
            raise FileError(f"{job.name}{SUFFIX}", error.what, error.hint) from error
        own = error.path in files_of(job.settings)
        raise (OwnFileError if own else FileError)(error.path, error.what, error.hint) from error
    return job


def check_line(line_format: str, text: str) -> tuple[str, ...]:
    """Reasons why a text does not match a format, in words; empty if it matches.

    Raises:
        FormatError: an invalid format.
    """
    from recognition.language.grammar import Grammar

    return Grammar.parse(line_format).objections(text)
