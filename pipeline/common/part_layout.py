"""What lines stand on a part, and where, from the settings.

line = ("date=99/99",)                         anywhere on the part
layout = layout.toml  [serial]
                      region = [0, 0, 1, 0.5]  where its middle lies: left, top, right, bottom, as shares
                      [lines.lot]
                      format = "AAA99"
                      region = [0, 0.5, 1, 1]
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from glyphs.errors import FileError, MarksError, require_file
from pipeline.common.settings import ReadSettings, SettingsError, check_line_name, named_line

if TYPE_CHECKING:
    from recognition.belief.part_lines import LineFormat, Region

_MAX_FILE_BYTES = 1_000_000
_KEYS = ("format", "region")
_EXAMPLE = 'write a table for each line: [lines.lot] with format = "AAA99"'
_TABLES = ("serial", "lines")
_REGION_HINT = "give left, top, right and bottom as shares, 0 to 1: region = [0.0, 0.5, 1.0, 1.0]"


@dataclass(frozen=True)
class Layout:
    """What stands where on a part.

    Attributes:
        region: of the serial; None where it may stand anywhere.
        lines: that should stand beside it, by name.
    """

    region: Region | None = None
    lines: Mapping[str, LineFormat] = field(default_factory=lambda: MappingProxyType({}))


def layout_of(settings: ReadSettings) -> Layout:
    """The lines that should stand on a part.

    Raises:
        FileError: a layout that cannot be used.
        SettingsError: a line that is both in the layout and in `line`.
    """
    from recognition.belief.part_lines import LineFormat
    from recognition.language.grammar import Grammar

    layout = Layout() if settings.layout is None else read_layout(settings.layout)
    found = dict(layout.lines)
    for name, written in map(named_line, settings.line):
        if name in found:
            raise SettingsError(
                f"line {name} is in the settings and in {settings.layout}", hint="take one of them out"
            )
        found[name] = LineFormat(Grammar.parse(written))
    return replace(layout, lines=found)


def read_layout(path: Path) -> Layout:
    """A layout file.

    Raises:
        FileError: no such file, no TOML, neither serial nor lines in it, or one that cannot be.
    """
    require_file(path, most_bytes=_MAX_FILE_BYTES)
    try:
        written = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(path, f"is not TOML ({error})", "correct that line") from error
    unknown = next((key for key in written if key not in _TABLES), None)
    if unknown is not None:
        raise FileError(path, f"has {unknown!r}, which no layout has", _EXAMPLE)
    serial, lines = written.get("serial", {}), written.get("lines", {})
    if not isinstance(serial, dict) or not isinstance(lines, dict) or not (serial or lines):
        raise FileError(path, "names no line", _EXAMPLE)
    unknown = next((key for key in serial if key != "region"), None)
    if unknown is not None:
        raise FileError(
            path, f"has {unknown!r} at the serial", "it has region; its format is a setting of its own"
        )
    return Layout(
        _region(path, "the serial", serial),
        {name: _line(path, name, table) for name, table in lines.items()},
    )


def _line(path: Path, name: str, table: Any) -> LineFormat:
    from recognition.belief.part_lines import LineFormat
    from recognition.language.grammar import Grammar

    try:
        check_line_name(name)
    except ValueError as error:
        raise FileError(
            path, f"has {name!r} among its lines", "name a line by letters, digits, _ and -"
        ) from error
    if not isinstance(table, dict) or not isinstance(table.get("format"), str):
        raise FileError(path, f"says of line {name} no format", _EXAMPLE)
    unknown = next((key for key in table if key not in _KEYS), None)
    if unknown is not None:
        raise FileError(path, f"has {unknown!r} at line {name}", f"a line has {' and '.join(_KEYS)}")
    try:
        grammar = Grammar.parse(table["format"])
    except MarksError as error:
        raise FileError(
            path, f"has a format at line {name} that cannot be: {error.what}", error.hint
        ) from error
    return LineFormat(grammar, _region(path, f"line {name}", table))


def _region(path: Path, whose: str, table: Mapping[str, Any]) -> Region | None:
    """The region that a table names, if it does.

    Raises:
        FileError: one that is none.
    """
    from recognition.belief.part_lines import check_region

    region = table.get("region")
    if region is None:
        return None
    if not isinstance(region, list) or len(region) != 4 or not all(type(n) in (int, float) for n in region):
        raise FileError(path, f"has the region {region!r} at {whose}", _REGION_HINT)
    left, top, right, bottom = map(float, region)
    try:
        check_region((left, top, right, bottom))
    except ValueError as error:
        raise FileError(path, f"has the region {region!r} at {whose}", _REGION_HINT) from error
    return (left, top, right, bottom)
