"""Columns of numbers from trace files: text with delimiters, and TDMS of LabVIEW."""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MissingExtraError
from glyphs.surface.display import one_line
from pipeline.errors import DataError
from pipeline.formats.table_file import TableLine, table_lines
from pipeline.formats.traces_file import Column, Columns, Csv, TracesFile
from whisker_array.scan.read_recording import OVERLOAD

CSV_SUFFIXES = (".csv", ".txt", ".tsv")
# properties of the clock of a TDMS channel
_CLOCK = ("wf_increment", "wf_start_offset", "wf_start_time")
# lead-in of a TDMS segment: tag, contents, version, offsets of the next segment and of the data; by byte order
_LEAD_IN = {"little": struct.Struct("<4s4xIQQ"), "big": struct.Struct(">4s4xIQQ")}
_BIG_ENDIAN = 1 << 6
# limits of the library's work on a TDMS file, which takes some seconds at each
_MOST_SEGMENTS, _MOST_OBJECTS, _MOST_DESCRIPTION_BYTES, _MOST_PIECES = 100_000, 200_000, 16_000_000, 300_000
# objects of all segments together: a segment without a list of its own has those of the segment before
_MOST_INHERITED, _NEW_LIST = 10_000_000, 1 << 2
# what instruments write for a signal beyond their range, or for none
_NO_READING = re.compile(
    r"[+-]?(o\.?l\.?|ov(er|f|l).*|inf(inity)?|nan|#?n/?a|1\.?#\w+|-+|\*+)", re.IGNORECASE
)
_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)\s*([AaPp])?")

_DEFRAGMENT = "defragment it in LabVIEW, or record more samples at a time"

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TraceTable:
    """Columns of one file."""

    columns: dict[Column, NDArray[np.float64]]  # (rows,) by name or number; NaN where missing
    first_line: int = 0  # of the first row; 0 where the file has no lines
    rate_hz: float = 0.0
    stamped: frozenset[Column] = frozenset()  # columns of time stamps, converted to seconds

    __repr__ = one_line

    @property
    def n_rows(self) -> int:
        return next(iter(self.columns.values())).size

    def column(self, name: Column | None) -> NDArray[np.float64]:
        return np.zeros(self.n_rows) if name is None else self.columns[name]

    def place(self, row: int) -> str:
        return f"in line {self.first_line + row}" if self.first_line else f"at sample {row}"

    def require(self, values: NDArray[np.float64], what: str, hint: str) -> None:
        """Check that no row (rows, ...) lacks a value or has an overload. Raises DataError: one does; it is named."""
        rows = values.reshape(self.n_rows, -1)
        lost = np.flatnonzero(~(np.abs(rows) < OVERLOAD).all(axis=1))
        if lost.size:
            value = rows[lost[0]][~(np.abs(rows[lost[0]]) < OVERLOAD)][0]
            value_text = f"no {what}" if np.isnan(value) else f"the {what} {value:g}, an overload,"
            raise DataError(f"has {value_text} {self.place(int(lost[0]))}", hint)


def read_trace_table(path: Path, layout: TracesFile) -> TraceTable:
    """Read the columns that the description names; time stamps are converted to seconds, and TDMS channels resampled at
    the samples of the first. Raises DataError: the file is damaged or of another kind, or lacks a column or a number.
    MissingExtraError: the library for TDMS is missing."""
    if path.suffix.lower() == ".tdms":
        return _tdms(path, layout.columns)
    if path.suffix.lower() not in CSV_SUFFIXES:
        hint = f"give {', '.join(CSV_SUFFIXES)} or .tdms files"
        raise DataError(f"ends in {path.suffix or 'nothing'}", hint)
    return _text(path, layout.columns, layout.csv)


