"""Job files: the settings for one kind of part, in a TOML file that commands, requests and triggers name.

jobs/housing-left.toml      format = "AA999999"
                            region = [0.1, 0.3, 0.9, 0.6]
                            certificate = "housing-left.json"       (relative to the job's folder)
                            [line.lot]
                            format = "AAA99"

The keys are the settings of reading. Settings that a job leaves out have their defaults, whatever a flag or file says.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glyphs.errors import FileError
from glyphs.fonts.font_files import is_font_file
from pipeline.common.parsed import toml_of, toml_text
from pipeline.common.settings import NamedLine, ReadSettings, SettingsError
from pipeline.common.version import file_sha256

SUFFIX = ".toml"
NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}"
"""Form of a job's name, which is the name of a file and a word of a trigger."""
FILES = ("lexicon", "database", "certificate", "whisker")
"""Settings that name a file; a font may be one, too."""

_NAME_HINT = "write letters, digits, _, - and ., a letter or digit first"
_MODE_HINT = "take it out; a part is read with all its files, and read takes --mode beside --job"


def files_of(settings: ReadSettings) -> list[Path]:
    """The files named in the settings."""
    named = [path for name in FILES if (path := getattr(settings, name)) is not None]
    return [*named, *(Path(font) for font in settings.font if is_font_file(font))]


@dataclass(frozen=True)
class JobFile:
    """A checked job: the stem of its file, and settings with absolute paths."""

    name: str
    settings: ReadSettings
    written: Mapping[str, Any]
    sha256: str


def read_job_file(path: Path) -> JobFile:
    """Read a job. Raises FileError: as in `read_keys`; an invalid name or setting, or a missing file."""
    return job_of(path, *read_keys(path))


def read_keys(path: Path) -> tuple[dict[str, Any], str]:
    """The keys of a job file, not yet checked, and its SHA-256. Raises FileError: it is missing or not TOML."""
    return toml_of(path), file_sha256(path)


def job_of(path: Path, written: Mapping[str, Any], digest: str = "") -> JobFile:
    """Check the keys of a job file, which need not exist yet; errors as in `read_job_file`."""
    if not re.fullmatch(NAME, path.stem):
        raise FileError(path, "is not a valid name for a job", _NAME_HINT)
    if "mode" in written:
        raise FileError(path, "sets mode, which a job cannot", _MODE_HINT)
    try:
        settings = ReadSettings.of(**written)
    except SettingsError as error:
        raise FileError(path, error.what, error.hint or "correct it") from error
    settings = with_whole_paths(settings, path.parent)
    for name in FILES:
        named: Path | None = getattr(settings, name)
        if named is not None and not named.is_file():
            raise FileError(path, f"names the {name} {named}, which is not there", "put it beside the job")
    return JobFile(path.stem, settings, written, digest)


def job_text(written: Mapping[str, Any], lines: Iterable[str]) -> str:
    """The text of a job file; `lines`, as in `ReadSettings.line`, stand in place of the keys' own."""
    named: dict[str, Any] = {}
    for line in map(NamedLine.parse, lines):
        named[line.name] = {"format": line.format} | ({} if line.region is None else {"region": line.region})
    return toml_text({**{key: value for key, value in written.items() if key != "line"}, "line": named})


def with_whole_paths(settings: ReadSettings, folder: Path) -> ReadSettings:
    """Resolve the files in settings, fonts included, relative to a folder."""
    folder = folder.absolute()
    paths = {name: folder / path for name in FILES if (path := getattr(settings, name)) is not None}
    fonts = tuple(str(folder / font) if (folder / font).is_file() else font for font in settings.font)
    return settings.model_copy(update={**paths, "font": fonts})
