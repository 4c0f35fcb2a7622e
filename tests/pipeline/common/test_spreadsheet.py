"""Lines of CSV that no spreadsheet calculates, whatever it takes for the delimiter, and that come back as they were."""

from __future__ import annotations

import csv
import io
import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pipeline.common.texts import INVISIBLE, csv_line, unescape_formula

FORMULA = re.compile(r"[\"\s" + INVISIBLE + r"]*[=+\-@＝＋－＠]")
"""Beginning of a cell that is calculated; whether blanks and quotes before the sign count differs between programs."""


def cells_of(line: str, delimiter: str) -> list[str]:
    return [cell for row in csv.reader(io.StringIO(line, newline=""), delimiter=delimiter) for cell in row]


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=cmd|' /C calc'!A0", "'=cmd|' /C calc'!A0"),
        ("+1", "'+1"),
        ("-A7", "'-A7"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "'\t'=1"),
        ("＝1", "'＝1"),
        ("\n=1", "'\n'=1"),
        ("x;=1+1", "x;'=1+1"),
        ("x;y; =1", "x;y;' =1"),
        ('x;"=1"', 'x;\'"=1"'),
        ("\u00a0=1+1", "'\u00a0=1+1"),
        ("KX4", "KX4"),
        ("A=1", "A=1"),
        ("A, -1", "A, -1"),
        ("'quoted", "'quoted"),
        ("'=1", "''=1"),
        ("", ""),
    ],
)
def test_a_formula_is_text(text: str, cell: str) -> None:
    assert cells_of(csv_line([text]), ",") == [cell]
    assert unescape_formula(cell) == text


TEXTS = st.text(alphabet="'\"=+-@;,| \t\r\u00a0\u200bA1", max_size=8)


@settings(max_examples=500)
@given(st.lists(TEXTS, min_size=1, max_size=4))
@example(["a", "x;=cmd|' /C calc'!A1"])
@example(["a", 'x;"', "=1"])
def test_every_text_comes_back_and_no_delimiter_makes_a_formula(texts: list[str]) -> None:
    line = csv_line(texts)
    assert [unescape_formula(cell) for cell in cells_of(line, ",")] == texts
    for delimiter in ",;\t|":
        assert not any(map(FORMULA.match, cells_of(line, delimiter)))


def test_every_cell_is_quoted() -> None:
    assert csv_line(["KX4", 0.5, None, "a,b"]) == '"KX4","0.5","","a,b"\r\n'
