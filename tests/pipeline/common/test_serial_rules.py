"""Serials among serials, and what a serial may be by settings and files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from pipeline.common.serial_format import read_lexicon, serial_format
from pipeline.common.serial_rules import (
    WINDOW,
    NumberedSerial,
    ProductionOrder,
    SerialAlarm,
    SerialRules,
    split_serial,
)
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.truth import read_order
from recognition.language.grammar import Grammar


def judged(rules: SerialRules, serials: list[str | None]) -> list[bool]:
    """Which serials of a lot their places speak against; None: a part that was not read with certainty."""
    flags = []
    for now, text in enumerate(serials):
        before = [
            (now - k, serial) for k, serial in reversed(list(enumerate(serials[:now]))) if serial is not None
        ]
        flags.append(text is not None and rules.by_place(text, before[: 4 * WINDOW]) is not None)
    return flags


def row(n: int, start: int = 407_200) -> list[str | None]:
    return [f"KX{start + k}" for k in range(n)]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("KX407251", NumberedSerial("KX", 407251, 6, "")),
        ("A1-0099B", NumberedSerial("A1-", 99, 4, "B")),
        ("KX 407 251", NumberedSerial("KX", 407251, 6, "")),
        ("KX", None),
    ],
)
def test_the_last_run_of_digits_counts(text: str, place: NumberedSerial | None) -> None:
    assert split_serial(text) == place


def test_one_misread_is_flagged_alone() -> None:
    lot = row(60)
    lot[30] = "KX407930"  # a 2 read as a 9
    assert [k for k, flag in enumerate(judged(SerialRules(jump=20), lot)) if flag] == [30]


def test_a_new_row_is_asked_about_a_few_times_and_then_taken() -> None:
    lot = row(30) + row(30, start=500_000)
    flags = judged(SerialRules(jump=20), lot)
    assert [k for k, flag in enumerate(flags) if flag] == list(range(30, 30 + WINDOW // 2 + 1))


def test_another_series_is_asked_about() -> None:
    rules = SerialRules(jump=20)
    before = [(k, f"KX{407230 - k}") for k in range(1, 10)]
    other, ahead = rules.by_place("AB407230", before), rules.by_place("KX407299", before)
    assert other is not None
    assert ahead is not None
    assert other.alarm is SerialAlarm.OUT_OF_SEQUENCE
    assert other.why == "AB407230 does not match the preceding series KX..."
    assert ahead.why == "KX407299 is 69 ahead of the parts before it"


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.2), st.floats(0.0, 0.5))
def test_misreads_and_parts_left_out_condemn_no_right_part(seed: int, misread: float, unread: float) -> None:
    """While a majority of every window is right, no right part is flagged."""
    rng = np.random.default_rng(seed)
    lot = row(120)
    wrong = set()
    for k in range(len(lot)):
        drawn = rng.random()
        # no more than every fourth, so that of nine in a row most are right
        if drawn < misread and not wrong & {k - 1, k - 2, k - 3}:
            lot[k], wrong = f"KX{int(rng.integers(0, 10**6)):06d}", wrong | {k}
        elif drawn > 1.0 - unread:
            lot[k] = None
    flags = judged(SerialRules(jump=20), lot)
    assert not [k for k, flag in enumerate(flags) if flag and k not in wrong]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_parts_in_no_row_are_never_asked_about(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lot: list[str | None] = [f"KX{int(n):06d}" for n in rng.integers(0, 10**6, 80)]
    # by chance a window may hold a majority within the jump, which is not to be expected here
    assert sum(judged(SerialRules(jump=20), lot)) == 0


def test_an_order_is_read_from_a_list_or_ranges(tmp_path: Path) -> None:
    path = tmp_path / "lot-7.csv"
    for text in ("KX407251\nKX407252\n", "# of today\nKX407250..KX407259\n"):
        path.write_text(text, encoding="utf-8")
        order = read_order(path)
        assert order.holds("KX407251")
        assert order.holds("KX 407252")
        assert not order.holds("KX407351")
        assert not order.holds("KX0407251")
    against = SerialRules(order=order).by_order("KX9")
    assert against is not None
    assert against.why == "KX9 is not in lot-7.csv"
    for text, says in (
        ("# none\n", "holds no serial"),
        ("KX1..AB9\n", "is not a range"),
        ("KX9..KX1\n", "is not a"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=says):
            read_order(path)
    assert not ProductionOrder("empty").holds("KX1")


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def grammar(**given: object) -> Grammar:
    grammar_of_settings = serial_format(ReadSettings(**given))
    assert grammar_of_settings is not None
    return grammar_of_settings


def test_nothing_said_is_no_grammar() -> None:
    assert serial_format(ReadSettings()) is None


def test_a_mask_is_as_before() -> None:
    assert grammar(format=("AA 99",)) == Grammar(format="AA 99")


@pytest.mark.usefixtures("empty_folder")
def test_all_that_is_given_holds_together() -> None:
    Path("known.txt").write_text(
        "# press 3\nAB 18   # scrapped\n\nAB26\nAB34\nAI18\nCD26\n", encoding="utf-8"
    )
    serials = grammar(format=("AA99+exclude=I", "re:A.*", "check:luhn@3-"), lexicon=Path("known.txt"))
    # by Luhn 1-8, 2-6 and 3-4 are good; CD26 breaks the expression, AI18 has an I
    tried = ("AB18", "AB26", "AB34", "AI18", "CD26", "AB42")
    assert [text for text in tried if serials.allows(text)] == ["AB18", "AB26", "AB34"]
    assert not grammar(format=("AA99", "check:luhn@3-")).allows("AB19")
    assert grammar(format=("re:.*+exclude=IOQ",)).allows("K7")
    assert not grammar(format=("re:.*+exclude=IOQ",)).allows("Q7")


@pytest.mark.usefixtures("empty_folder")
def test_what_cannot_be_met_is_told_by_key() -> None:
    Path("known.txt").write_text("AB123\n", encoding="utf-8")
    with pytest.raises(SettingsError, match="format and lexicon cannot be met: no serial meets mask:AA99"):
        grammar(format=("AA99",), lexicon=Path("known.txt"))
    with pytest.raises(SettingsError, match=r"format is \('AA99', 'AA999'\): the format has two of mask"):
        ReadSettings.of(format=("AA99", "AA999"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "is not there"),
        (b"", "is empty"),
        (b"# nothing\n \n", "holds no serial; write one per line"),
        (b"\xff\xfeA\n", "UTF-8"),
        (b"AB\x0712\n", "printable"),
    ],
)
def test_files_that_are_no_lexicon(content: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "known.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=message):
        read_lexicon(path)


def test_a_number_sign_within_a_serial_is_its_own(tmp_path: Path) -> None:
    path = tmp_path / "known.txt"
    path.write_bytes(b"\xef\xbb\xbfA#1\r\nB2 # two\r\n")
    assert read_lexicon(path) == {"A#1", "B2"}
