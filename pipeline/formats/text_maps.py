"""Heights in text files: columns x y z, or a matrix of heights with a heading that describes it.

Any delimiter, a decimal point or comma, and words for missing values are accepted, and headings of ESRI grids,
Gwyddion, Wyko ASCII, SPIP, Surfer, Zygo XYZ and plain `key = value unit` lines. The first row of a matrix is the top
one, unless a column of y says otherwise; in Wyko and Surfer it is the bottom row.
"""

from __future__ import annotations

import contextlib
import io
import re
from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError
from pipeline.formats.grid import MM
from pipeline.formats.points import map_of_points
from pipeline.formats.raw_map import PROFILE, RawMap
from pipeline.formats.table_file import CP1252, encoding_of

_SNIFF_BYTES = 200_000
_SNIFF_LINES = 400
_MOST_HEAD_LINES = 300
_LEAST_PROFILE = 16
_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_COMMA_NUMBER = re.compile(r"[-+]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][-+]?\d+)?")
# a number with thousands separators and a decimal sign, in a line of numbers separated by semicolons or tabs
_GROUPED = re.compile(
    r"(?m)^(?=[^\n]*[;\t])[-+\d.,'’ \u00a0\u202f;\teE]*?\d([.,'’ \u00a0\u202f])\d{3}(?:\1\d{3}){0,3}(?!\1)[.,]\d"
)
# missing values: phrases, the NaN of Microsoft's C, and other contents of a cell
_PHRASE = re.compile(
    r"(?i)\b(?:no|not|out[ _-]of)[ _-]?(?:data|value|measured|range)\b|\bn/a\b|(?<=[\s;,])#[a-z][\w/!?]*"
)
_C_NAN = re.compile(r"[-+]?\d\.#[A-Za-z]+\d*")
_IS_MISSING = re.compile(
    r"(?i)\s*|nan|[-+]?inf\w*|-+|\*+|\?+|_+|bad|null|none|na|nodata|invalid|missing|masked|void|undefined"
)


@dataclass(frozen=True)
class Layout:
    """Layout of the numbers in a text; without a `delimiter` blanks and tabs separate. `first_line` counts from 0."""

    delimiter: str | None
    comma: bool
    columns: int
    first_line: int

    def cells(self, line: str) -> list[str]:
        line = _C_NAN.sub("nan", _PHRASE.sub("nan", line.strip("\r\n ")))
        cells = line.split(self.delimiter)
        ends = self.delimiter is not None and not cells[-1].strip() and len(cells) != self.columns
        return cells[:-1] if ends else cells


@dataclass(frozen=True)
class _NumberTable:
    head: str
    # of the columns, in lower case; empty if the last line of the head does not name them all
    names: tuple[str, ...]
    rows: NDArray[np.float64]  # (n, columns), NaN where a value is missing


_LAYOUTS = ((";", True), (";", False), ("\t", True), ("\t", False), (None, True), (",", False), (None, False))


def is_number_table(path: Path) -> bool:
    """Whether a local file is text with a matrix of numbers or columns x, y, z."""
    try:
        with path.open("rb") as stream:
            start = stream.read(_SNIFF_BYTES)
    except OSError:
        return False
    text = _decode(start)
    lines = text.splitlines()[:_SNIFF_LINES] if "\0" not in text else []
    layout = _layout(lines[:-1] if len(start) == _SNIFF_BYTES else lines)
    if layout is None or layout.columns < 3:
        return False
    body = lines[layout.first_line :]
    return len(body) >= 3 and layout.first_line <= max(_MOST_HEAD_LINES, len(body))


def _number_table(text: str) -> _NumberTable:
    sample = text[:_SNIFF_BYTES].splitlines()
    layout = _layout(sample[:_SNIFF_LINES])
    if layout is None:
        single = Layout(None, comma=False, columns=1, first_line=0)
        if 2 * sum(_count(line, single) == 1 for line in sample) > max(len(sample), _LEAST_PROFILE):
            raise DataError(*PROFILE)
        what = "holds no table of numbers"
        raise DataError(what, "export columns x y z, or a matrix of heights, one row per line")
    head = sample[: layout.first_line]
    body = text.split("\n", layout.first_line)[layout.first_line] if layout.first_line else text
    if body.count("\n") * layout.columns > 9 * MAX_PIXELS:
        raise DataError("holds more numbers than the limit", "crop or thin the map")
    rows = _numbers(body, layout)
    if layout.delimiter and body.partition("\n")[0].rstrip().endswith(layout.delimiter):
        rows = rows[:, : np.flatnonzero(np.isfinite(rows).any(axis=0)).max(initial=0) + 1]
    return _NumberTable("\n".join(head), _names(head, rows.shape[1]), rows)


