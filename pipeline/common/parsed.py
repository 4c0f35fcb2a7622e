"""TOML and JSON that somebody else has written: whatever is wrong with the text is one kind of error.

The parsers raise more than their own errors: RecursionError for brackets in brackets, ValueError for a number of more
digits than Python converts.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from glyphs.errors import FileError, require_file

MOST_BYTES = 1_000_000
"""Of a file that a person has written."""
_MOST_SHOWN = 200


def toml_of(path: Path, *, most_bytes: int = MOST_BYTES) -> dict[str, Any]:
    """The table in a TOML file.

    Raises:
        FileError: no regular file, too long a one, or no TOML.
    """
    require_file(path, most_bytes=most_bytes)
    try:
        return tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})", "check its permissions") from error
    except RecursionError as error:
        raise FileError(path, "is not TOML that can be read (too many brackets)", "take them out") from error
    except ValueError as error:  # also of bytes that are no UTF-8, and of numbers that are too long
        raise FileError(path, f"is not TOML ({error})", "correct that line") from error


def json_of(text: str | bytes) -> Any:
    """The value of a JSON text.

    Raises:
        ValueError: it is none, or none that can be read.
    """
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("too many brackets") from error


def shown(value: object) -> str:
    """A value as it was written, in at most a line."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."
