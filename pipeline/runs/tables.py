"""Tables of records: `.csv`, `.jsonl` or `.parquet`; all that goes to and from the disk passes through here.

    ReadingRecord --+-- Row --> CSV line    flat; a newline of a text stands within quotes, so that quotes are counted
                    +-- JSON line           lists and objects a character; ends in LF, which JSON allows within no text
                    +-- Parquet             lists and structs likewise, some hundred records at a time

A character of a JSON line or of Parquet has `char`, `probability` and `score`, its `alternatives` with the same, and
the other fields of `pipeline.common.records.CharacterRecord`.

What is not known is an empty field or null. A character that is none of UTF-8, as names of files may have one, and
NUL, at which many programs stop, are written as the words \\udcff and \\u0000; a backslash that would begin such a
word is written \\u005c. In CSV what a spreadsheet would take for a formula has an apostrophe in front. So any text
comes back as it was, and any program can open the table.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from datetime import datetime
from functools import cache
from itertools import islice
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from glyphs.atomic import check_writable, replacing
from glyphs.errors import FileError, damage_reported
from pipeline.common.parsed import json_of
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord
from pipeline.common.row import Row
from pipeline.common.spreadsheet import harmless, original

CSV_COLUMNS = tuple(f.name for f in fields(Row))
_FIRST = ("part", "text", "decision", "confidence", "source", "seconds", "error")
COLUMNS = (*_FIRST, *(f.name for f in fields(ReadingRecord) if f.name not in _FIRST))
"""Of JSON lines and Parquet."""
MOST_TEXT = 100_000
"""Characters of one text, escaped; Python's own reader of CSV takes up to 131,072."""
_GROUP_RECORDS = 500  # of Parquet; some megabytes while they are made
_ODD = re.compile(r"[\x00\ud800-\udfff]|\\(?=u(?:0000|005c|d[89a-f][0-9a-f]{2}))")
_ODD_WORD = re.compile(r"\\u(0000|005c|d[89a-f][0-9a-f]{2})")
_LINE_BREAKS = {c: f"\\u{ord(c):04x}" for c in "\x85\u2028\u2029"}  # to some readers of lines, not to JSON
_BEST = tuple(f.name for f in fields(CandidateRecord))
_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def check_output(path: Path) -> None:
    """Refuse, before the work starts, a file that could not be written at its end.

    Raises:
        FileError: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise FileError(path, "is not a table that can be written", f"end it in {', '.join(SUFFIXES)}")
    check_writable(path)


def write_records(records: Iterable[ReadingRecord], path: Path) -> None:
    """Write the records as they come; the file appears whole or not at all.

    Raises:
        FileError: unknown suffix, or it cannot be written.
        ValueError: a record that no table holds, see `plain_values`.
    """
    check_output(path)
    with replacing(path) as temporary:
        form = LINE_FORMS.get(path.suffix.lower())
        if form is None:
            write_parquet(records, temporary)
            return
        with temporary.open("wb") as stream:
            stream.write(form.head)
            stream.writelines(map(form.encode, records))


@dataclass(frozen=True, slots=True)
class LineForm:
    """How a kind of file that records can be appended to holds them.

    Attributes:
        head: what the file begins with.
        encode: a record's line; a ValueError for a record that no table holds.
        decode: the row of a line; a ValueError for what is no line of this form.
        quoted: whether a newline within double quotes ends no line.
    """

    head: bytes
    encode: Callable[[ReadingRecord], bytes]
    decode: Callable[[bytes], Row]
    quoted: bool

    def ended(self, data: bytes) -> bool:
        """Whether a line was written to its end."""
        return data.endswith(b"\n") and not (self.quoted and data.count(b'"') % 2)


# ------------------------------------------------------------------------------------------ values, by their types


def plain_values(record: ReadingRecord | Row) -> dict[str, Any]:
    """What a table holds of a record or row: texts, numbers, times, lists and dicts of them.

    Raises:
        ValueError: a number that is not finite, or a text over 100,000 characters.
    """
    names = CSV_COLUMNS if isinstance(record, Row) else COLUMNS
    values = {}
    for name in names:
        try:
            values[name] = _plain(getattr(record, name))
        except ValueError as error:
            raise ValueError(f"{name} of part {record.part[:80]!r} {error}") from None
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        kept = _ODD.sub(lambda m: f"\\u{ord(m[0]):04x}", value)
        if len(kept) > MOST_TEXT:
            raise ValueError(f"has {len(kept)} characters; a table holds {MOST_TEXT} of a text")
        return kept
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    if isinstance(value, CharacterRecord):
        best, *others = value.candidates or (CandidateRecord("", 0.0),)
        rest = {
            name: _plain(getattr(value, name)) for name in _hints(CharacterRecord) if name != "candidates"
        }
        return {**_plain(best), "alternatives": [_plain(c) for c in others], **rest}
    if is_dataclass(value):
        return {name: _plain(getattr(value, name)) for name in _hints(type(value))}
    return value


def _made(kind: Any, value: Any) -> Any:
    """A value of that type out of what a table holds of it."""
    args = get_args(kind)
    if get_origin(kind) is UnionType:
        return None if value is None or value == "" else _made(args[0], value)
    if kind is str:
        if not isinstance(value, str):
            raise ValueError(f"{value!r} is not text")
        return _ODD_WORD.sub(lambda m: chr(int(m[1], 16)), value)
    if kind is float:
        return _number(value)
    if kind is int:
        return int(_number(value))
    if kind is bool:
        if value not in (True, False, "True", "False"):
            raise ValueError(f"{value!r} is neither True nor False")
        return value in (True, "True")
    if kind is datetime:
        return value if isinstance(value, datetime) else datetime.fromisoformat(str(value))
    if get_origin(kind) is tuple:
        if not isinstance(value, (list, tuple)):
            raise ValueError(f"{value!r} is no list")
        kinds = args[:1] * len(value) if args[-1] is Ellipsis else args
        return tuple(_made(k, v) for k, v in zip(kinds, value, strict=True))
    return _of_type(kind, value)


def _of_type(kind: type[Any], values: Any) -> Any:
    if not isinstance(values, Mapping):
        raise ValueError(f"{values!r} has no fields")
    values = dict(values)
    if kind is CharacterRecord:
        best, others = {name: values.pop(name, None) for name in _BEST}, values.pop("alternatives", ())
        values["candidates"] = [best, *others] if best["char"] else []
    hints = _hints(kind)
    if values.keys() != hints.keys():
        raise ValueError(
            f"the fields are not those of a {'row' if kind in (Row, ReadingRecord) else 'character'}"
        )
    return kind(**{name: _made(hint, values[name]) for name, hint in hints.items()})


def _number(value: Any) -> float:
    if isinstance(value, bool) or value is None:
        raise ValueError(f"{value!r} is not a number")
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"is {number}; a table holds finite numbers")
    return number


# ------------------------------------------------------------------------------------------------ CSV, JSON lines


class _Echo:
    def write(self, text: str) -> str:
        return text


def _csv_line(values: Iterable[Any]) -> bytes:
    cells = [harmless(value) if isinstance(value, str) else value for value in values]
    line: Any = csv.writer(_Echo()).writerow(cells)  # gives what `write` gives
    return str(line).encode()


def _row_of_csv(data: bytes) -> Row:
    try:
        (values,) = csv.reader([data.decode()], strict=True)
    except csv.Error as error:
        raise ValueError(str(error)) from error
    if len(values) != len(CSV_COLUMNS):
        raise ValueError(f"{len(values)} fields, not {len(CSV_COLUMNS)}")
    row: Row = _made(Row, dict(zip(CSV_COLUMNS, map(original, values), strict=True)))
    return row


_dumps = json.JSONEncoder(ensure_ascii=False, allow_nan=False, default=datetime.isoformat).encode


def _json_line(record: ReadingRecord) -> bytes:
    line = _dumps(plain_values(record))
    if not line.isascii():
        for character, word in _LINE_BREAKS.items():
            line = line.replace(character, word)
    return f"{line}\n".encode()


def record_of_json(data: bytes) -> ReadingRecord:
    """The record of a JSON line.

    Raises:
        ValueError: it is none.
    """
    record: ReadingRecord = _made(ReadingRecord, json_of(data))
    return record


CSV = LineForm(
    _csv_line(CSV_COLUMNS),
    lambda record: _csv_line(plain_values(Row.of(record)).values()),
    _row_of_csv,
    quoted=True,
)
JSON_LINES = LineForm(b"", _json_line, lambda data: Row.of(record_of_json(data)), quoted=False)
LINE_FORMS = {".csv": CSV, ".jsonl": JSON_LINES}
WORKBOOK = ".xlsx"
"""Made at the end of a run, see `pipeline.runs.workbook`."""
SUFFIXES = (*LINE_FORMS, ".parquet", WORKBOOK)


# ------------------------------------------------------------------------------------------------------- Parquet


def write_parquet(records: Iterable[ReadingRecord], path: Path) -> None:
    """Write records as they come, a group at a time.

    Raises:
        OSError: it cannot be written.
    """
    import pyarrow
    import pyarrow.parquet

    hints = _hints(ReadingRecord)
    schema = pyarrow.schema([(name, _arrow(hints[name])) for name in COLUMNS])
    remaining = iter(records)
    with pyarrow.parquet.ParquetWriter(path, schema) as writer:
        while group := [plain_values(record) for record in islice(remaining, _GROUP_RECORDS)]:
            writer.write_table(pyarrow.Table.from_pylist(group, schema=schema))


def _arrow(kind: Any) -> Any:
    """The type of a column."""
    import pyarrow

    args = get_args(kind)
    if get_origin(kind) is UnionType:
        return _arrow(args[0])
    if get_origin(kind) is tuple:
        return pyarrow.list_(_arrow(args[0]))
    if is_dataclass(kind):
        named = dict(_hints(kind))
        if kind is CharacterRecord:
            candidates = named.pop("candidates")
            named = {**_hints(CandidateRecord), "alternatives": candidates, **named}
        return pyarrow.struct([(name, _arrow(hint)) for name, hint in named.items()])
    plain: dict[Any, Any] = {
        str: pyarrow.string(),
        bool: pyarrow.bool_(),
        float: pyarrow.float64(),
        int: pyarrow.int64(),
        datetime: pyarrow.timestamp("us", tz="UTC"),
    }
    return plain[kind]


def parquet_records(path: Path) -> Iterator[ReadingRecord]:
    """The records of a Parquet file, a group in memory at a time.

    Raises:
        FileError: the file is damaged or none of records.
    """
    with damage_reported(path, kind="Parquet"):
        import pyarrow.parquet

        with pyarrow.parquet.ParquetFile(path) as file:
            if tuple(file.schema_arrow.names) != COLUMNS:
                raise FileError(path, "has not the columns of this version", "name another file")
            for batch in file.iter_batches(batch_size=_GROUP_RECORDS):
                for values in batch.to_pylist():
                    yield _made(ReadingRecord, values)