def _decode(data: bytes) -> str:
    text = data.decode(encoding_of(data[:_SNIFF_BYTES]), CP1252)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if '"' in text[:_SNIFF_BYTES]:
        text = text.replace('","', ";").replace('"', "")
    if grouped := _GROUPED.search(text[:_SNIFF_BYTES]):
        text = re.sub(rf"(?<=\d){re.escape(grouped[1])}(?=\d{{3}}(?!\d))", "", text)
    return text


def _layout(lines: Sequence[str]) -> Layout | None:
    layouts: list[tuple[int, Layout]] = []
    for delimiter, comma in _LAYOUTS:
        counts = [_count(line, Layout(delimiter, comma, 0, 0)) for line in lines]
        for columns, n in Counter(c for c in counts if c >= 2).most_common(1):
            layouts.append((n * columns, Layout(delimiter, comma, columns, counts.index(columns))))
    return max(layouts, key=lambda scored: scored[0])[1] if layouts else None


def _count(line: str, layout: Layout) -> int:
    if line[:1] in ("#", "%"):
        return 0
    number = _COMMA_NUMBER if layout.comma else _NUMBER
    numbers = 0
    cells = layout.cells(line)
    for cell in cells:
        cell = cell.strip()
        if number.fullmatch(cell):
            numbers += 1
        elif not _IS_MISSING.fullmatch(cell):
            return 0
    # at least half numbers: only this distinguishes a decimal comma from a comma between columns
    return len(cells) if 2 * numbers >= len(cells) else 0


def _names(head: Sequence[str], columns: int) -> tuple[str, ...]:
    cells = [_cells_of_head(line, columns) for line in head[-2:]]
    if len(cells) == 2 and all(cells):
        units = [unit.strip("[]()- ") for unit in cells[1]]
        if {*units} <= {"", *MM}:
            return tuple(f"{name} {unit}" for name, unit in zip(cells[0], units, strict=True))
    return cells[-1] if cells else ()


def _cells_of_head(line: str, columns: int) -> tuple[str, ...]:
    line = line.strip().lstrip("#%/ ").lower()
    cells = [cell.strip() for cell in re.split(r"[;,\t]", line) if cell.strip()]
    cells = cells if len(cells) == columns else line.split()
    return tuple(cells) if len(cells) == columns else ()


def _numbers(body: str, layout: Layout) -> NDArray[np.float64]:
    if layout.comma:
        body = body.replace(",", ".")
    with contextlib.suppress(ValueError):
        return np.loadtxt(io.StringIO(body), comments=None, delimiter=layout.delimiter, ndmin=2)
    return _numbers_and_words(body, layout)


def _numbers_and_words(body: str, layout: Layout) -> NDArray[np.float64]:
    """Read the first block of numbers, up to the head of another channel; words become NaN. This is slow."""
    numbers, width = array("d"), layout.columns
    for n, line in enumerate(body.split("\n"), start=layout.first_line + 1):
        cells = layout.cells(line)
        if not line.strip():
            continue
        values = [_number(cell) for cell in cells]
        if numbers and (line.startswith("#") or (len(values) != width and np.isnan(values).any())):
            break
        if len(values) != width:
            raise DataError(
                "has rows of different lengths or text between its numbers "
                f"(line {n} has {len(values)} columns, others {width})",
                "export it again",
            )
        for cell, value in zip(cells, values, strict=True):
            if np.isnan(value) and any(char.isdigit() for char in cell):
                raise DataError(f"says {cell.strip()[:40]!r} in line {n}", "write a number there, or nan")
        numbers.extend(values)
    return np.array(numbers).reshape(-1, width)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


