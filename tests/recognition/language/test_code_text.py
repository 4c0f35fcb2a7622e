"""What codes say: fields by every way of writing them, and whether one is the serial."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.language.code_text import CodeField, fields_of, holds

SERIAL = "KB740215"
ISO_06 = "[)>␞06␝17V0AB12␝1PABC-7␝S{}␞␄"
ISO_12 = "[)>␞12␝MFR 0AB12␝SER {}␝PNR ABC-7␞␄"
WAYS = (
    "{}",
    "SER {}",
    "MFR 0AB12/SER {}/PNR ABC-7",
    "SPL 0AB12/UCN {}",
    "(01)09501101530003(10)L7(21){}",
    "(8004)0950110{}",
    ISO_06,
    ISO_12,
    ISO_12.replace("12␝MFR", "DD␝MFR"),
    "[)>␞05␝0109501101530003␝21{}␞␄",
    "[)>␞06␝25SD0AB12{}␞␄",
    "https://id.gs1.org/01/09501101530003/21/{}",
    "https://maker.example/p?sn={}&pn=7",
    "S/N: {}; P/N: ABC-7",
    "Serial No.: {}",
    "ABC-7;{};4711",
)
SERIALS = st.text(string.ascii_uppercase + string.digits, min_size=4, max_size=12)


@pytest.mark.parametrize("way", WAYS)
def test_a_serial_is_found_in_every_way_of_writing_it(way: str) -> None:
    assert holds(way.format(SERIAL), SERIAL) is True
    # one character off, and one too few
    assert holds(way.format("KB740216"), SERIAL) is False
    assert holds(way.format(SERIAL[:-1]), SERIAL) is False


@pytest.mark.parametrize(
    "text",
    [
        "(01)09501101530003(10)KB740215",
        "MFR 0AB12/PNR ABC-7/DMF 20260101",
        "[)>␞06␝17V0AB12␝1PABC-7␞␄",
        "[)>␞12␝MFR 0AB12␝PNR ABC-7␞␄",
        "https://maker.example/valves",
        "https://maker.example",
    ],
)
def test_a_code_of_other_things_says_nothing_of_another_serial(text: str) -> None:
    assert holds(text, "ZZ999999") is None


def test_a_field_that_is_a_serial_goes_before_any_that_looks_like_it() -> None:
    # the part number was read for the serial
    assert holds(ISO_12.format(SERIAL), "ABC-7") is False
    assert holds("MFR 0AB12/PNR ABC-7", "ABC-7") is True


def test_blanks_do_not_count_and_nothing_read_is_in_no_code() -> None:
    assert holds("KB 740 215", "KB74 0215") is True
    assert holds("SER KB740215", "") is False
    # a short serial ends many a longer field by chance
    assert holds("(8004)09501107", "7") is False


def test_fields_have_their_identifiers() -> None:
    assert fields_of(ISO_12.format(SERIAL)) == (
        CodeField("MFR", "0AB12"),
        CodeField("SER", SERIAL),
        CodeField("PNR", "ABC-7"),
    )
    assert fields_of(ISO_06.format(SERIAL)) == (
        CodeField("17V", "0AB12"),
        CodeField("1P", "ABC-7"),
        CodeField("S", SERIAL),
    )
    assert fields_of("(01)09501101530003(21)KB7") == (
        CodeField("01", "09501101530003"),
        CodeField("21", "KB7"),
    )


@given(SERIALS, SERIALS)
def test_only_the_same_serial_is_the_same(written: str, read: str) -> None:
    for way in (ISO_06, ISO_12, "(01)09501101530003(21){}", "MFR 0AB12/SER {}"):
        assert holds(way.format(written), read) is (written == read)


def test_an_address_that_is_none_is_text() -> None:
    assert fields_of("https://[SER/KB7") == (CodeField("", "https://[SER/KB7"),)


@given(st.text(max_size=60), SERIALS)
def test_any_text_has_an_answer(text: str, read: str) -> None:
    assert holds(text, read) in (True, False, None)
    assert all(isinstance(field, CodeField) for field in fields_of(text))
