"""Columns of numbers out of the trace files of others: text with delimiters, and TDMS of LabVIEW."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, MissingExtraError, damage_reported, require_file
from glyphs.surface.display import one_line
from pipeline.files.traces_file import Column, Csv

CSV_SUFFIXES = (".csv", ".txt", ".tsv")
_MOST_BYTES = 2_000_000_000


@dataclass(frozen=True, eq=False)
class TraceTable:
    """Columns of one file.

    Attributes:
        path: the file.
        columns: (rows,) float64 by name or number; NaN where a value is missing.
        first_line: line of the first row; 0 where the file has no lines.
        rate_hz: that the file tells, or 0.
    """

    path: Path
    columns: dict[Column, NDArray[np.float64]]
    first_line: int = 0
    rate_hz: float = 0.0

    __repr__ = one_line

    def at(self, row: int) -> str:
        """Where a row stands, for a message."""
        return f"in line {self.first_line + row}" if self.first_line else f"at sample {row}"


def read_trace_table(path: Path, wanted: Sequence[Column], *, text: Csv) -> TraceTable:
    """The columns wanted.

    Raises:
        FileError: no such file, of another kind, damaged; a column that is not there; a value that is no number.
        MissingExtraError: TDMS without its library.
    """
    suffix = path.suffix.lower()
    if suffix not in (*CSV_SUFFIXES, ".tdms"):
        raise FileError(
            path, f"ends in {suffix or 'nothing'}", f"give {', '.join(CSV_SUFFIXES)} or .tdms files"
        )
    require_file(path, most_bytes=_MOST_BYTES)
    if suffix == ".tdms":
        return _tdms(path, wanted)
    try:
        return _text(path, wanted, text)
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(path, f"is no text of numbers ({error})", "export it as CSV in UTF-8") from error


def _text(path: Path, wanted: Sequence[Column], how: Csv) -> TraceTable:
    with path.open(encoding="utf-8-sig", newline="") as stream:
        lines = csv.reader(stream, delimiter=how.delimiter)
        for _ in range(how.skip_lines):
            next(lines, None)
        header: list[str] = []
        if any(isinstance(c, str) for c in wanted):
            header = [name.strip() for name in next(lines, [])]
        places = [_place(path, c, header) for c in wanted]
        values = [array("d") for _ in wanted]
        first_line = lines.line_num + 1
        for row in lines:
            if not any(row):
                empty = lines.line_num
                if any(any(rest) for rest in lines):
                    raise FileError(path, f"has nothing in line {empty}, and values after it", "take it out")
                break
            for into, place, name in zip(values, places, wanted, strict=True):
                into.append(_number(path, row, place, name, lines.line_num, how.decimal))
    if not values[0]:
        raise FileError(path, "has no values below its header", "export it again")
    return TraceTable(path, dict(zip(wanted, map(np.asarray, values), strict=True)), first_line)


def _place(path: Path, column: Column, header: list[str]) -> int:
    if isinstance(column, int):
        return column - 1
    if header.count(column) == 1:
        return header.index(column)
    if column in header:
        raise FileError(path, f"has {header.count(column)} columns {column!r}", "name them by number, from 1")
    held = ", ".join(header)[:150] or "nothing"
    raise FileError(
        path,
        f"has no column {column!r} (it has {held})",
        "correct [columns], csv.delimiter or csv.skip_lines",
    )


def _number(path: Path, row: list[str], place: int, name: Column, line: int, decimal: str) -> float:
    if place >= len(row):
        raise FileError(
            path,
            f"has {len(row)} values in line {line}, none for column {name!r}",
            "correct that line, or csv.delimiter",
        )
    written = row[place].strip()
    try:
        return float(written.replace(",", ".") if decimal == "," else written) if written else float("nan")
    except ValueError:
        raise FileError(
            path,
            f"says {written[:40]!r} in line {line}, column {name!r}",
            "write a number there, or correct csv.decimal",
        ) from None


def _tdms(path: Path, wanted: Sequence[Column]) -> TraceTable:
    try:
        from nptdms import TdmsFile
    except ModuleNotFoundError as error:
        raise MissingExtraError("TDMS", "npTDMS", "tdms") from error
    with damage_reported(path, kind="TDMS"):
        file = TdmsFile.read(path)
        channels = {f"{c.group_name}/{c.name}": c for group in file.groups() for c in group.channels()}
        if len(file.groups()) == 1:
            channels |= {c.name: c for c in channels.values()}
        columns: dict[Column, NDArray[np.float64]] = {}
        rates = set()
        for name in wanted:
            if name not in channels:
                held = ", ".join(channels)[:150] or "nothing"
                raise FileError(path, f"has no channel {name!r} (it has {held})", "correct [columns]")
            channel = channels[str(name)]
            try:
                columns[name] = np.asarray(channel[:], dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise FileError(path, f"holds no numbers in channel {name!r}", "name another") from error
            increment = channel.properties.get("wf_increment")
            if increment is not None and float(increment) > 0.0:
                rates.add(1.0 / float(increment))
    lengths = {name: values.size for name, values in columns.items()}
    longest, shortest = max(lengths.values()), min(lengths.values())
    if shortest < longest:
        short = min(lengths, key=lambda name: lengths[name])
        raise FileError(
            path,
            f"has {shortest:,} samples in channel {short!r} and {longest:,} in others",
            "record all channels together",
        )
    if not longest:
        raise FileError(path, "has no samples", "record it again")
    if rates and max(rates) > min(rates) * (1.0 + 1e-6):
        raise FileError(path, "has channels of several rates", "resample them to one")
    return TraceTable(path, columns, rate_hz=min(rates, default=0.0))
