"""The list of parts that could not be read: a manifest, so that what was mended is read by naming it as input."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

from glyphs.errors import FileError
from pipeline.formats.manifest import COLUMNS, FILES
from pipeline.formats.part_files import PartFiles, absolute
from pipeline.runs.journal import GrowingFile, cannot_be_written, set_aside
from pipeline.runs.tables import csv_line

_HEAD = ",".join((*COLUMNS, "problem")).encode() + b"\n"
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


class Quarantine:
    """The parts that could not be read, as a manifest of its own: what was mended is read by naming it as input.

    Attributes:
        path: the CSV; there from the first bad part on.
    """

    def __init__(self, path: Path, *, keep: bool = False) -> None:
        """Begin the list.

        Args:
            path: of the CSV.
            keep: whether a list that is there is of this run, which adds all its parts again; else it is moved to
                the same name with a ~.

        Raises:
            FileError: what is there is no such list, or cannot be moved or read.
        """
        self.path = path
        self._growing: GrowingFile | None = None
        self._names: set[str] = set()
        with self._writing():
            head = b""
            with contextlib.suppress(FileNotFoundError), path.open("rb") as stream:
                head = stream.read(len(_HEAD))
            if not _HEAD.startswith(head):
                raise FileError(path, "is not a list of bad parts", "name another file for it")
            if keep:
                path.unlink(missing_ok=True)
            else:
                set_aside(path, head=_HEAD)

    def add(self, listed: PartFiles, problem: str) -> None:
        """Append a part, once; it is the kernel's before this returns.

        Raises:
            FileError: it cannot be written.
        """
        name = _one_line(listed.name).strip()
        if name in self._names:
            return
        files = {column: absolute(getattr(listed, column)) for column in FILES}
        if not listed.files and listed.problem is not None:
            files["height_map"] = absolute(str(listed.problem.path))
        about = (listed.expected, listed.format, listed.font, problem)
        line = csv_line([name, *(_one_line(cell) for cell in (*files.values(), *about))], end="\n")
        with self._writing():
            if self._growing is None:
                self._growing = GrowingFile(self.path)
                line = _HEAD + line
            self._growing.append(line)
        self._names.add(name)

    def close(self) -> None:
        """Bring it to the disk."""
        if self._growing is not None:
            with self._writing(), self._growing:
                os.fsync(self._growing.fileno())

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise cannot_be_written(self.path, error) from error


def _one_line(cell: str) -> str:
    """A cell that the next reader of the table takes: one line, and UTF-8."""
    return _CONTROL.sub("?", cell).encode("utf-8", "backslashreplace").decode()
