"""What is wrong with a file's content, without the file's name: whoever opened the file names it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from glyphs.errors import FileError, MarksError, MissingExtraError, damage_reported, require_file


class DataError(MarksError):
    """Content that cannot be used; `reading` makes it a FileError of the file that is read."""

    def __init__(self, what: str, hint: str) -> None:
        super().__init__(what, hint=hint)


@contextlib.contextmanager
def reading(path: Path, *, kind: str, most_bytes: int) -> Iterator[None]:
    """Check that there is a file to read, and name it in every error of what reads it.

    Args:
        path: the file.
        kind: its format, for damage that no reader has foreseen.
        most_bytes: longest file that is read.

    Raises:
        FileError: no such file, too long a one, or whatever is wrong with its content.
        MissingExtraError: as it is raised in the block.
    """
    require_file(path, most_bytes=most_bytes)
    missing = None
    with damage_reported(path, kind=kind):
        try:
            yield
        except MissingExtraError as error:  # nothing is wrong with the file
            missing = error
    if missing is not None:
        raise missing


@contextlib.contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name the file in errors of its content.

    Raises:
        FileError: in place of a DataError.
    """
    try:
        yield
    except DataError as error:
        raise FileError(path, error.what, error.hint) from error
