"""Text that can be seen."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.errors import FileError
from glyphs.plain_text import is_hidden, visible


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
