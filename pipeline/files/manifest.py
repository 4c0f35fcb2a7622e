"""Tables of parts: which files are whose, and what the parts should read.

part,height_map,scan,photo,expected,format,font
A1,maps/A1.npz,,photos/A1.png,KB74,AA99,block          relative to the table
A2,s3://lots/7/A2.npz
A3,,,A3.light-1.png | A3.light-2.png                    several photographs of one part
"""

from __future__ import annotations

import contextlib
import csv
import difflib
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from glyphs.errors import FileError, require_file
from pipeline.common.spreadsheet import original
from pipeline.files.listed import ListedPart, beside, is_url, local_name, problem_of, split_name
from pipeline.files.parts import named_apart
from pipeline.files.remote import copied

COLUMNS = ("part", "height_map", "scan", "photo", "expected", "format", "font")
FILES = COLUMNS[1:4]
"""Those of files."""
_OTHERS = ("height_mm", "height_px")
"""Columns of this program's own tables that are spelled much like one of these, and are none."""
_SEVERAL = "|"
"""Between files of one cell."""
_CLOSE = 0.8
_DELIMITERS = ",;\t"
_MAX_BYTES = 2_000_000_000
_BATCH_ROWS = 8192
_MOST_HEAD = 100_000
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


def is_manifest(name: str) -> bool:
    """Whether a path or URL ends as a table of parts does."""
    return split_name(name)[1].lower().endswith((".csv", ".parquet"))


def speaks_of_no_files(name: str) -> bool:
    """Whether a CSV on this machine is of what parts bear, as a truth or a table of rows is, and of no files."""
    path = Path(name)
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
        head = {cell.strip().strip('"').lower() for cell in re.split(r"[,;\t]", stream.readline(_MOST_HEAD))}
    return {"part", "text"} <= head and head.isdisjoint(FILES)


def read_manifest(source: str) -> list[ListedPart]:
    """The parts of a table: CSV (UTF-8; comma, semicolon or tab) unless it ends in .parquet.

    A file that is named relatively lies beside the table. A part without a name is called as the first of its
    files, with as much of the folder as makes it unique. Other columns and empty lines are passed over.

    Args:
        source: path or URL of the table.

    Raises:
        FileError: it cannot be read, has no column of files or one that may be misspelled, or a line without a
            file, with a part spoken of before, or not complete; says which line.
        MissingExtraError: a library that URLs need is not installed.
    """
    source = source if is_url(local_name(source)) else str(Path(local_name(source)))
    records = _parquet_records if split_name(source)[1].lower().endswith(".parquet") else _csv_records
    parts: list[ListedPart] = []
    seen: dict[str | tuple[str, str], str] = {}
    with _on_this_machine(source) as path:
        for where, cells in records(source, path):
            part = _part_of(source, where, cells)
            folder, last = split_name(part.files[0])
            key = part.name if cells.get("part") else (folder, os.path.splitext(last)[0])
            if key in seen:
                raise problem_of(
                    source,
                    f"{where} names {part.name} a second time, after {seen[key]}",
                    "give every part one line",
                )
            seen[key] = where
            parts.append(part)
    if not parts:
        raise problem_of(source, "holds no part", "give a line for each part")
    return named_apart(parts)


@contextlib.contextmanager
def _on_this_machine(source: str) -> Iterator[Path]:
    if is_url(source):
        with copied(source, most_bytes=_MAX_BYTES) as path:
            yield path
    else:
        require_file(Path(source), most_bytes=_MAX_BYTES)
        yield Path(source)


def _part_of(source: str, where: str, cells: Mapping[str, str]) -> ListedPart:
    """One line as a part."""
    if _CONTROL.search("".join(cells.values())):
        column = next(column for column, cell in cells.items() if _CONTROL.search(cell))
        raise problem_of(
            source, f"{where} has a line break or control character under {column}", "check its quotes"
        )
    photo, *more = (name.strip() for name in cells.get("photo", "").split(_SEVERAL))
    files = {c: beside(source, name) for c in FILES if (name := photo if c == "photo" else cells.get(c))}
    more_photos = tuple(beside(source, name) for name in more)
    lasts = [split_name(file)[1] for file in (*files.values(), *more_photos)]
    if not lasts:
        raise problem_of(source, f"{where} names no file", f"fill one of {', '.join(FILES)}")
    if not all(lasts):
        raise problem_of(source, f"{where} names a folder", "name a file")
    return ListedPart(
        cells.get("part") or os.path.splitext(lasts[0])[0],
        height_map=files.get("height_map", ""),
        scan=files.get("scan", ""),
        photo=files.get("photo", ""),
        more_photos=more_photos,
        expected=cells.get("expected", ""),
        format=sys.intern(cells.get("format", "")),
        font=sys.intern(cells.get("font", "")),
    )