# most columns of a list of points (x y z, intensity, colour, normal); least rows for each of its columns
_MOST_POINT_COLUMNS, _LEAST_ROWS = 12, 100
_LEAST_MATRIX_COLUMNS = 8
# number of characters of a heading that are searched
_MOST_HEAD = 10_000
# a line of a heading: its key, an axis and a unit in brackets, a number, and a unit or another word
_ENTRY = re.compile(
    r"(?m)^(?:[^\w\n]|_)*(?P<key>[^\W\d_][^\n\d:=,;\t()\[\]]*)[ \t]*"
    r"(?P<brackets>(?:[(\[][^\n()\[\]]*[)\]][ \t]*)*)[ \t:=,;]*"
    r"(?P<value>[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)?[ \t:=,;(\[]*(?P<after>[^\n,;()\[\]]*)"
)
# what ends an entry within a line: the next key follows
_NEXT_ENTRY = re.compile(r"[,;][ \t]*(?=[^\W\d_][\w .-]{0,30}=)")
# a unit of length, of each sample or of each step of the converter
_OF_EACH = re.compile(
    rf"(?P<unit>{'|'.join(sorted(MM, key=len, reverse=True))})\b(?:[ \t]*(?:/|per\b)[ \t]*"
    r"(?:(?P<sample>px|pix|sample|point|pt\b|step|col|row)|(?P<digit>digit|count|lsb|bit|level|gr[ea]y|unit|value|dn\b))"
    r"\w*)?",
    re.IGNORECASE,
)
# keys as different programs and languages spell them, in lower case with single blanks
_GAP = (
    r"(?:pitch|step(?: ?size)?|spacing|increment|interval|distance|sampling|scale|resolution|calibration|gap|pas"
    r"|schritt\w*)"
)
_LATERAL = r"(?:xy|lateral|horizontal|pixel|cell|sample|sampling|point|grid|node)"
_OF_AXIS = (
    r"d ?{0}|delta {0}|(?:pixel|cell) ?size ?{0}|{0} ?(?:pixel|cell) ?size"
    rf"|(?:{_LATERAL} ?)?{_GAP} ?{{0}}|{{0}} ?(?:{_LATERAL} ?)?{_GAP}"
)
_PITCH_KEYS = {
    "x": _OF_AXIS.format("x") + rf"|column ?{_GAP}",
    "y": _OF_AXIS.format("y") + rf"|(?:line|profile|row) ?{_GAP}",
    "": rf"(?:pixel|cell) ?size|{_LATERAL} ?{_GAP}|pixel(?:gr[öo](?:ß|ss)e|abstand|weite)|(?:punkt|abtast|mess)abstand",
    # of a microscope this may be the step of its lens
    "bare": r"pitch|step|spacing",
}
_SIZE_KEYS = {"x": r"width|breite|largeur|x ?length", "y": r"height|h[öo]he|hauteur|y ?length"}
_Z_SCALE_KEYS = (
    r"(?:z|height|vertical) ?(?:calibration|scal(?:e|ing)(?: factor)?|factor|conversion(?: factor)?)"
)
_Z_UNIT_KEYS = r"value units?|einheiten|unit[ée]s|(?:z|height) ?units?|units? z|unit data|data unit"
_Z_KEYS, _UNIT_KEYS = r"z|heights?|h[öo]he|depth|topography", r"units?|einheit|unité"
_XY_UNIT_KEYS = r"(?:x|xy|lateral) ?units?|units? (?:x|xy)"
_SHAPE = re.compile(r"(?is)(?:ncols|nx|x-pixels)\W+(\d+).*?(?:nrows|ny|y-pixels)\W+(\d+)")
_SURFER = re.compile(r"DSAA\s+(\d+)\s+(\d+)" + r"\s+(\S+)" * 4)
_NO_DATA = re.compile(r"(?i)nodata_?value\s*[:=]?\s*(\S+)")
_WYKO = "wyko ascii data file format"
_ZYGO = "Zygo XYZ Data File"
_MOST_NAME = 100
# a unit is a known word, or any word in brackets
_KNOWN_UNIT = "|".join(sorted((*MM, "px", "pixels?"), key=len, reverse=True))
_AXIS = re.compile(
    r"(?P<axis>[xyz]|height|h[öo]he|row|col(?:umn)?)(?![a-z])[\W_]*"
    r"(?:(?:pos\w*|coord\w*|value|index|number)[\W_]*)?"
    rf"(?P<unit>(?:{_KNOWN_UNIT})(?![a-z])|(?<=[\[(])[^\W\d_]+)?[\W_]*"
)
# the same with words of a position around the axis: Pos X, Stage Y [mm], X-Achse, Z-Koordinate (µm), measured height
_WORDS = r"(?:(?:pos(?:ition)?|[ck]oord(?:inate)?|axis|achse|stage|meas(?:ured)?|value|(?:mess)?wert)[\W_]*)"
_POSITION = re.compile(
    rf"{_WORDS}{{0,2}}(?P<axis>[xyz]|height|h[öo]hen?)(?:(?![^\W\d_])[\W_]*|(?={_WORDS})){_WORDS}{{0,2}}"
    rf"(?P<unit>(?:{_KNOWN_UNIT})(?![a-z]))?[\W_]*"
)


