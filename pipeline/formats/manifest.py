"""Tables of parts: their files and expected texts.

part,height_map,scan,photo,expected,format,font
A1,maps/A1.npz,,photos/A1.png,KB74,AA99,block          relative to the table
A2,s3://lots/7/A2.npz
A3,,,A3.light-1.png | A3.light-2.png                    several photographs of one part

A table without headings has a column of files, and optionally one of names before it and one of expected texts after.
"""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

from glyphs.errors import MarksError
from pipeline.common.names import HiddenCharacterError, clean_name, folded
from pipeline.errors import DataError, is_url, reading
from pipeline.formats.part_files import (
    PartFiles,
    beside,
    key_and_kind,
    local_name,
    split_name,
    with_unique_names,
)
from pipeline.formats.remote import local_copy
from pipeline.formats.table_file import (
    PART_HEADINGS,
    TEXT_HEADINGS,
    TableLine,
    check_serial,
    column_of,
    heading,
    table_lines,
)

COLUMNS = ("part", "height_map", "scan", "photo", "expected", "format", "font")
FILES = COLUMNS[1:4]
# of this program's own tables, with names similar to these
_OTHERS = ("height_mm", "height_px")
# between the files of one cell
SEVERAL = "|"
_CLOSE = 0.8
_MAX_BYTES = 2_000_000_000
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")
_DRIVE = re.compile(r"[A-Za-z]:|\\\\[^\\]+")


def is_manifest(name: str) -> bool:
    """Whether a path or URL names a table of parts, not a folder or a table of heights."""
    suffix = os.path.splitext(split_name(name)[1])[1].lower()
    if suffix not in (".csv", ".xlsx") or os.path.isdir(name):
        return False
    from pipeline.formats.text_maps import is_number_table  # slow, and few inputs are tables

    return not is_number_table(Path(name))


def names_no_files(name: str) -> bool:
    """Whether a local table lists texts of parts but no files, as a table of truths or of readings does."""
    path = Path(name)
    if path.suffix.lower() not in (".csv", ".xlsx") or not path.is_file():
        return False
    try:
        head = next(iter(table_lines(path)), None)
    except MarksError:
        return False  # reported when it is read
    return head is not None and (
        column_of(head.cells, PART_HEADINGS) is not None
        and column_of(head.cells, TEXT_HEADINGS) is not None
        and column_of(head.cells, FILES) is None
    )


def read_manifest(source: str) -> Sequence[PartFiles]:
    """The parts of a table, see `table_lines`, from its path or URL.

    File names are relative to the table. A part without a name takes that of its first file, with as much of the folder
    as makes it unique. Other columns and empty lines are ignored. Raises FileError: it cannot be read, has no column of
    files, or a line is incomplete, names no file or repeats a part. MissingExtraError: a library for URLs is missing.
    """
    source = source if is_url(local_name(source)) else str(Path(local_name(source)))
    parts: list[PartFiles] = []
    seen: dict[str, int] = {}
    copy = (
        local_copy(source, most_bytes=_MAX_BYTES) if is_url(source) else contextlib.nullcontext(Path(source))
    )
    with copy as path, reading(path, most_bytes=_MAX_BYTES):
        for number, cells in _records(path):
            part = _part_of(source, f"line {number}", cells)
            folder, last = split_name(part.files[0])
            # no name begins with a NUL
            key = folded(part.name) if cells.get("part") else f"\0{folder}/{os.path.splitext(last)[0]}"
            if (first := seen.setdefault(key, number)) != number:
                again = f"line {number} names {part.name} a second time, after line {first}"
                raise DataError(again, "give every part one line")
            parts.append(part)
        if not parts:
            raise DataError("holds no part", "give a line for each part")
    return with_unique_names(parts)


def _part_of(source: str, where: str, cells: Mapping[str, str]) -> PartFiles:
    if _CONTROL.search("".join(cells.values())):
        column = next(column for column, cell in cells.items() if _CONTROL.search(cell))
        raise DataError(f"{where} has a line break or control character under {column}", "check its quotes")
    try:
        part_name = clean_name(cells.get("part", ""))
    except HiddenCharacterError as error:
        raise DataError(f"{where}: {error.what}", error.hint) from error
    photos = [name.strip() for name in cells.get("photo", "").split(SEVERAL) if name.strip()]
    named = [*(cells.get(kind, "") for kind in FILES[:2]), *photos]
    height_map, scan, *photos = (_place(source, where, name) for name in named)
    lasts = [split_name(file)[1] for file in (height_map, scan, *photos) if file]
    if not lasts:
        raise DataError(f"{where} names no file", f"fill one of {', '.join(FILES)}")
    if not all(lasts):
        raise DataError(f"{where} names a folder", "name a file")
    return PartFiles(
        part_name or os.path.splitext(lasts[0])[0],
        height_map=height_map,
        scan=scan,
        photos=tuple(photos),
        expected=cells.get("expected", ""),
        format=sys.intern(cells.get("format", "")),
        font=sys.intern(cells.get("font", "")),
    )


def _place(source: str, where: str, name: str) -> str:
    if "\\" in name and os.sep == "/" and not is_url(name) and not os.path.exists(beside(source, name)):
        if drive := _DRIVE.match(name):
            what = f"{where} names {name}, and this system has no drive {drive[0]}"
            raise DataError(what, "give file names relative to the table")
        name = name.replace("\\", "/")
    return beside(source, name) if name else ""


def _columns(header: Sequence[str]) -> dict[str, int]:
    columns: dict[str, int] = {}
    for place, title in enumerate(header):
        name = title.strip().lower()
        if name in columns:
            raise DataError(f"has two columns {name}", "keep one")
        if name in COLUMNS:
            columns[name] = place
        elif name not in _OTHERS:
            for close in difflib.get_close_matches(heading(name), COLUMNS, n=1, cutoff=_CLOSE):
                what = f"has a column {title.strip()!r}, and the columns are {', '.join(COLUMNS)}"
                raise DataError(what, f"rename it to {close} if that is meant, or to something else")
    if not any(column in columns for column in FILES):
        named = ", ".join(h.strip() for h in header)[:200] or "none"
        raise DataError(f"has the columns {named}", f"its first line must name one of {', '.join(FILES)}")
    return columns


def _records(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    lines = table_lines(path)
    head = next(lines, TableLine(1, ()))
    columns = _columns_of_files(head.cells)
    width = len(head.cells)
    if columns is None:
        columns = _columns(head.cells)
    else:
        lines = chain((head,), lines)
    for line in lines:
        if any(line.cells[width:]):
            what = f"line {line.number} has more fields than the first line"
            raise DataError(what, "quote cells with the delimiter")
        if "expected" in columns:
            check_serial(line.number, line.cell(columns["expected"]))
        yield line.number, {name: line.cell(place) for name, place in columns.items()}


def _columns_of_files(cells: Sequence[str]) -> dict[str, int] | None:
    kinds = {place: kind for place, cell in enumerate(cells) if (kind := key_and_kind(cell)[1])}
    if column_of(cells, COLUMNS) is not None or len(kinds) != 1:
        return None
    ((place, kind),) = kinds.items()
    if place > 1 or len(cells) > place + 2:
        return None
    expected = {"expected": place + 1} if len(cells) > place + 1 else {}
    return {kind: place, **({"part": 0} if place else {}), **expected}
