"""Text elements and application identifiers: what they allow, where their blanks stand, what comes out by name."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.fonts.serials import FormatError
from recognition.language.code_text import holds
from recognition.language.elements import ELEMENTS, named_fields
from recognition.language.grammar import Grammar

GTIN = "09501101530003"
"""A good one, of the GS1 General Specifications' examples."""


@pytest.mark.parametrize(
    ("format", "good", "bad"),
    [
        ("fields:SER", "SER RRFASTRGV61196", "SEK RRFASTRGV61196"),
        ("fields:SER AA999999", "SER KB740215", "SER KB74021"),
        ("fields:MFR/SER", "MFR 0AB12/SER 7-2", "MFR 0AB1/SER 7-2"),
        ("fields:MFR", "MFR D0272", "MFR DO272"),  # a CAGE code has no O
        ("fields:DMF", "DMF 20261231", "DMF 20261331"),
        (f"fields:(01){'9' * 14}(21)AA99", f"(01){GTIN}(21)KB74", f"(01){GTIN[:-1]}4(21)KB74"),
        ("fields:(17)(10)", "(17)271231(10)L-7.2", "(17)271331(10)L-7.2"),
        (r"fields:(10)\Aa9", "(10)Ab7", "(10)Bb7"),
    ],
)
def test_a_marking_obeys_its_elements(format: str, good: str, bad: str) -> None:
    grammar = Grammar.parse(format)
    assert grammar.allows(good)
    assert not grammar.allows(bad)
    assert Grammar.parse(str(grammar).split(" + ")[0]) == grammar


def test_blanks_stand_after_names_and_nowhere_else() -> None:
    grammar = Grammar.parse("fields:MFR/SER")
    assert grammar.spaces("MFR0AB12/SERKB74") == {2, 11}
    assert Grammar.parse("fields:(21)").spaces("(21)SER7") == frozenset()
    assert Grammar.parse("re:[A-Z]+").spaces("SERKB") is None
    assert Grammar.parse("AA 9").spaces("AB1") == {1}


@given(st.from_regex(r"[A-Z0-9]{1,15}", fullmatch=True), st.from_regex(r"[0-9A-HJ-NP-Z]{5}", fullmatch=True))
def test_values_come_out_by_name(serial: str, maker: str) -> None:
    text = f"MFR {maker}/SER {serial}"
    assert Grammar.parse("fields:MFR/SER").allows(text)
    assert named_fields(text) == {"MFR": maker, "SER": serial}
    assert named_fields(f"(01){GTIN}(21){serial}") == {"01": GTIN, "21": serial}
    # a code that holds the serial agrees with a marking that says its name before it
    assert holds(f"[)>␞12␝MFR {maker}␝SER {serial}␞␄", text) is True
    assert holds(f"SER {serial}X", text) is False


@pytest.mark.parametrize("text", ["KB740215", "AB 99-7/4", "(7)KB", "SERKB74", ""])
def test_what_says_no_names_has_no_fields(text: str) -> None:
    assert named_fields(text) == {}


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("fields:XYZ", "there is no element 'XYZ'"),
        ("fields:(99)", r"there is no element '99'"),
        ("fields:(01)(21", "cannot be parsed"),
        ("fields:(10)(01)", "has no fixed place"),
        ("fields:", "nothing follows"),
    ],
)
def test_what_is_no_element_is_refused(text: str, match: str) -> None:
    with pytest.raises(FormatError, match=match):
        Grammar.parse(text)


@pytest.mark.parametrize("key", ELEMENTS)
def test_every_element_is_a_format(key: str) -> None:
    assert Grammar.parse(f"fields:({key})" if key.isdigit() else f"fields:{key}").lengths()
