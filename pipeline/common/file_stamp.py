"""Recognise a file that has not changed since an earlier look, and a picture that was read before."""

from __future__ import annotations

import os
from pathlib import Path

FileStamp = tuple[int, int]  # size and modification time of a file, ns, at one look


def stamp_of(status: os.stat_result) -> FileStamp:
    """The stamp of a file, from the system's answer."""
    return status.st_size, status.st_mtime_ns


def stamp_if_there(path: Path) -> FileStamp | None:
    """The stamp of a file; None if it cannot be looked at."""
    try:
        return stamp_of(path.stat())
    except OSError:
        return None


def picture_key(path: str, stamp: FileStamp) -> str:
    """The key of a picture that a part was read from: the store keeps it, so that no other part is read from it."""
    return f"watch {stamp[0]} {stamp[1]} {path}"
