"""Columns of numbers out of the trace files of others: text with delimiters, and TDMS of LabVIEW."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, MissingExtraError, damage_reported, require_file
from glyphs.surface.display import one_line
from pipeline.formats.time_stamps import second_of_day
from pipeline.formats.traces_file import Column, Csv
from pipeline.formats.waveforms import Wave, laid_together, wave_of

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
        stamped: columns that held time stamps, now seconds.
    """

    path: Path
    columns: dict[Column, NDArray[np.float64]]
    first_line: int = 0
    rate_hz: float = 0.0
    stamped: frozenset[Column] = frozenset()

    __repr__ = one_line

    @property
    def n_rows(self) -> int:
        """Samples of each column."""
        return next(iter(self.columns.values())).size

    def at(self, row: int) -> str:
        """Where a row stands, for a message."""
        return f"in line {self.first_line + row}" if self.first_line else f"at sample {row}"


def read_trace_table(
    path: Path,
    wanted: Sequence[Column],
    *,
    text: Csv,
    time: Column | None = None,
    states: Collection[Column] = (),
) -> TraceTable:
    """The columns wanted.

    Args:
        path: the file.
        wanted: columns; of TDMS channels that begin at other times than the first, or were sampled at another rate,
            are laid on its samples.
        text: layout of text.
        time: the column that may hold time stamps, which become seconds.
        states: columns, which hold until they change and are not interpolated.

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
        return _tdms(path, wanted, states)
    try:
        try:
            return _text(path, wanted, text, time, encoding="utf-8-sig")
        except UnicodeDecodeError:
            with path.open("rb") as stream:
                wide = stream.read(2) in (b"\xff\xfe", b"\xfe\xff")
            return _text(path, wanted, text, time, encoding="utf-16" if wide else "cp1252")
    except (UnicodeError, csv.Error) as error:
        raise FileError(path, f"is no text of numbers ({error})", "export it as CSV in UTF-8") from error


def _text(
    path: Path, wanted: Sequence[Column], how: Csv, time: Column | None, *, encoding: str
) -> TraceTable:
    with path.open(encoding=encoding, newline="") as stream:
        lines = csv.reader(stream, delimiter=how.delimiter)
        for _ in range(how.skip_lines):
            next(lines, None)
        header: list[str] = []
        if any(isinstance(c, str) for c in wanted):
            header = [name.strip() for name in next(lines, [])]
        places = [_place(path, c, header) for c in wanted]
        values = [array("d") for _ in wanted]
        first_line = lines.line_num + 1
        stamped: set[Column] = set()
        for row in lines:
            if not any(row):
                empty = lines.line_num
                if any(any(rest) for rest in lines):
                    raise FileError(path, f"has nothing in line {empty}, and values after it", "take it out")
                break
            if not values[0] and lines.line_num == first_line and _is_units(row, places):
                first_line += 1
                continue
            for into, place, name in zip(values, places, wanted, strict=True):
                stamp = second_of_day(row[place]) if name == time and place < len(row) else None
                if stamp is not None:
                    stamped.add(name)
                into.append(
                    _number(path, row, place, name, lines.line_num, how.decimal) if stamp is None else stamp
                )
    if not values[0]:
        raise FileError(path, "has no values below its header", "export it again")
    columns = dict(zip(wanted, map(np.asarray, values), strict=True))
    return TraceTable(path, columns, first_line, stamped=frozenset(stamped))


def _is_units(row: list[str], places: Sequence[int]) -> bool:
    """Whether a row below the header names units: it has words, and no digit in any column wanted."""
    cells = [row[place] for place in places if place < len(row)]
    return any(cells) and not any(char.isdigit() for cell in cells for char in cell)


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


def _tdms(path: Path, wanted: Sequence[Column], states: Collection[Column]) -> TraceTable:
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
        waves: dict[Column, Wave] = {}
        stamped: frozenset[Column] = frozenset()
        for name in wanted:
            if name not in channels:
                held = ", ".join(channels)[:150] or "nothing"
                raise FileError(path, f"has no channel {name!r} (it has {held})", "correct [columns]")
            channel = channels[str(name)]
            values = np.asarray(channel[:])
            if values.dtype.kind == "M":
                values, stamped = (values - values[:1]) / np.timedelta64(1, "s"), stamped | {name}
            try:
                columns[name] = values.astype(np.float64)
            except (TypeError, ValueError) as error:
                raise FileError(path, f"holds no numbers in channel {name!r}", "name another") from error
            if (wave := wave_of(channel.properties)) is not None:
                waves[name] = wave
    if not all(values.size for values in columns.values()):
        raise FileError(path, "has no samples", "record it again")
    if len(set(waves.values())) > 1:
        columns = laid_together(path, columns, waves, states)
    lengths = {name: values.size for name, values in columns.items()}
    longest, shortest = max(lengths.values()), min(lengths.values())
    if shortest < longest:
        short = min(lengths, key=lambda name: lengths[name])
        raise FileError(
            path,
            f"has {shortest:,} samples in channel {short!r} and {longest:,} in others",
            "record all channels together, as waveforms (wf_increment, wf_start_time)",
        )
    first = next((waves[name] for name in columns if name in waves), None)
    return TraceTable(path, columns, rate_hz=0.0 if first is None else 1.0 / first.step_s, stamped=stamped)
