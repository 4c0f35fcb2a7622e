"""Names of people and parts, and texts that no spreadsheet calculates."""

from __future__ import annotations

import csv
import io
import re
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from glyphs.plain_text import has_hidden
from pipeline.common.names import HiddenCharacterError, clean_name, folded, printable_name
from pipeline.common.part_id import is_part_id, new_part_id
from pipeline.common.people_records import Person
from pipeline.common.records import ReviewAction, ReviewRecord
from pipeline.common.texts import INVISIBLE, csv_line, unescape_formula

SPELLINGS = (
    "Jörg Müller",
    "Jo\u0308rg Mu\u0308ller",
    "JÖRG MÜLLER",
    " Jörg  Müller ",
    "Jörg\u00a0Müller",
    "Ｊörg Müller",
)
HIDDEN = (
    "Jörg\u200b Müller",
    "Jörg Müller\u202e",
    "Jörg\u034f Müller",
    "Jörg Müller\u3164",
    "Jörg Müller\ufe0f",
    "Jörg\tMüller",
    "Jörg Müller\U000e0041",
    "Jörg Müller\x00",
)


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_all_spellings_of_a_name_are_one_person(spelling: str) -> None:
    assert folded(spelling) == folded(SPELLINGS[0])
    review = ReviewRecord(ReviewAction.CONFIRM, "K1", "K1", SPELLINGS[0], at=datetime.now(UTC))
    assert Person(spelling).wrote(review)
    assert not Person("Jorg Muller").wrote(review)
    assert clean_name(spelling).casefold() == "jörg müller"


@pytest.mark.parametrize("name", HIDDEN)
def test_hidden_characters_are_refused_or_replaced(name: str) -> None:
    with pytest.raises(HiddenCharacterError):
        clean_name(name)
    with pytest.raises(HiddenCharacterError):
        Person(name)
    assert "_" in printable_name(name)
    if "\t" not in name:
        assert folded(name) == folded(SPELLINGS[0])


@given(st.text())
def test_a_name_has_one_form_whatever_it_comes_as(text: str) -> None:
    name = printable_name(text)
    assert not has_hidden(name)
    assert clean_name(name) == name
    assert folded(folded(text)) == folded(text)


def test_they_rise_and_are_unique_over_threads() -> None:
    with ThreadPoolExecutor(8) as pool:
        batches = list(pool.map(lambda _: [new_part_id() for _ in range(500)], range(8)))
    assert all(ids == sorted(ids) for ids in batches)
    assert len({i for ids in batches for i in ids}) == 4000
    assert all(is_part_id(i) for ids in batches for i in ids)


def test_they_begin_with_the_time() -> None:
    digits = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
    before_ms = time.time_ns() // 1_000_000
    shown = new_part_id()[:10]
    told_ms = sum(digits.index(c) * 32**k for k, c in enumerate(reversed(shown)))
    # another test may have made some within this millisecond, never in advance of the clock
    assert before_ms <= told_ms <= time.time_ns() // 1_000_000


def test_they_rise_though_the_clock_is_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    first = new_part_id()
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    second = new_part_id()
    assert second > first
    assert second[:10] == first[:10]


@pytest.mark.parametrize(
    "text",
    ["", "x", "0" * 25, "0" * 27, "8" + "0" * 25, "O" * 26, "../" + "0" * 23, "0" * 26 + "\n", "٠" * 26],
)
def test_what_is_no_name(text: str) -> None:
    assert not is_part_id(text)


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
