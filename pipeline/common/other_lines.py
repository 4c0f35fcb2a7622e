"""Other lines of a part than its serial, from the settings.

line = ("date=99/99",)                         anywhere on the part
layout = layout.toml  [lines.lot]
                      format = "AAA99"
                      region = [0, 0.5, 1, 1]  where its middle lies: left, top, right, bottom, as shares
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.errors import FileError, MarksError, require_file
from pipeline.common.settings import ReadSettings, SettingsError, check_line_name, named_line

if TYPE_CHECKING:
    from recognition.belief.part_lines import LineFormat

_MAX_FILE_BYTES = 1_000_000
_KEYS = ("format", "region")
_EXAMPLE = 'write a table for each line: [lines.lot] with format = "AAA99"'
_REGION_HINT = "give left, top, right and bottom as shares, 0 to 1: region = [0.0, 0.5, 1.0, 1.0]"


def other_lines(settings: ReadSettings) -> dict[str, LineFormat]:
    """The lines that should stand on a part beside its serial, by name.

    Raises:
        FileError: a layout that cannot be used.
        SettingsError: a line that is both in the layout and in `line`.
    """
    from recognition.belief.part_lines import LineFormat
    from recognition.language.grammar import Grammar

    found = {} if settings.layout is None else read_layout(settings.layout)
    for name, written in map(named_line, settings.line):
        if name in found:
            raise SettingsError(
                f"line {name} is in the settings and in {settings.layout}", hint="take one of them out"
            )
        found[name] = LineFormat(Grammar.parse(written))
    return found


def read_layout(path: Path) -> dict[str, LineFormat]:
    """The lines of a layout file, by name.

    Raises:
        FileError: no such file, no TOML, no lines in it, or one that cannot be.
    """
    require_file(path, most_bytes=_MAX_FILE_BYTES)
    try:
        written = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(path, f"is not TOML ({error})", "correct that line") from error
    unknown = next((key for key in written if key != "lines"), None)
    if unknown is not None:
        raise FileError(path, f"has {unknown!r}, which no layout has", _EXAMPLE)
    lines = written.get("lines")
    if not isinstance(lines, dict) or not lines:
        raise FileError(path, "names no line", _EXAMPLE)
    return {name: _line(path, name, table) for name, table in lines.items()}


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
    region = table.get("region")
    if region is None:
        return LineFormat(grammar)
    if not isinstance(region, list) or len(region) != 4 or not all(type(n) in (int, float) for n in region):
        raise FileError(path, f"has the region {region!r} at line {name}", _REGION_HINT)
    left, top, right, bottom = map(float, region)
    try:
        return LineFormat(grammar, (left, top, right, bottom))
    except ValueError as error:
        raise FileError(path, f"has the region {region!r} at line {name}", _REGION_HINT) from error
