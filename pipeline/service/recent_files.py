"""The files of a folder by name, and which of them were there a moment ago."""

from __future__ import annotations

import time
from pathlib import Path

import structlog

from glyphs.plain_text import visible

MOST_AWAY_S = 3600.0
"""Seconds for which a file that is gone may come back: a disk that is mounted anew, a file that is put back. After
that its removal counts as meant."""
log = structlog.get_logger("tactile-marks")


class RecentFiles:
    """The files of one folder with one suffix; hidden ones do not count."""

    def __init__(self, folder: Path, suffix: str) -> None:
        self._folder, self._suffix = folder, suffix
        self._seen_s: dict[str, float] = {}
        self._left: set[str] = set()

    def files(self) -> dict[str, Path]:
        """The files that are there now, by stem; one whose name is no text is logged once and left out."""
        found = {}
        try:
            for path in sorted(self._folder.glob(f"[!.]*{self._suffix}")):
                if not is_text(path.name):
                    if path.name not in self._left:
                        log.warning("file left", file=visible(path.name), why=NO_TEXT)
                    self._left.add(path.name)
                elif path.is_file():
                    found[path.stem] = path
        except OSError as error:
            log.warning("folder cannot be looked at", folder=str(self._folder), why=str(error))
        self._seen_s |= dict.fromkeys(found, time.monotonic())
        return found

    def forget(self, name: str) -> None:
        """Forget a file that was taken away on purpose."""
        self._seen_s.pop(name, None)

    def is_away(self, name: str, *, for_ever: bool = False) -> bool:
        """Whether a file that is not there now was there within `MOST_AWAY_S`, or ever."""
        seen_s = self._seen_s.get(name)
        return seen_s is not None and (for_ever or time.monotonic() - seen_s < MOST_AWAY_S)


NO_TEXT = "its name is not UTF-8 text; rename it"


def is_text(name: str) -> bool:
    """Whether a file's name can be written down: one that is not UTF-8 holds half surrogates."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True
