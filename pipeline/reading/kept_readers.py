"""The readers that a worker keeps from job to job: templates take longer to make than a part to read."""

from __future__ import annotations

from pathlib import Path

from pipeline.common.settings import ReadSettings
from pipeline.reading.readers import open_reader
from recognition.reader import Reader

MOST_KEPT = 8
"""Readers of so many databases, fonts and formats at once; the one not used for longest goes."""

_Key = tuple[str, int, ReadSettings, bool]
_KEPT: dict[_Key, Reader] = {}


def reader_of(settings: ReadSettings, *, after_photo: bool = False) -> Reader:
    """The reader for these settings and their database, as the file now is.

    Args:
        settings: how to read.
        after_photo: whether a scan is of where the camera saw the line, so that regions say nothing of it.

    Raises:
        FileError: a lexicon that cannot be used.
        ValueError: a database or font that cannot be used.
    """
    key = (str(settings.database or ""), _changed_ns(settings.database), settings, after_photo)
    found = _KEPT.pop(key, None)
    if found is None:
        found = open_reader(settings)
        found = found.after_photo() if after_photo else found
        # of a database that has changed the old readers are of no more use
        for old in [k for k in _KEPT if k[0] == key[0] and k[1] != key[1]]:
            del _KEPT[old]
        while len(_KEPT) >= MOST_KEPT:
            del _KEPT[next(iter(_KEPT))]
    _KEPT[key] = found
    return found


def _changed_ns(path: Path | None) -> int:
    try:
        return path.stat().st_mtime_ns if path is not None else 0
    except OSError:
        return 0  # the readers tell what is wrong with it
