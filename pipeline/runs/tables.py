"""Tables of records: `.csv` (flat rows), `.jsonl`, `.parquet` and `.xlsx`, with an object for each character.

A character has `char`, `probability` and `score`, its `alternatives` with the same, and the other fields of
`CharacterRecord`. Lone surrogates and NUL are written as escapes such as \\udcff and \\u0000; a backslash that would
begin one is written \\u005c.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass
from datetime import datetime
from itertools import islice
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from glyphs.atomic import replacing
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord, to_json
from pipeline.common.row import row_of
from pipeline.common.texts import CSV_BEGIN, csv_line

CSV_COLUMNS = tuple(row_of(ReadingRecord.failed("", "")))
_FIRST = ("part", "text", "decision", "confidence", "source", "seconds", "error")
COLUMNS = (*_FIRST, *(f.name for f in fields(ReadingRecord) if f.name not in _FIRST))
"""Columns of JSON lines and Parquet."""
MOST_TEXT = 100_000  # characters of one escaped text; Python's own CSV reader takes up to 131,072
_INFINITE = (math.inf, -math.inf)
_GROUP_RECORDS = 500  # rows of a Parquet group, some megabytes in memory
_ODD = re.compile(r"[\x00\ud800-\udfff]|\\(?=u(?:0000|005c|d[89a-f][0-9a-f]{2}))")
# line breaks for some programs, though not in JSON
_LINE_BREAKS = {ord(c): f"\\u{ord(c):04x}" for c in "\x85\u2028\u2029"}
_dumps = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
_NO_CANDIDATE = {f.name: f.default for f in fields(CandidateRecord)} | {"char": "", "probability": 0.0}


@dataclass(frozen=True, slots=True)
class LineForm:
    """A kind of table that takes more lines; `encode` raises ValueError for a record that no table can hold."""

    head: bytes
    encode: Callable[[ReadingRecord], bytes]


def write_table(lines: Iterable[bytes], path: Path) -> None:
    """Write a table from its lines; the file appears whole or not at all. Raises FileError: it cannot be written."""
    with replacing(path) as temporary:
        if not grows(path):
            _write_parquet(lines, temporary)
            return
        with temporary.open("wb") as stream:
            stream.write(form_of(path).head)
            stream.writelines(lines)


def grows(path: Path) -> bool:
    """Whether lines can be appended to a table."""
    return path.suffix.lower() in LINE_FORMS


def form_of(path: Path) -> LineForm:
    """Form of a table's lines, or of the lines from which it is made."""
    return LINE_FORMS.get(path.suffix.lower(), LINE_FORMS[".jsonl"])


def _csv_line(record: ReadingRecord) -> str:
    cells = list(row_of(record).values())
    line = csv_line(cells)
    odd = (
        len(line) > MOST_TEXT or _ODD.search(line) or any(cell != cell or cell in _INFINITE for cell in cells)
    )
    return csv_line(csv_cells(record)) if odd else line


def csv_cells(record: ReadingRecord) -> list[Any]:
    """The cells of a record's row. Raises ValueError: a number that is not finite, or a text that is too long."""
    return [_fitting(cell, record.part) for cell in row_of(record).values()]


def _fitting(value: Any, part: str) -> Any:
    if isinstance(value, str):
        text = _ODD.sub(lambda m: f"\\u{ord(m[0]):04x}", value) if _ODD.search(value) else value
        if len(text) > MOST_TEXT:
            raise ValueError(
                f"part {part[:80]!r} has a text of {len(text)} characters; a table holds {MOST_TEXT}"
            )
        return text
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"part {part[:80]!r} has the number {value}; a table holds finite ones")
    if isinstance(value, list):
        return [_fitting(v, part) for v in value]
    if isinstance(value, dict):
        return {name: _fitting(v, part) for name, v in value.items()}
    return value


def _json_line(record: ReadingRecord) -> bytes:
    whole = to_json(record)
    values = {name: whole[name] for name in COLUMNS}
    values["characters"] = [_flat(place) for place in values["characters"]]
    line = _dumps(values)
    if len(line) > MOST_TEXT or _ODD.search(line):
        line = _dumps(_fitting(values, record.part))
    return f"{line.translate(_LINE_BREAKS)}\n".encode()


def _flat(place: dict[str, Any]) -> dict[str, Any]:
    best, *others = place.pop("candidates") or (_NO_CANDIDATE,)
    return {**best, "alternatives": others, **place}


LINE_FORMS = {
    ".csv": LineForm(
        f"{CSV_BEGIN}{csv_line(CSV_COLUMNS)}".encode(), lambda record: _csv_line(record).encode()
    ),
    ".jsonl": LineForm(b"", _json_line),
}
WORKBOOK = ".xlsx"  # made at the end of a run; see `pipeline.runs.workbook`
SUFFIXES = (*LINE_FORMS, ".parquet", WORKBOOK)


def _write_parquet(lines: Iterable[bytes], path: Path) -> None:
    import pyarrow.json
    import pyarrow.parquet

    hints = get_type_hints(ReadingRecord)
    schema = pyarrow.schema([(name, _arrow(hints[name])) for name in COLUMNS])
    parsing = pyarrow.json.ParseOptions(explicit_schema=schema)
    remaining = iter(lines)
    with pyarrow.parquet.ParquetWriter(path, schema) as writer:
        while group := b"".join(islice(remaining, _GROUP_RECORDS)):
            reading = pyarrow.json.ReadOptions(block_size=len(group))
            writer.write_table(pyarrow.json.read_json(io.BytesIO(group), reading, parsing))


def _arrow(kind: Any) -> Any:
    import pyarrow

    if get_origin(kind) is UnionType:
        return _arrow(get_args(kind)[0])
    if get_origin(kind) is tuple:
        return pyarrow.list_(_arrow(get_args(kind)[0]))
    if is_dataclass(kind):
        named = get_type_hints(kind)
        if kind is CharacterRecord:
            candidates = named.pop("candidates")
            named = {**get_type_hints(CandidateRecord), "alternatives": candidates, **named}
        return pyarrow.struct([(name, _arrow(hint)) for name, hint in named.items()])
    if kind is datetime:
        return pyarrow.timestamp("us", tz="UTC")
    return pyarrow.from_numpy_dtype({str: "U", bool: "bool", float: "f8", int: "i8"}[kind])
