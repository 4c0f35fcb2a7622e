"""The list of parts that could not be read: a manifest, so that what was mended is read by naming it as input."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable
from pathlib import Path

from glyphs.errors import FileError
from pipeline.common.output_paths import write_table
from pipeline.formats.manifest import COLUMNS, SEVERAL
from pipeline.formats.part_files import PartFiles, absolute
from pipeline.runs.journal import set_aside, writing

_COLUMNS = (*COLUMNS, "problem")
_HEAD = ",".join(_COLUMNS).encode()
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


def begin_quarantine(path: Path, *, resumed: bool) -> None:
    """Make room for the list of a run; a list of an earlier run is moved to the same name with a ~.

    Args:
        path: of the CSV.
        resumed: a list that is there is of this run, which writes it anew.

    Raises:
        FileError: what is there is no such list, or cannot be moved or read.
    """
    with writing(path):
        head = b""
        with contextlib.suppress(FileNotFoundError), path.open("rb") as stream:
            head = stream.read(len(_HEAD))
        if not _HEAD.startswith(head):
            raise FileError(path, "is not a list of bad parts", "name another file for it")
        if not resumed:
            set_aside(path, head=_HEAD + b"\r\n")


def write_quarantine(path: Path, bad: Iterable[tuple[PartFiles, str]]) -> None:
    """Write the list of parts with their problems; without any there is no list.

    Raises:
        FileError: it cannot be written.
    """
    rows = [_cells(part, problem) for part, problem in bad]
    with writing(path):
        if rows:
            write_table(path, [_COLUMNS, *rows])
        else:
            path.unlink(missing_ok=True)


def _cells(part: PartFiles, problem: str) -> list[str]:
    height_map, scan, *photos = map(absolute, (part.height_map, part.scan, *part.photos))
    if not part.files and part.problem is not None:
        height_map = absolute(str(part.problem.path))
    files = (height_map, scan, SEVERAL.join(photos))
    cells = (part.name.strip(), *files, part.expected, part.format, part.font, problem)
    return [_CONTROL.sub("?", cell) for cell in cells]  # the next reader of the table takes one line a part
