"""Tables of rows: `.csv`, `.jsonl` or `.parquet`; every row passes through here to and from the disk.

    Row --+-- CSV record   ends in CR LF; a newline of a text stands within quotes, so that quotes are counted
          +-- JSON line    ends in LF, which JSON allows within no text
          +-- Parquet      some thousand rows at a time

What is not known is an empty field or null. A character that is none of UTF-8, as names of files may have one, and
NUL, at which many programs stop, are written as the words \\udcff and \\u0000; a backslash that would begin such a
word is written \\u005c. So any text comes back as it was, and any program can open the table.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import Any

from glyphs.errors import FileError, damage_reported
from pipeline.common.atomic import check_writable, replacing
from pipeline.common.row import Row

COLUMNS = tuple(f.name for f in fields(Row))
MOST_TEXT = 100_000
"""Characters of one text, escaped; Python's own reader of CSV takes up to 131,072."""
_GROUP_ROWS = 2_000  # of Parquet; some megabytes while they are made
_ODD = re.compile(r"[\x00\ud800-\udfff]|\\(?=u(?:0000|005c|d[89a-f][0-9a-f]{2}))")
_ODD_WORD = re.compile(r"\\u(0000|005c|d[89a-f][0-9a-f]{2})")
_LINE_BREAKS = {c: f"\\u{ord(c):04x}" for c in "\x85\u2028\u2029"}  # to some readers of lines, not to JSON