def read_text_map(path: Path, most: int = MAX_PIXELS) -> RawMap:
    """Read the heights of a text file."""
    text = _decode(path.read_bytes())
    if text.startswith(_ZYGO):
        return _zygo(text, most)
    table = _number_table(text)
    entries = _entries(table.head[:_MOST_HEAD])
    if (named := _named_points(table)) is not None:
        points, unit, xy_mm = named
    elif _is_points(table, entries):
        scale, unit = _height_scale(entries)
        points, xy_mm = table.rows[:, :3] * (1.0, 1.0, scale), _xy_mm(entries)
    else:
        return _matrix(table, entries)
    raw = replace(map_of_points(points, most=most), z_mm=MM.get(unit), xy_mm=xy_mm, unit=unit)
    # coordinates that count 0, 1, 2 are not lengths
    counted = xy_mm is None and raw.x_pitch == raw.y_pitch == 1.0
    return replace(raw, x_pitch=None, y_pitch=None) if counted else raw


def _named_points(table: _NumberTable) -> tuple[NDArray[np.float64], str, float | None] | None:
    """(n, 3) x, y and z, the unit of z, and that of x in mm; None if the table does not name them."""
    axes = _named_axes(table.names, _AXIS)
    if {"r", "c", "z"} <= axes.keys():
        rows, columns, heights = (table.rows[:, axes[axis][0]] for axis in "rcz")
        return np.stack([columns, -rows, heights], axis=1), axes["z"][1], None
    if not {"x", "y", "z"} <= axes.keys():
        axes = _named_axes(table.names, _POSITION)
        if not {"x", "y", "z"} <= axes.keys():
            return None
        # the heading's other lines may state the unit of the first three columns
        if not axes["z"][1] and [axes[axis][0] for axis in "xyz"] == [0, 1, 2]:
            return None
    return table.rows[:, [axes[axis][0] for axis in "xyz"]], axes["z"][1], MM.get(axes["x"][1])


def _named_axes(names: Sequence[str], heading: re.Pattern[str]) -> dict[str, tuple[int, str]]:
    axes: dict[str, tuple[int, str]] = {}
    for column, name in enumerate(names):
        if len(name) <= _MOST_NAME and (axis := heading.fullmatch(name.strip("\"'# "))):
            unit = axis["unit"] or ""
            if unit and unit not in MM and not unit.startswith(("px", "pixel")):
                what = f"has the column {name!r}, and {unit} is no unit of length that is known"
                raise DataError(what, "export it in nm, um, mm, m or in, or leave the unit out")
            axes.setdefault(axis["axis"][0].replace("h", "z"), (column, unit if unit in MM else ""))
    return axes


def _zygo(text: str, most: int) -> RawMap:
    """Zygo XYZ: columns and rows of the camera, and heights in um; the 7th number of line 8 is the pixel in m."""
    head, _, body = text.partition("\n#\n")
    numbers = "".join(head.splitlines()[7:8]).split()
    pitch = (float(numbers[6]) if len(numbers) > 6 else 0.0) or None
    raw = map_of_points(_number_table(body).rows[:, :3] * (1.0, -1.0, 1.0), most=most)
    return replace(raw, x_pitch=pitch, y_pitch=pitch, z_mm=1e-3, xy_mm=1e3, unit="um")


