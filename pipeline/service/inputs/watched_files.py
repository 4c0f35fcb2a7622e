"""The files of a watched folder: how they stand at every look, which belong together, and what became of each.

    look --> new or changed --> next look --> unchanged: complete --> a part's files, the oldest part first
                                         \\-> changed: looked at again

* A file is known by its name, length and time: one that is written over is another photograph.
* It is complete when two looks find the same length and time: one that is moved in, at its second.
* Photographs of one part under several lights (part.light-1.png, part.light-2.png) are a set. A set is complete when
  all its files are, and there are as many as expected, or none was added or changed for a while. One that is added
  later makes it another set, which is read anew.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import structlog

from glyphs.errors import FileError
from pipeline.formats.part_files import set_of
from pipeline.runs.journal import Journal

log = structlog.get_logger("tactile-marks")
# Files that have left the folder, beyond as many as lie there, at which the journal forgets them.
_SPARE = 1000


@dataclass(frozen=True)
class FileState:
    """Size and modification time of a file, ns, at one look."""

    n_bytes: int
    mtime_ns: int

    @classmethod
    def of(cls, status: os.stat_result) -> FileState:
        """Take it from the system's answer."""
        return cls(status.st_size, status.st_mtime_ns)


@dataclass(frozen=True)
class Handled:
    """What became of the files of a part.

    Attributes:
        files: size and time of each file when it was handled, by path.
        part_id: id of the part; empty if none of its files can be used.
        problem: why files cannot be used, a line each.
    """

    files: Mapping[str, FileState]
    part_id: str = ""
    problem: str = ""


class WatchJournal(Journal[Handled]):
    """The parts of a watched folder, by the keys of their files."""

    kind: ClassVar[str] = "watched folder"
    version: ClassVar[int] = 3
    keeps: ClassVar[Any] = Handled

    def keep_all(self, kept: Mapping[str, Handled], *, again: bool = False) -> Mapping[str, Handled]:
        """Keep what became of parts; what cannot be written is remembered until the service ends."""
        try:
            return super().keep_all(kept, again=again)
        except FileError as error:
            log.error("watched files not written down", why=str(error))
            self.done.update(kept)
            return kept


@dataclass(frozen=True)
class WatchedPart:
    """The photographs of one part.

    Attributes:
        name: of the part: the file's stem, or the set's.
        files: size and time of each file, by path.
    """

    name: str
    files: Mapping[str, FileState]

    @property
    def key(self) -> str:
        """Identity of the same files, as they stood."""
        states = (f"{path}:{state.n_bytes}:{state.mtime_ns}" for path, state in self.files.items())
        return "watch:" + "|".join(states)


class FolderLooks:
    """Looks at a folder again and again.

    Attributes:
        took_s: the last look.
    """

    def __init__(self, folder: Path, journal: WatchJournal, *, a_set: int, settle_s: float) -> None:
        """Take the folder.

        Args:
            folder: to look at; folders in it are not looked into.
            journal: its parts so far.
            a_set: photographs of a set; 0 if unknown.
            settle_s: without a new or changed file, after which a set is complete, however many it has.
        """
        self.folder, self.took_s = folder, 0.0
        self._journal, self._a_set, self._settle_s = journal, a_set, settle_s
        # each file or set as it stood at the last look, and since when it has stood so
        self._seen: dict[str, tuple[dict[str, FileState], float]] = {}
        self._gone = False

    def complete(self) -> list[WatchedPart]:
        """Parts whose files are new and stand as at the last look, the oldest first."""
        began = time.monotonic()
        now = self._files()
        self.took_s = time.monotonic() - began
        if now is None:
            return []
        known = {path: state for one in self._journal.done.values() for path, state in one.files.items()}
        groups: dict[str, dict[str, FileState]] = {}
        for path, state in sorted(now.items()):
            groups.setdefault(set_of(path) or path, {})[path] = state
        before, self._seen, found = self._seen, {}, []
        for name, files in groups.items():
            stood, since_s = before.get(name, ({}, began))
            self._seen[name] = files, since_s if stood == files else began
            still = stood == files and all(state.n_bytes for state in files.values())
            whole = name in now or len(files) == self._a_set or began - since_s >= self._settle_s
            if still and whole and not files.items() <= known.items():
                stem = Path(name).stem if name in now else name
                found.append(WatchedPart(stem, files))
        # an empty folder may be a drive that is away
        if now and len(known) > 2 * len(now) + _SPARE:
            there = [key for key, one in self._journal.done.items() if not now.keys().isdisjoint(one.files)]
            try:
                self._journal.keep_only(there)
            except FileError as error:
                log.error("journal of the watched folder not shortened", why=str(error))
        return sorted(found, key=lambda one: (min(s.mtime_ns for s in one.files.values()), one.name))

    def _files(self) -> dict[str, FileState] | None:
        """The files that lie there; None if the folder is away.

        Hidden ones, which programs write before they rename them, do not count.
        """
        found = {}
        try:
            with os.scandir(self.folder) as entries:
                for entry in entries:
                    # taken away meanwhile, or of a share that cannot tell now: it is looked at again
                    with contextlib.suppress(OSError):
                        if not entry.name.startswith(".") and not entry.is_dir(follow_symlinks=False):
                            found[entry.path] = FileState.of(entry.stat(follow_symlinks=False))
        except OSError as error:
            if not self._gone:
                log.warning("watched folder cannot be looked at", folder=str(self.folder), why=error.strerror)
            self._gone = True
            return None
        if self._gone:
            log.info("watched folder is back", folder=str(self.folder))
        self._gone = False
        return found
