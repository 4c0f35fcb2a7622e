"""Cells that a spreadsheet would calculate."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.texts import escape_formula, unescape_formula


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=cmd|' /C calc'!A0", "'=cmd|' /C calc'!A0"),
        ("+1", "'+1"),
        ("-A7", "'-A7"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "'\t=1"),
        ("＝1", "'＝1"),
        ("\n=1", "'\n=1"),
        ("KX4", "KX4"),
        ("A=1", "A=1"),
        ("'quoted", "'quoted"),
        ("'=1", "''=1"),
        ("", ""),
    ],
)
def test_a_formula_is_text(text: str, cell: str) -> None:
    assert escape_formula(text) == cell
    assert unescape_formula(cell) == text


@given(st.text(alphabet="'=+-@\t\rA1", max_size=6))
def test_every_text_comes_back_and_none_is_calculated(text: str) -> None:
    cell = escape_formula(text)
    assert unescape_formula(cell) == text
    assert cell[:1] not in tuple("=+-@\t\r")