def _is_points(table: _NumberTable, entries: Sequence[_HeadEntry]) -> bool:
    rows, columns = table.rows.shape
    head = table.head.lower()
    if "ncols" in head or _WYKO in head or columns < 3:
        return False
    if all(any(re.fullmatch(keys, entry.key) for entry in entries) for keys in _SIZE_KEYS.values()):
        return False
    many = columns <= _MOST_POINT_COLUMNS and rows > _LEAST_ROWS * columns
    return bool(columns < _LEAST_MATRIX_COLUMNS or many)


def _matrix(table: _NumberTable, entries: Sequence[_HeadEntry]) -> RawMap:
    head, z = table.head[:_MOST_HEAD], table.rows
    if z.shape[1] < 3:
        raise DataError(PROFILE[0], f"{PROFILE[1]}, and export columns x y z or a matrix of heights")
    if _WYKO in head.lower():
        return _wyko(head, z)
    surfer = _SURFER.match(head)
    if (shape := surfer or _SHAPE.search(head)) and int(shape[1]) * int(shape[2]) == z.size:
        z = z.reshape(int(shape[2]), int(shape[1]))  # rows may be broken into lines
    if no_data := _NO_DATA.search(head):
        z = np.where(z == float(no_data[1].replace(",", ".")), np.nan, z)
    scale, unit = _height_scale(entries)
    z, z_mm = z * scale, MM.get(unit)
    if surfer:
        x, to_x, y, to_y = (float(end) for end in surfer.groups()[2:])
        pitches = (to_x - x) / (z.shape[1] - 1), (to_y - y) / (z.shape[0] - 1)
        return RawMap(z, *pitches, bottom_first=True, rows_stated=True)
    if axes := _without_axes(_with_first_row(z, table.names)):
        z, x_step, y_step = axes
        if x_step == y_step == 1.0:  # rows and columns are numbered
            return RawMap(z, z_mm=z_mm, unit=unit)
        return RawMap(z, abs(x_step), abs(y_step), z_mm, bottom_first=y_step > 0.0, unit=unit)
    x_pitch, y_pitch, xy_mm = _stated_pitches(entries, *z.shape)
    # ESRI grids and exports of Gwyddion have their top row first by definition
    stated = "ncols" in head.lower() or any(re.fullmatch(_SIZE_KEYS["x"], entry.key) for entry in entries)
    return RawMap(z, x_pitch, y_pitch, z_mm, xy_mm, rows_stated=stated, unit=unit)


@dataclass(frozen=True)
class _HeadEntry:
    key: str  # in lower case, with single blanks
    value: float | None
    unit: str
    of: str  # "sample" or "digit" if the unit is of each sample or each step of the converter; else empty
    word: str  # text behind the number, or in its place


def _entries(head: str) -> list[_HeadEntry]:
    entries = []
    for line in _ENTRY.finditer(_NEXT_ENTRY.sub("\n", head)):
        name = line["key"].replace("_", " ").strip()
        brackets = [text.strip("->= ") for text in re.findall(r"[^()\[\]]+", line["brackets"])]
        axis = next((text for text in brackets if text.lower() in ("x", "y", "z")), "")
        key = re.sub(r"[\s./-]+", " ", f"{name} {axis}").strip().lower()
        unit = _OF_EACH.fullmatch(name)  # such as um_per_pixel
        for text in (*brackets, line["after"]):
            unit = unit or _OF_EACH.match(text.strip().removeprefix("in "))
        of = "" if unit is None else "sample" if unit["sample"] else "digit" if unit["digit"] else ""
        named, _, last = key.rpartition(" ")
        if unit is None and last in MM and named:  # such as pitch_um
            key, length = named.removesuffix(" in"), last
        else:
            length = "" if unit is None else unit["unit"].lower()
        value = None if line["value"] is None else float(line["value"].replace(",", "."))
        entries.append(_HeadEntry(key, value, length, of, line["after"].strip()))
    return entries


