"""TOML that a person has written, as settings of a pydantic model; what is wrong with it is told by its first key."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from glyphs.errors import FileError
from pipeline.common.parsed import shown, toml_of

Model = TypeVar("Model", bound=BaseModel)
MOST_BYTES = 100_000


def toml_table(
    path: Path, *, most_bytes: int = MOST_BYTES, format_version: int | None = None
) -> dict[str, Any]:
    """What stands in a TOML file, without its format version.

    Args:
        path: the file.
        most_bytes: longest that is read.
        format_version: that is read; a file that tells none is of version 1, which was the first. None: of no version.

    Raises:
        FileError: no file, too long a one, no TOML, or of another version.
    """
    written = toml_of(path, most_bytes=most_bytes)
    if format_version is not None and (version := written.pop("format_version", 1)) != format_version:
        says = f"has format version {version!r}; this program reads {format_version}"
        raise FileError(path, says, "update this program, or write the file again")
    return written


def read_toml(path: Path, model: type[Model], *, most_bytes: int = MOST_BYTES) -> Model:
    """A TOML file as a model.

    Raises:
        FileError: as `toml_table`, and unknown or missing keys, and values that cannot be.
    """
    try:
        return model.model_validate(toml_table(path, most_bytes=most_bytes))
    except ValidationError as error:
        raise FileError(path, *wrong_key(error)) from error


def wrong_key(error: ValidationError, *, hidden: tuple[str, ...] = ()) -> tuple[str, str]:
    """What is wrong with the first key, and the mend.

    Args:
        error: of the model.
        hidden: names of the model's own kinds, which are no keys.
    """
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"] if part not in hidden)
    if first["type"] == "extra_forbidden":
        return f"has the unknown key {key}", "take it out, or check how it is written"
    if first["type"] == "missing":
        return f"lacks the key {key}", "add it"
    mend = first["msg"].removeprefix("Value error, ")
    if first["type"] == "value_error":  # of a whole table: its text is long, and the message names the keys
        return f"cannot be{f' in [{key}]' if key else ''}: {mend}", "correct it"
    return f"says {key} = {shown(first.get('input'))}", f"correct it: {mend.lower()}"
