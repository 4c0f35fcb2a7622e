"""Which lines stand on a part, and where, from settings and layout files."""

from __future__ import annotations

from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.part_layout import Layout, layout_of, read_layout
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.reading.readers import open_reader
from recognition.belief.part_lines import LineFormat
from recognition.language.grammar import Grammar

LOT = LineFormat(Grammar.parse("AAA99"))


@pytest.fixture
def layout(tmp_path: Path) -> Path:
    path = tmp_path / "layout.toml"
    path.write_text(
        '[lines.lot]\nformat = "AAA99"\nregion = [0, 0.5, 1, 1.0]\n[lines.date]\nformat = "99/99"\n',
        encoding="utf-8",
    )
    return path


def test_no_lines_unless_asked_for() -> None:
    assert layout_of(ReadSettings()) == Layout()


def test_lines_of_settings_and_layout_stand_together(layout: Path) -> None:
    found = layout_of(ReadSettings(line=("heat=re:H[0-9]=[0-9]",), layout=layout)).lines
    assert list(found) == ["lot", "date", "heat"]
    assert found["lot"] == LineFormat(Grammar.parse("AAA99"), (0.0, 0.5, 1.0, 1.0))
    assert found["date"].region is None
    assert found["heat"].grammar.allows("H1=2")  # only the first = ends the name
    assert layout_of(ReadSettings.of(line={"lot": "AAA99"})).lines == {"lot": LOT}


def test_a_line_is_asked_for_once(layout: Path) -> None:
    with pytest.raises(SettingsError, match=r"line lot is in the settings and in .*layout\.toml; take one"):
        layout_of(ReadSettings(line=("lot=AAA99",), layout=layout))


def test_the_serial_has_a_region_too(tmp_path: Path) -> None:
    path = tmp_path / "layout.toml"
    path.write_text("[serial]\nregion = [0, 0, 1, 0.5]\n", encoding="utf-8")
    assert read_layout(path) == Layout(region=(0.0, 0.0, 1.0, 0.5))
    assert open_reader(ReadSettings(layout=path)).settings.region == (0.0, 0.0, 1.0, 0.5)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("lines = ", "is not TOML .*; correct that line"),
        ("\n", "names no line; write a table for each line"),
        ("lines = 3", "names no line"),
        ("[serial]", "names no line"),
        ('[serial]\nformat = "A"', "has 'format' at the serial; it has region"),
        ("[serial]\nregion = [0, 1]", r"the region \[0, 1\] at the serial; give left, top"),
        ('[line.lot]\nformat = "A"', "has 'line', which no layout has; write a table for each line"),
        ("[lines.lot]\nregion = [0, 0, 1, 1]", "says of line lot no format"),
        ("[lines]\nlot = 3", "says of line lot no format"),
        ('[lines."a b"]\nformat = "A"', "has 'a b' among its lines; name a line by letters"),
        ('[lines.lot]\nformat = "re:["', "has a format at line lot that cannot be"),
        ('[lines.lot]\nformat = "A"\nbox = 3', "has 'box' at line lot; a line has format and region"),
        ('[lines.lot]\nformat = "A"\nregion = [0, 1]', r"the region \[0, 1\] at line lot; give left, top"),
        ('[lines.lot]\nformat = "A"\nregion = [0, 0, 1, true]', "the region .* at line lot"),
        ('[lines.lot]\nformat = "A"\nregion = [0, 0.8, 1, 0.2]', "the region .* at line lot; give left, top"),
        ('[lines.lot]\nformat = "A"\nregion = [0, 0, 20, 5]', "as shares, 0 to 1"),
    ],
)
def test_files_that_are_no_layout(written: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "layout.toml"
    path.write_text(written, encoding="utf-8")
    with pytest.raises(FileError, match=rf"layout\.toml: .*{message}"):
        read_layout(path)


def test_a_layout_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="is not there"):
        layout_of(ReadSettings(layout=tmp_path / "none.toml"))