def _height_scale(entries: Sequence[_HeadEntry]) -> tuple[float, str]:
    for entry in entries:
        scales = re.fullmatch(_Z_SCALE_KEYS, entry.key) and (entry.unit or "scal" not in entry.key)
        each_step = entry.of == "digit" and not entry.key.startswith(("x", "y"))
        if entry.value and entry.value > 0.0 and entry.of != "sample" and (scales or each_step):
            return entry.value, entry.unit
    for keys in (_Z_UNIT_KEYS, _Z_KEYS, _UNIT_KEYS):
        for entry in entries:
            if entry.value is None and re.fullmatch(keys, entry.key):
                if keys is _Z_UNIT_KEYS and entry.word and not entry.unit:
                    what = f"holds no heights: its values have the unit {entry.word[:40]!r}"
                    raise DataError(what, "export the heights")
                if entry.unit:
                    return 1.0, entry.unit
    return 1.0, ""


def _stated_pitches(
    entries: Sequence[_HeadEntry], rows: int, cols: int
) -> tuple[float | None, float | None, float | None]:
    """Column and row pitch that a heading states, and their unit in mm; None for each that is missing. A number without
    a unit that is the number of columns or rows is a count."""
    lengths = [
        (entry, (entry.value, MM.get(entry.unit)))
        for entry in entries
        if entry.value and entry.value > 0.0 and entry.of != "digit"
        if entry.unit
        or not (entry.value in (rows, cols) or "resolution" in entry.key or entry.word[:1].isalpha())
    ]

    def first(keys: str) -> tuple[float, float | None] | None:
        return next((length for entry, length in lengths if re.fullmatch(keys, entry.key)), None)

    x, y = (first(_PITCH_KEYS[axis]) for axis in "xy")
    each = (
        length for entry, length in lengths if entry.of == "sample" and not entry.key.startswith(("y", "z"))
    )
    x = x or first(_PITCH_KEYS[""]) or next(each, None)
    width, height = (first(_SIZE_KEYS[axis]) for axis in "xy")
    if x is None and width and height:
        x, y = (width[0] / cols, width[1]), (height[0] / rows, height[1])
    if x is None and not any(entry.key.startswith("z ") for entry in entries):
        x = first(_PITCH_KEYS["bare"])
    if x is None:
        return None, None, None
    y = y or x
    return x[0], y[0] * (y[1] / x[1] if x[1] and y[1] else 1.0), x[1] or _xy_mm(entries)


def _xy_mm(entries: Sequence[_HeadEntry]) -> float | None:
    named = (e.unit for keys in (_XY_UNIT_KEYS, _UNIT_KEYS) for e in entries if re.fullmatch(keys, e.key))
    return MM.get(next(named, ""))


def _wyko(head: str, z: NDArray[np.float64]) -> RawMap:
    """Wyko: a line of the file is a column of the map, the lowest row first; heights in wavelengths or nm."""
    number = r"\s+\d+\s+\d+\s+([-+.\deE]+)"
    stated = {
        key: float(line[1]) for key in ("Pixel_size", "Wavelength", "Mult", "Aspect")
        if (line := re.search(rf"(?im)^{key}{number}", head))
    }  # fmt: skip
    flags = re.search(r"(?i)format\s+\d+\s+(\d+)", head)
    nm = 1.0 if flags and flags[1] == "1" else stated.get("Wavelength", 1.0) / stated.get("Mult", 1.0)
    pitch = stated.get("Pixel_size")
    pitches = pitch, pitch and pitch * stated.get("Aspect", 1.0)
    return RawMap(z.T, *pitches, z_mm=1e-6 * nm, xy_mm=1.0, bottom_first=True, rows_stated=True, unit="nm")


def _with_first_row(z: NDArray[np.float64], names: Sequence[str]) -> NDArray[np.float64]:
    axis = [_number(name) for name in names[1:]]
    return np.vstack([[np.nan, *axis], z]) if axis and np.isfinite(axis).all() else z


def _without_axes(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, float] | None:
    """Heights and steps of a matrix with x in its first row and y in its first column; None for any other."""
    pitches = []
    for axis in (z[0, 1:], z[1:, 0]):
        steps = np.diff(axis)
        if len(steps) < 3 or not np.isfinite(steps).all() or steps.mean() == 0.0:
            return None
        if np.abs(steps / steps.mean() - 1.0).max() > 0.02:
            return None
        pitches.append(float(steps.mean()))
    return z[1:, 1:], pitches[0], pitches[1]
