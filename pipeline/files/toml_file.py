"""TOML that a person has written: read, and what is wrong with it said with the key."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from glyphs.errors import FileError, require_file

_MOST_BYTES = 100_000


def read_toml(path: Path, *, format_version: int) -> dict[str, Any]:
    """The keys of a file, without its format version.

    Args:
        path: the file.
        format_version: that is read; a file that tells none is of version 1, which was the first.

    Raises:
        FileError: no file, no TOML, or of another version.
    """
    require_file(path, most_bytes=_MOST_BYTES)
    try:
        written = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(path, f"is not TOML ({error})", "correct that line") from error
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", "check its permissions") from error
    version = written.pop("format_version", 1)
    if version != format_version:
        says = f"has format version {version!r}; this program reads {format_version}"
        raise FileError(path, says, "update this program, or write the file again")
    return written


def first_problem(error: ValidationError, *, unnamed: tuple[str, ...] = ()) -> tuple[str, str]:
    """What is wrong with the first key, and the mend.

    Args:
        error: of a model.
        unnamed: steps of the way to a key that the file does not have: tags of unions.
    """
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if part not in unnamed)
    if first["type"] == "extra_forbidden":
        return f"has the unknown key {key}", "take it out, or check how it is written"
    if first["type"] == "missing":
        return f"lacks the key {key}", "add it"
    if first["type"] == "value_error":
        return first["msg"].removeprefix("Value error, "), "correct it"
    return f"says {key} = {first.get('input')!r}", f"correct it: {first['msg'].lower()}"