def _text(path: Path, names: Columns, how: Csv) -> TraceTable:
    wanted = names.named()
    lines = table_lines(path, delimiter=how.delimiter, skip_lines=how.skip_lines)
    header, first_line = TableLine(how.skip_lines, ()), how.skip_lines + 1
    if any(isinstance(c, str) for c in wanted):
        header = next(lines, TableLine(first_line, ()))
        first_line = header.number + 1
    places = [_place(c, header.cells) for c in wanted]
    values, n = array("d"), len(places)
    stamped: set[Column] = set()
    for line in lines:
        if not values and line.number == first_line and _is_units(line, places):
            first_line += 1
            continue
        if line.number != (expected := first_line + len(values) // n):
            raise DataError(f"has an empty line {expected} before further values", "take it out")
        for place, name in zip(places, wanted, strict=True):
            stamp = second_of_day(line.cell(place)) if name == names.time else None
            stamped.update(() if stamp is None else (name,))
            values.append(_number(line, place, name, names, how.decimal) if stamp is None else stamp)
    if not values:
        raise DataError("has no values below its header", "export it again")
    columns = dict(zip(wanted, np.asarray(values).reshape(-1, n).T.copy(), strict=True))
    return TraceTable(columns, first_line, stamped=frozenset(stamped))


def second_of_day(written: str) -> float | None:
    """Second of the day of a time stamp, such as 2024-03-01T09:30:00.125 or 9:30:00 PM; None for any other text."""
    stamp = _OF_DAY.search(written)
    if stamp is None:
        return None
    hours, minutes, seconds, half = stamp.groups()
    hour = int(hours) if half is None else int(hours) % 12 + (12 if half in "Pp" else 0)
    return 3600.0 * hour + 60.0 * int(minutes) + float(seconds.replace(",", "."))


def _is_units(line: TableLine, places: Sequence[int]) -> bool:
    written = "".join(line.cell(place) for place in places)
    return bool(written) and not any(char.isdigit() for char in written)


def _place(column: Column, header: Sequence[str]) -> int:
    if isinstance(column, int):
        return column - 1
    if header.count(column) == 1:
        return header.index(column)
    if column in header:
        raise DataError(f"has {header.count(column)} columns {column!r}", "name them by number, from 1")
    held = ", ".join(header)[:150] or "nothing"
    hint = "correct [columns], csv.delimiter or csv.skip_lines"
    raise DataError(f"has no column {column!r} (it has {held})", hint)


def _number(line: TableLine, place: int, name: Column, names: Columns, decimal: str) -> float:
    if place >= len(line.cells):
        what = f"has {len(line.cells)} values in line {line.number}, none for column {name!r}"
        raise DataError(what, "correct that line, or csv.delimiter")
    written = line.cells[place]
    if not written or (name in names.moment and _NO_READING.fullmatch(written)):
        return float("nan")
    try:
        return float(written.replace(",", ".") if decimal == "," else written)
    except ValueError:
        what = f"says {written[:40]!r} in line {line.number}, column {name!r}"
        raise DataError(what, "write a number there, or correct csv.decimal") from None


def _check_work(path: Path) -> None:
    place = segments = objects = described = held = inherited = 0
    with path.open("rb") as file:
        while len(lead_in := file.read(28)) == 28 and lead_in.startswith(b"TDSm"):
            order: Literal["big", "little"] = "big" if lead_in[4] & _BIG_ENDIAN else "little"
            _, _, following, description = _LEAD_IN[order].unpack(lead_in)
            segments += 1
            described += min(description, following)
            listed = int.from_bytes(file.read(4), order) if description >= 4 else 0
            objects += listed
            held = listed if lead_in[4] & _NEW_LIST else max(held, listed)
            inherited += held
            for count, most, what in (
                (segments, _MOST_SEGMENTS, "segments"),
                (objects, _MOST_OBJECTS, "described objects"),
                (inherited, _MOST_INHERITED, "objects in its segments together"),
                (described, _MOST_DESCRIPTION_BYTES, "bytes of descriptions"),
            ):
                if count > most:
                    raise DataError(f"has over {most:,} {what}", _DEFRAGMENT)
            place += len(lead_in) + following
            file.seek(min(place, 2**62))


def _tdms_values(file: Any, channels: Mapping[Column, Any]) -> dict[Column, NDArray[Any]]:
    n_channels = sum(len(group) for group in file.groups())
    pieces: dict[Column, list[NDArray[Any]]] = {name: [] for name in channels}
    for k, chunk in enumerate(file.data_chunks(), start=1):
        if k * n_channels > _MOST_PIECES:
            raise DataError(f"has over {_MOST_PIECES:,} pieces of data", _DEFRAGMENT)
        for name, channel in channels.items():
            piece = chunk[channel.group_name][channel.name]
            if len(piece):
                pieces[name].append(np.asarray(piece[:]))
    return {name: np.concatenate(held) if held else np.empty(0) for name, held in pieces.items()}


def _tdms(path: Path, names: Columns) -> TraceTable:
    try:
        from nptdms import TdmsFile
    except ModuleNotFoundError as error:
        raise MissingExtraError("TDMS", "npTDMS", "tdms") from error
    _check_work(path)
    # an open file: beside a name, the library would take an index that may not belong to it
    with path.open("rb") as stream, TdmsFile.open(stream) as file:
        held = {f"{c.group_name}/{c.name}": c for group in file.groups() for c in group.channels()}
        if len(file.groups()) == 1:
            held |= {c.name: c for c in held.values()}
        if absent := [name for name in names.named() if name not in held]:
            has = ", ".join(held)[:150] or "nothing"
            raise DataError(f"has no channel {absent[0]!r} (it has {has})", "correct [columns]")
        channels = {name: held[str(name)] for name in names.named()}
        columns = _tdms_values(file, channels)
    stamped = frozenset(name for name, values in columns.items() if values.dtype.kind == "M")
    for name, values in columns.items():
        seconds = (values - values[:1]) / np.timedelta64(1, "s") if name in stamped else values
        try:
            columns[name] = seconds.astype(np.float64)
        except (TypeError, ValueError) as error:
            raise DataError(f"holds no numbers in channel {name!r}", "name another") from error
    if not all(values.size for values in columns.values()):
        raise DataError("has no samples", "record it again")
    steps_s = {name: float(c.properties.get("wf_increment") or 0.0) for name, c in channels.items()}
    clocks = {tuple(c.properties.get(key) for key in _CLOCK) for name, c in channels.items() if steps_s[name]}
    if len(clocks) > 1:
        if bare := [name for name, step_s in steps_s.items() if not step_s]:
            what = f"has channels that begin at different times, and channel {bare[0]!r} without wf_increment"
            raise DataError(what, "record all channels as waveforms, or together")
        columns = _on_first_clock(columns, channels, (names.lifted, names.number))
    lengths = {name: values.size for name, values in columns.items()}
    short, longest = min(lengths, key=lambda name: lengths[name]), max(lengths.values())
    if lengths[short] < longest:
        what = f"has {lengths[short]:,} samples in channel {short!r} and {longest:,} in others"
        raise DataError(what, "record all channels together, as waveforms (wf_increment, wf_start_time)")
    rate_hz = next((1.0 / step_s for step_s in steps_s.values() if step_s), 0.0)
    return TraceTable(columns, rate_hz=rate_hz, stamped=stamped)


def _on_first_clock(
    columns: Mapping[Column, Floats], channels: Mapping[Column, Any], states: Collection[Column | None]
) -> dict[Column, Floats]:
    """Resample channels at the samples of the first one, over their common time; `states` are not interpolated."""
    starts = {n: np.datetime64(c.properties.get("wf_start_time") or 0, "ns") for n, c in channels.items()}
    first, at_s = next(iter(channels)), {}
    for name, channel in channels.items():
        step_s, offset_s = (float(channel.properties.get(key) or 0.0) for key in _CLOCK[:2])
        lag_s = (starts[name] - starts[first]) / np.timedelta64(1, "s")
        at_s[name] = lag_s + offset_s + step_s * np.arange(columns[name].size)
    late, early = max(at_s, key=lambda n: at_s[n][0]), min(at_s, key=lambda n: at_s[n][-1])
    tick_s = 1e-3 * float(channels[first].properties["wf_increment"])
    run_s = at_s[first][(at_s[first] > at_s[late][0] - tick_s) & (at_s[first] < at_s[early][-1] + tick_s)]
    if run_s.size < 2:
        gap_s = at_s[late][0] - at_s[early][-1]
        what = f"has channel {late!r}, which begins {gap_s:.3f} s after channel {early!r} ends"
        raise DataError(what, "record all channels at the same time")
    return {
        name: values[np.searchsorted(at_s[name], run_s + tick_s, side="right") - 1]
        if name in states
        else np.interp(run_s, at_s[name], values)
        for name, values in columns.items()
    }