def check_output(path: Path) -> None:
    """Refuse, before the work starts, a file that could not be written at its end.

    Raises:
        FileError: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise FileError(path, "is no table that can be written", f"end it in {', '.join(SUFFIXES)}")
    check_writable(path)


def write_rows(rows: Iterable[Row], path: Path) -> None:
    """Write the rows as they come; the file appears whole or not at all.

    Raises:
        FileError: unknown suffix, or it cannot be written.
        ValueError: a row that no table holds, see `kept_values`.
    """
    check_output(path)
    with replacing(path) as temporary:
        form = LINE_FORMS.get(path.suffix.lower())
        if form is None:
            write_parquet(rows, temporary)
            return
        with temporary.open("wb") as stream:
            stream.write(form.head)
            stream.writelines(map(form.encode, rows))


@dataclass(frozen=True, slots=True)
class LineForm:
    """How a kind of file that rows can be appended to holds them.

    Attributes:
        head: what the file begins with.
        encode: a row's record; a ValueError for a row that no table holds.
        decode: back again; a ValueError for what is no row.
        quoted: whether a newline within double quotes ends no record.
    """

    head: bytes
    encode: Callable[[Row], bytes]
    decode: Callable[[bytes], Row]
    quoted: bool

    def ended(self, data: bytes) -> bool:
        """Whether a record was written to its end."""
        return data.endswith(b"\n") and not (self.quoted and data.count(b'"') % 2)


# ----------------------------------------------------------------------------------------------- values of a row


def _kept_text(text: str) -> str:
    kept = _ODD.sub(lambda m: f"\\u{ord(m[0]):04x}", text)
    if len(kept) > MOST_TEXT:
        raise ValueError(f"has {len(kept)} characters; a table holds {MOST_TEXT} of a text")
    return kept


def _told_text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{value!r} is no text")
    return _ODD_WORD.sub(lambda m: chr(int(m[1], 16)), value)


def _number(value: Any) -> float:
    if isinstance(value, bool) or value is None:
        raise ValueError(f"{value!r} is no number")
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"is {number}; a table holds finite numbers")
    return number


def _number_if_any(value: Any) -> float | None:
    return None if value is None or value == "" else _number(value)


def _truth(value: Any) -> bool:
    if value not in (True, False, "True", "False"):
        raise ValueError(f"{value!r} is neither True nor False")
    return value in (True, "True")


_KIND_OF = {f.name: str(f.type) for f in fields(Row)}
_KEPT: dict[str, Callable[[Any], Any]] = {
    "str": _kept_text,
    "float": _number,
    "float | None": _number_if_any,
    "bool": _truth,
}
_TOLD = {**_KEPT, "str": _told_text}
_KEEPERS = tuple(_KEPT[kind] for kind in _KIND_OF.values())
_TELLERS = tuple(_TOLD[kind] for kind in _KIND_OF.values())
_values = attrgetter(*COLUMNS)


def kept_values(row: Row) -> list[Any]:
    """What a table holds of a row, in the order of the columns.

    Raises:
        ValueError: a number that is not finite, or a text over 100,000 characters.
    """
    values = _values(row)
    try:
        return [keep(value) for keep, value in zip(_KEEPERS, values, strict=True)]
    except ValueError:
        for column, keep, value in zip(COLUMNS, _KEEPERS, values, strict=True):
            try:
                keep(value)
            except ValueError as error:
                raise ValueError(f"{column} of part {row.part[:80]!r} {error}") from None
        raise


def row_of_values(values: Iterable[Any]) -> Row:
    """The row again.

    Raises:
        ValueError: these are not the values of a row.
    """
    return Row(*[tell(value) for tell, value in zip(_TELLERS, values, strict=True)])


# ------------------------------------------------------------------------------------------------ CSV, JSON lines


class _Echo:
    def write(self, text: str) -> str:
        return text


def _csv_record(values: Iterable[Any]) -> bytes:
    line: Any = csv.writer(_Echo()).writerow(values)  # gives what `write` gives
    return str(line).encode()


def _row_of_csv(data: bytes) -> Row:
    try:
        (values,) = csv.reader([data.decode()], strict=True)
    except csv.Error as error:
        raise ValueError(str(error)) from error
    if len(values) != len(COLUMNS):
        raise ValueError(f"{len(values)} fields, not {len(COLUMNS)}")
    return row_of_values(values)


_dumps = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode


def _json_line(row: Row) -> bytes:
    line = _dumps(dict(zip(COLUMNS, kept_values(row), strict=True)))
    if not line.isascii():
        for character, word in _LINE_BREAKS.items():
            line = line.replace(character, word)
    return f"{line}\n".encode()


def _row_of_json(data: bytes) -> Row:
    values = json.loads(data)
    if not isinstance(values, dict) or values.keys() != _KIND_OF.keys():
        raise ValueError("the fields are not those of a row")
    return row_of_values(map(values.__getitem__, COLUMNS))


CSV = LineForm(_csv_record(COLUMNS), lambda row: _csv_record(kept_values(row)), _row_of_csv, quoted=True)
JSON_LINES = LineForm(b"", _json_line, _row_of_json, quoted=False)
LINE_FORMS = {".csv": CSV, ".jsonl": JSON_LINES}
SUFFIXES = (*LINE_FORMS, ".parquet")


# ------------------------------------------------------------------------------------------------------- Parquet


def write_parquet(rows: Iterable[Row], path: Path) -> None:
    """Write rows as they come, a group at a time.

    Raises:
        OSError: it cannot be written.
    """
    import pyarrow
    import pyarrow.parquet

    types = {"str": pyarrow.string(), "bool": pyarrow.bool_()}
    schema = pyarrow.schema([(c, types.get(kind, pyarrow.float64())) for c, kind in _KIND_OF.items()])
    remaining = iter(rows)
    with pyarrow.parquet.ParquetWriter(path, schema) as writer:
        while group := [kept_values(row) for row in islice(remaining, _GROUP_ROWS)]:
            columns = [
                pyarrow.array(v, t) for v, t in zip(zip(*group, strict=True), schema.types, strict=True)
            ]
            writer.write_table(pyarrow.Table.from_arrays(columns, schema=schema))


def parquet_rows(path: Path) -> Iterator[Row]:
    """The rows of a Parquet file, a group in memory at a time.

    Raises:
        FileError: the file is damaged or none of rows.
    """
    with damage_reported(path, kind="Parquet"):
        import pyarrow.parquet

        with pyarrow.parquet.ParquetFile(path) as file:
            if tuple(file.schema_arrow.names) != COLUMNS:
                raise FileError(path, "has not the columns of this version", "name another file")
            for batch in file.iter_batches(batch_size=_GROUP_ROWS):
                yield from map(row_of_values, zip(*(c.to_pylist() for c in batch.columns), strict=True))
