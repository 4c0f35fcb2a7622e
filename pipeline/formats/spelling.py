"""Find a file whose name a table spells in another case or composes otherwise (a Mac decomposes umlauts)."""

from __future__ import annotations

import os
import unicodedata
from functools import lru_cache
from pathlib import Path

from glyphs.errors import FileError

# folders whose names are kept, so that a table of many missing files lists each folder once
_KEPT_FOLDERS = 16
_MOST_NAMED = 5


def spelled_on_disk(name: str) -> Path:
    """The path of a file as the disk spells it; as it is given where there is no such file.

    Raises:
        FileError: several files differ from the name in spelling alone.
    """
    path = Path(name)
    if os.path.lexists(path):
        return path
    found = Path(path.anchor)
    for part in path.relative_to(path.anchor).parts:
        if os.path.lexists(found / part):
            found /= part
            continue
        alike = _names(str(found), _changed_ns(found)).get(_folded(part), ())
        # another composition of the same letters goes before other letters
        same = [one for one in alike if _composed(one) == _composed(part)] or alike
        if not same:
            return path
        if len(same) > 1:
            raise FileError(
                path, f"is not there, and {' and '.join(same[:_MOST_NAMED])} are", "name one as it is spelled"
            )
        found /= same[0]
    return found


@lru_cache(maxsize=_KEPT_FOLDERS)
def _names(folder: str, changed_ns: int) -> dict[str, list[str]]:
    """The names in a folder by their folded spelling; empty of none that can be listed."""
    names: dict[str, list[str]] = {}
    try:
        for one in sorted(os.listdir(folder)):
            names.setdefault(_folded(one), []).append(one)
    except OSError:
        return {}
    return names


def _changed_ns(folder: Path) -> int:
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _folded(name: str) -> str:
    return _composed(name).casefold()
