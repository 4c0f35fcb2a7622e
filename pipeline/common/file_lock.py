"""One process at a time, by a lock on a file; the lock ends with its holder, however that ends."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_FAR = 0x7FFF0000
"""Windows locks bytes, and nobody else can read them: one that no locked file has."""
_AGAIN_S = 0.05


@contextlib.contextmanager
def exclusively(path: Path) -> Iterator[None]:
    """Hold the lock file, made if it is missing and left where it is, while the block runs.

    Threads exclude each other as processes do, for each opens the file anew.

    Raises:
        OSError: the file cannot be made.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o600)
    try:
        lock(handle)
        yield
    finally:
        os.close(handle)


def lock(handle: int, *, wait: bool = True) -> bool:
    """Lock an open file until the handle is closed.

    A system with neither fcntl nor msvcrt runs one process only, and nothing is locked there.

    Args:
        handle: file descriptor, open for writing.
        wait: for another holder to end.

    Returns:
        Whether it is locked; always with `wait`.

    Raises:
        OSError: the file system has no locks.
    """
    try:
        import fcntl
    except ImportError:
        return _lock_byte(handle, wait=wait)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _lock_byte(handle: int, *, wait: bool) -> bool:
    try:
        import msvcrt as found
    except ImportError:
        return True
    msvcrt: Any = found  # its contents are known to a type checker on Windows alone
    stood = os.lseek(handle, 0, os.SEEK_CUR)
    try:
        while True:
            os.lseek(handle, _FAR, os.SEEK_SET)
            try:
                msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
                return True
            except PermissionError:
                if not wait:
                    return False
            time.sleep(_AGAIN_S)
    finally:
        os.lseek(handle, stood, os.SEEK_SET)
