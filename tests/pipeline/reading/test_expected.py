"""What parts should read."""

from __future__ import annotations

from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.settings import SettingsError
from pipeline.reading.expected import load_expected
from recognition.language.grammar import Grammar


def test_one_text_for_all_or_a_table(tmp_path: Path) -> None:
    assert load_expected(" AB 18 ") == "AB 18"
    path = tmp_path / "wanted.csv"
    path.write_text("part,text\na.npz,AB18\nb,AB81\n", encoding="utf-8")
    table = load_expected(str(path))
    assert table == {"a": "AB18", "b": "AB81"}
    # a table by any other name is one too, a text with a point in it is none
    assert load_expected(str(path.rename(tmp_path / "wanted"))) == table
    assert load_expected("A.B") == "A.B"


def test_what_cannot_be_expected_is_told_before_the_run(tmp_path: Path) -> None:
    grammar = Grammar(format="AA99")
    with pytest.raises(
        SettingsError, match="--verify is 'AB1', but it does not fit the format AA99; correct"
    ):
        load_expected("AB1", grammar)
    with pytest.raises(SettingsError, match="--verify is empty"):
        load_expected(" ")
    with pytest.raises(FileError, match="is not there"):
        load_expected(str(tmp_path / "none.csv"))
    path = tmp_path / "wanted.csv"
    path.write_text("part,text\na,AB18\nb,\n", encoding="utf-8")
    with pytest.raises(FileError, match="gives no text for b"):
        load_expected(str(path))
    path.write_text("part,text\na,AB18\nb,AB1\n", encoding="utf-8")
    with pytest.raises(
        FileError, match=r"wanted\.csv: b should read 'AB1', but it does not fit the format AA99"
    ):
        load_expected(str(path), grammar)
