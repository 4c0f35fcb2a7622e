"""Files and folders of output, checked before the work starts."""

from __future__ import annotations

import tempfile
from pathlib import Path

from glyphs.errors import FileError


def make_folder(folder: Path) -> None:
    """Make a folder of output, and those above it, if need be.

    Raises:
        FileError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made ({error.strerror})", "name another folder") from error


def check_writable(path: Path) -> None:
    """Try, before the work starts, whether a file can be written there.

    Raises:
        FileError: it cannot.
    """
    if path.is_dir():
        raise FileError(path, "is a folder", "name a file")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise FileError(
            path, f"cannot be written ({error.strerror or error})", "name a folder that can be written"
        ) from error
