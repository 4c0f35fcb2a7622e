"""Formats and text elements: from text, what they allow, and what is said of those that cannot be."""

from __future__ import annotations

import pickle
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.fonts.serials import FormatError, allowed_characters
from recognition.language.check_digits import CheckDigit
from recognition.language.code_text import holds
from recognition.language.elements import ELEMENTS, named_fields
from recognition.language.grammar import MOST_WORDS, Grammar
from recognition.language.remainders import ALPHANUMERIC, VIN_CHARACTERS

# ----------------------------------------------------------------------------------------------------------- grammar


@given(st.text("A9*X-", min_size=1, max_size=8), st.sampled_from(["", "IOQ", "X1"]))
def test_a_mask_is_that_of_the_serials(format: str, exclude: str) -> None:
    grammar = Grammar(format=format, exclude=exclude)
    places = grammar.places(len(format))
    assert places is not None
    expected = allowed_characters(format, exclude=exclude)
    assert [set(p) for p in places] == [set(p) for p in expected]
    assert grammar.lengths() == {len(format)}
    assert grammar.places(len(format) + 1) is None


def test_blanks_of_a_mask_are_word_gaps() -> None:
    grammar = Grammar.parse("AA 99  9")
    assert grammar.gaps == {1, 3}
    assert grammar.lengths() == {5}
    assert grammar.allows("AB 12 3")
    assert grammar.allows("AB123")


def test_texts() -> None:
    assert Grammar.parse("AA99") == Grammar(format="AA99") == Grammar.parse("mask:AA99")
    assert Grammar.parse("re:A:B") == Grammar(expression="A:B")
    # the + in front of a check digit is not the expression's own
    assert Grammar.parse(r"re:[A-Z]\d++check=luhn@2-") == Grammar(
        expression=r"[A-Z]\d+", checks=(CheckDigit("luhn", 2),)
    )
    assert Grammar.parse("A99+exclude=IO+check=luhn@2-") == Grammar(
        format="A99", checks=(CheckDigit("luhn", 2),), exclude="IO"
    )
    assert Grammar.parse("check:ISO 7064 mod 37-2").checks == (CheckDigit("iso7064mod37_2"),)
    assert Grammar.parse("A9", "re:[AB].").places(2) == ("AB", "0123456789")
    sets = Grammar.parse(r"sets:AB,0-3X,\,\-,A-C1-2").sets
    assert sets == ("AB", "0123X", ",-", "ABC12")
    assert Grammar.parse() == Grammar()
    assert Grammar().lengths() is None
    assert Grammar().places(2) == ("".join(sorted(ALPHANUMERIC)),) * 2


def test_vin() -> None:
    grammar = Grammar.parse("vin-na")
    places = grammar.places(17)
    assert grammar.lengths() == {17}
    assert set(places[8]) == set("0123456789X")
    assert all(set(p) == set(VIN_CHARACTERS) for k, p in enumerate(places) if k != 8)
    assert grammar.allows("1M8GDM9AXKP042788")
    assert grammar.objections("1M8GDM9AXKP042789") == ("the check digit vin-na is wrong",)
    assert not grammar.allows("WVWZZZ1KZAW000871")
    assert grammar.objections("1M8GDM9AXKP04278") == ("vin-na has 17 characters",)
    grammar = Grammar.parse("vin")
    assert Grammar.parse("VIN") == grammar
    assert grammar.places(17) == ("".join(VIN_CHARACTERS),) * 17
    assert grammar.allows("WVWZZZ1KZAW000871")
    assert grammar.allows("1M8GDM9AXKP042788")
    assert grammar.objections("1M8GDM9AXKP042789") == ("the check digit vin is wrong",)


