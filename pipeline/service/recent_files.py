"""Files of a folder by name, with a memory of recent ones; used for glyph databases."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import structlog

from pipeline.common.settings import SettingsError
from pipeline.service.web.problem import OwnProblem, Problem

MOST_AWAY_S = 3600.0
"""Seconds for which a file that is gone may come back: a disk that is mounted anew, a file that is put back. After
that its removal counts as meant."""
log = structlog.get_logger("tactile-marks")


class RecentFiles:
    """The files of one folder with one suffix, without hidden ones.

    Attributes:
        folder: folder of the files.
        needed: name of one that the settings name.
    """

    def __init__(self, folder: Path, suffix: str, what: str, *, needed: str = "") -> None:
        """Take the folder.

        Args:
            folder: folder of the files; it need not exist.
            suffix: suffix of their names.
            what: one of them, in words.
            needed: name of one that the settings name: if it is away, it is expected to come back.
        """
        self.folder, self._suffix, self._what, self.needed = folder, suffix, what, needed
        self._seen_s: dict[str, float] = {}

    def files(self) -> dict[str, Path]:
        """The present files by stem, without those whose name is not text."""
        found = {}
        try:
            paths = sorted(self.folder.glob(f"[!.]*{self._suffix}"))
            found = {path.stem: path for path in paths if is_text(path.name) and path.is_file()}
        except OSError as error:
            log.warning("folder cannot be looked at", folder=str(self.folder), why=str(error))
        self._seen_s |= dict.fromkeys(found, time.monotonic())
        return found

    def find(self, name: str) -> Path:
        """The file of a name.

        Raises:
            OwnProblem: it was there lately, and is away.
            Problem: there is none.
        """
        files = self.files()
        if name in files:
            return files[name]
        seen_s = self._seen_s.get(name)
        if seen_s is not None and (name == self.needed or time.monotonic() - seen_s < MOST_AWAY_S):
            raise OwnProblem(f"the {self._what} {name} has disappeared; put {name}{self._suffix} back")
        there = ", ".join(files) or "none at all"
        raise Problem(422, f"there is no {self._what} {name[:100]!r}; there is {there}")

    def forget(self, name: str) -> None:
        """Forget a file that was deleted on purpose."""
        self._seen_s.pop(name, None)


NO_TEXT = "its name is not UTF-8 text; rename it"


FileStamp = tuple[int, int]
"""Size and modification time of a file, ns, at one look."""


def stamp_of(status: os.stat_result) -> FileStamp:
    """The stamp of a file, from the system's answer."""
    return status.st_size, status.st_mtime_ns


def is_text(name: str) -> bool:
    """Whether a file's name can be stored: one that is not UTF-8 has half surrogates."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


class GlyphDatabases(RecentFiles):
    """Glyph databases by name; looked up on every use, so that one may be added while the service runs."""

    def __init__(self, folder: Path, *, default: Path | None = None) -> None:
        """Take the folder.

        Args:
            folder: folder of the files; it need not be there.
            default: database where none is asked for; None for the built-in fonts.

        Raises:
            SettingsError: there is no such default.
        """
        super().__init__(folder, ".glyphs", "glyph database")
        self._default = default
        if default is not None and not default.is_file():
            raise SettingsError(
                f"there is no glyph database {default}", hint="make it with enroll, or name another"
            )

    def listed(self) -> list[dict[str, Any]]:
        """Name of each, and whether it is the default."""
        default = None if self._default is None else self._default.absolute()
        return [{"name": name, "default": path.absolute() == default} for name, path in self.files().items()]
