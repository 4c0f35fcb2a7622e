"""Files and folders that only their owner can read, for serials, photographs of parts and hashes of tokens."""

from __future__ import annotations

import contextlib
import os
import stat
from io import BufferedReader
from pathlib import Path


def private_folder(path: Path) -> None:
    """Make a folder for its owner alone; if it exists, remove the access of others (`close_to_others`)."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    close_to_others(path)


def private_file(path: Path) -> None:
    """Make an empty file for its owner alone; if it exists, remove the access of others. An existing file is not
    opened: closing it would release all locks that this process has on it."""
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0), 0o600))
    close_to_others(path)


def close_to_others(path: Path) -> None:
    """Remove the access of all but the owner (a group that may write keeps it); other users' files are ignored."""
    with contextlib.suppress(FileNotFoundError, PermissionError):
        mode = stat.S_IMODE(path.stat().st_mode)
        for_owner = mode & ~0o007 if mode & stat.S_IWGRP else mode & ~0o077
        if for_owner != mode:
            path.chmod(for_owner)


def open_no_link(path: Path) -> BufferedReader:
    """Open a file that may have become a link or a pipe, without following or waiting. Raises OSError: it is one."""
    flags = (getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY", "O_CLOEXEC"))
    return os.fdopen(os.open(path, sum(flags, os.O_RDONLY)), "rb")
