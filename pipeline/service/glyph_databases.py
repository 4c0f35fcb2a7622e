"""The glyph databases that a service offers: the files of one folder, by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.common.settings import SettingsError
from pipeline.service.recent_files import RecentFiles
from pipeline.service.web.problem import OwnProblem, Problem

SUFFIX = ".glyphs"


class GlyphDatabases:
    """Glyph databases by name; looked for whenever they are asked for, so one may be put there while it runs."""

    def __init__(self, folder: Path, *, default: Path | None = None) -> None:
        """Take the folder.

        Args:
            folder: of the files; it need not be there.
            default: database where none is asked for; None for the built-in fonts.

        Raises:
            SettingsError: there is no such default.
        """
        self.folder, self._default = folder, default
        self._recent = RecentFiles(folder, SUFFIX)
        if default is not None and not default.is_file():
            raise SettingsError(
                f"there is no glyph database {default}", hint="make it with enroll, or name another"
            )

    def path(self, name: str) -> Path | None:
        """The file of a database; None where none is named, and the settings of reading say which.

        Raises:
            OwnProblem: its file was there lately, and is away.
            Problem: there is none of that name.
        """
        if not name:
            return None
        files = self._recent.files()
        if name not in files:
            if self._recent.is_away(name):
                raise OwnProblem(f"the glyph database {name} was there and is not; put its file back")
            there = ", ".join(files) or "none at all"
            raise Problem(422, f"there is no glyph database {name!r}; there is {there}")
        return files[name]

    def listed(self) -> list[dict[str, Any]]:
        """Name, size and time of each, and whether it is the default."""
        found = []
        for name, path in self._recent.files().items():
            try:
                status = path.stat()
            except OSError:
                continue
            default = self._default is not None and path.absolute() == self._default.absolute()
            found.append({"name": name, "n_bytes": status.st_size, "default": default})
        return found