def test_expression_lengths_and_places() -> None:
    grammar = Grammar.parse(r"re:(AB|C)\d{2,3}-?")
    assert grammar.lengths() == {3, 4, 5, 6}
    assert grammar.places(3) == ("C", "0123456789", "0123456789")
    assert set((grammar.places(4) or ("",) * 4)[3]) == set("-0123456789")
    # a wide class means the alphabet, and what the expression writes beside it
    assert set((Grammar.parse("re:.#").places(2) or ("",))[0]) == {*ALPHANUMERIC, "#"}


def test_a_check_digit_narrows_the_last_place() -> None:
    places = Grammar.parse("re:12.+check=luhn").places(3)
    assert places == ("1", "2", "5")


def test_lexicon() -> None:
    words = ["AB 12", "AB12", "CD34", "EFG", " "]
    grammar = Grammar.parse(lexicon=words)
    assert grammar.lengths() == {3, 4}
    assert grammar.places(4) == ("AC", "BD", "13", "24")
    assert Grammar.parse("AA99", lexicon=words).lengths() == {4}
    assert Grammar.parse("sets:A,A-Z,0-9,0-9", lexicon=words).places(4) == tuple("AB12")
    assert grammar.objections("AB13") == ("it is not in the lexicon",)
    assert grammar.allows("A B12")
    numbers = Grammar.parse("check:stdnum:luhn", lexicon=["18", "19", "26"])
    assert numbers.places(2) == ("12", "68")


def test_objections_name_each_part_that_is_broken() -> None:
    grammar = Grammar.parse("A99", r"re:[AB]\d5", "check:luhn@2-")
    assert grammar.allows("A75")
    assert grammar.objections("C78") == (r"it does not fit re:[AB]\d5", "the check digit luhn@2- is wrong")
    assert len(grammar.objections("a75")) == 2
    assert len(grammar.objections("")) == 3
    assert Grammar(exclude="Q").objections("AQ") == ("it does not fit exclude=Q",)


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (("",), "the format is empty"),
        (("   ",), "no serial meets"),
        (("mask:",), "nothing follows"),
        (("AA", "99"), "two of mask"),
        (("sets:A,C", "sets:A,B"), "two of sets"),
        (("vin", "sets:A,B"), "agree in length"),
        (("sets:AB,,1",), "place 2"),
        (("sets:9-0",), "runs backwards"),
        (("A+exclude=" + ALPHANUMERIC,), "exclude fewer"),
        (("AA", "re:[A-Z]{3}"), "agree in length"),
        (("AA", r"re:\d\d"), "agree in length"),
        ((r"re:[A-Z]{2}\s\d",), "write word gaps in a mask:"),
        (("AA+check=luhn",), "no serial meets mask:AA + check=luhn"),
        (("A" * 65,), "at most 64"),
    ],
)
def test_formats_that_cannot_be_are_said(texts: tuple[str, ...], said: str) -> None:
    with pytest.raises(FormatError, match=re.escape(said)):
        Grammar.parse(*texts)


def test_lexicons_that_cannot_be_are_said() -> None:
    with pytest.raises(FormatError, match=f"the lexicon has 0 serials; give 1 to {MOST_WORDS}"):
        Grammar.parse(lexicon=[" "])
    with pytest.raises(FormatError, match="no serial meets"):
        Grammar.parse("99", lexicon=["AB", "1"])
    with pytest.raises(FormatError, match="has 100001 serials"):
        Grammar.parse(lexicon=map(str, range(MOST_WORDS + 1)))


def test_said_as_it_is_read_and_sent_to_workers() -> None:
    for texts in (("AA99+check=iso7064mod97_10",), (r"re:A\d+",), ("vin",)):
        grammar = Grammar.parse(*texts)
        assert pickle.loads(pickle.dumps(grammar)) == grammar
        assert str(grammar)
    assert str(Grammar()) == "any serial"
    assert (
        str(Grammar.parse("99+check=luhn@1-2", lexicon=["18"])) == "mask:99 + lexicon of 1 + check=luhn@1-2"
    )


# ---------------------------------------------------------------------------------------------------------- elements

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
