"""The list of parts that could not be read: a manifest, so that corrected parts can be read by naming it as input."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from pipeline.common.output_paths import write_table
from pipeline.formats.manifest import COLUMNS, SEVERAL
from pipeline.formats.part_files import PartFiles, absolute
from pipeline.runs.journal import writing

_COLUMNS = (*COLUMNS, "problem")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


def write_quarantine(path: Path, bad: Iterable[tuple[PartFiles, str]]) -> None:
    """Write the list of parts with their problems; without parts remove it.

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
    return [_CONTROL.sub("?", cell) for cell in cells]  # the table must have one line a part
