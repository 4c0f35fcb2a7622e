"""Errors are one line with a hint, come back whole from another process, and hide nothing from who reads them."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.errors import FileError, MarksError, MissingExtraError, report_damage
from glyphs.plain_text import is_hidden, visible
from glyphs.surface.maps import MapError


def test_an_error_is_one_line_of_where_what_and_hint() -> None:
    error = MarksError("is empty", where="a.npz", hint="record it again")
    assert str(error) == "a.npz: is empty; record it again"
    assert str(MarksError("a line\nbroken")) == "a line broken"


@pytest.mark.parametrize(
    "error",
    [
        MarksError("is empty", where="a.npz", hint="record it again"),
        FileError("a.npz", "is empty", "record it again"),
        MissingExtraError("MQTT", "paho-mqtt", "mqtt"),
    ],
)
def test_an_error_comes_back_whole_from_another_process(error: MarksError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert vars(again) == vars(error)
    assert str(again) == str(error)


def test_whatever_a_parser_trips_over_names_the_file_and_keeps_the_hint(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    says = r"a\.npz: is damaged or not a \.npz file \(KeyError: 'z'\); copy"
    with pytest.raises(FileError, match=says), report_damage(path, kind=".npz"):
        raise KeyError("z")
    says = r"a\.npz: heights contain infinities; mark bad points as NaN"
    with pytest.raises(FileError, match=says), report_damage(path, kind=".npz"):
        raise MapError("heights contain infinities", hint="mark bad points as NaN")


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("part-7", "part-7"),
        ("Größe 7 µm, 部品", "Größe 7 µm, 部品"),
        ("\x1b]0;owned\x07\x1b[2Jx", "\\x1b]0;owned\\x07\\x1b[2Jx"),
        ("KX4\u202e152704\u202c", "KX4\\u202e152704\\u202c"),
        ("a\x9b31m", "a\\x9b31m"),
        ("zero\u200bwidth\ufeff", "zero\\u200bwidth\\ufeff"),
        ("half \udcff", "half \\udcff"),
    ],
)
def test_what_hides_is_written_out(text: str, seen: str) -> None:
    assert visible(text) == seen


@given(st.text())
def test_nothing_hidden_is_left_and_the_rest_stays(text: str) -> None:
    assert not any(is_hidden(char) for char in visible(text))
    if not any(is_hidden(char) for char in text):
        assert visible(text) == text


def test_the_message_of_an_error_writes_no_escapes_to_a_terminal() -> None:
    error = FileError("\x1b[31mred.npz", "is damaged\x07", "get\u202e a copy")
    assert str(error) == "\\x1b[31mred.npz: is damaged\\x07; get\\u202e a copy"
