"""Write files that appear whole or not at all: a temporary file in the same folder is renamed at the end."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from glyphs.errors import FileError


@contextlib.contextmanager
def replacing(path: Path, *, private: bool = False) -> Iterator[Path]:
    """Yield a temporary path, renamed, durably, to `path` after the block; `private`: for the owner. Raises
    FileError."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        temporary = Path(name)
        try:
            with os.fdopen(handle, "rb+"):
                yield temporary
            with temporary.open("rb+") as stream:
                os.fsync(stream.fileno())
            if not private:  # mkstemp makes it readable by the owner only
                temporary.chmod(0o666 & ~_umask())
            os.replace(temporary, path)
            sync_names(path.parent)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(
            path,
            f"cannot be written ({error.strerror or error})",
            "name a folder that can be written and has room",
        ) from error


def sync_folder(folder: Path) -> None:
    """Flush the list of a folder's files to the disk; Windows needs no such call. Raises OSError."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sync_names(folder: Path) -> None:
    """Call `sync_folder`; do nothing on file systems that do not support it."""
    with contextlib.suppress(OSError):
        sync_folder(folder)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
