"""File locks: one holder at a time; a lock ends with the process that holds it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

# seconds between two attempts to lock
_AGAIN_S = 0.05


@contextlib.contextmanager
def exclusively(path: Path, *, wait: bool = True) -> Iterator[bool]:
    """Hold a lock file while the block runs; it is created if missing, and left in place. Threads exclude each other
    like processes. Without fcntl and msvcrt nothing is locked. Raises OSError."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o600)
    try:
        while not (held := _try_lock(handle, wait=wait)) and wait:
            time.sleep(_AGAIN_S)
        yield held
    finally:
        os.close(handle)


def _try_lock(handle: int, *, wait: bool) -> bool:
    with contextlib.suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
    with contextlib.suppress(ImportError):
        import msvcrt

        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except PermissionError:
            return False
    return True