def _columns(source: str, header: Sequence[str]) -> dict[str, int]:
    """Where each known column stands."""
    found: dict[str, int] = {}
    for place, heading in enumerate(header):
        name = heading.strip().lower()
        if name in found:
            raise problem_of(source, f"has two columns {name}", "keep one")
        if name in COLUMNS:
            found[name] = place
        elif name not in _OTHERS:
            spelled = re.sub(r"[\s.-]+", "_", name)
            for close in difflib.get_close_matches(spelled, COLUMNS, n=1, cutoff=_CLOSE):
                raise problem_of(
                    source,
                    f"has a column {heading.strip()!r}, which is none of {', '.join(COLUMNS)}",
                    f"call it {close} if that is meant, or something quite different",
                )
    if not any(column in found for column in FILES):
        named = ", ".join(h.strip() for h in header)[:200] or "none"
        raise problem_of(
            source, f"has the columns {named}", f"its first line must name one of {', '.join(FILES)}"
        )
    return found


def _csv_records(source: str, path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Where each line of a CSV stands, and its known cells."""
    number = 1
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            first = next((line for line in iter(lambda: stream.readline(_MOST_HEAD), "") if line.strip()), "")
            delimiter = max(_DELIMITERS, key=first.count)
            stream.seek(0)
            # strict, for else one quote too many silently swallows the lines after it
            reader = csv.reader(stream, delimiter=delimiter, skipinitialspace=True, strict=True)
            header = next((row for row in reader if any(cell.strip() for cell in row)), [])
            columns = _columns(source, header)
            for row in reader:
                number = reader.line_num
                if not any(cell.strip() for cell in row):
                    continue
                if any(cell.strip() for cell in row[len(header) :]):
                    raise problem_of(
                        source,
                        f"line {number} has more fields than the first line",
                        "quote what holds commas",
                    )
                yield (
                    f"line {number}",
                    {name: original(_cell(row[at])) for name, at in columns.items() if at < len(row)},
                )
    except UnicodeDecodeError as error:
        raise problem_of(source, "is not UTF-8 text", "save it as CSV (UTF-8)") from error
    except csv.Error as error:
        raise problem_of(
            source,
            f"is not a CSV table after line {number} ({error})",
            "check its quotes, save it as CSV (UTF-8)",
        ) from error


def _cell(value: object) -> str:
    return "" if value is None else str(value).strip()


def _parquet_records(source: str, path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Where each row of a Parquet file stands, and its known cells; a batch of rows is in memory at a time."""
    from pyarrow import parquet

    def in_words(error: Exception) -> FileError:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        return problem_of(source, f"is damaged or not a Parquet file ({reason})", "copy it or make it again")

    try:  # around the parser alone: what the user of this generator trips over is no damage
        file = parquet.ParquetFile(path)
        schema = file.schema_arrow
    except Exception as error:
        raise in_words(error) from error
    with contextlib.closing(file):
        columns = _columns(source, schema.names)
        for name, at in columns.items():
            if not _is_text(schema.field(at).type, name):
                raise problem_of(
                    source, f"has the column {name} of type {schema.field(at).type}", "save it as text"
                )
        names = {name: schema.names[at] for name, at in columns.items()}
        batches = file.iter_batches(batch_size=_BATCH_ROWS, columns=list(names.values()))
        number = 0
        while True:
            try:
                batch = next(batches, None)
                values = {} if batch is None else {n: batch.column(s).to_pylist() for n, s in names.items()}
            except Exception as error:
                raise in_words(error) from error
            if batch is None:
                return
            for row in zip(*values.values(), strict=True):
                number += 1
                cells = {name: _cell(value) for name, value in zip(values, row, strict=True)}
                if any(cells.values()):
                    yield f"row {number}", cells


def _is_text(kind: Any, name: str) -> bool:
    from pyarrow import types

    if types.is_dictionary(kind):
        kind = kind.value_type
    text = types.is_string(kind) or types.is_large_string(kind) or types.is_string_view(kind)
    return bool(text or types.is_null(kind) or (name == "part" and types.is_integer(kind)))
