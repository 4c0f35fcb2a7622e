"""Texts that marks show upside down or mirrored: every text of the alphabets that turn into one another."""

from __future__ import annotations

import itertools
import time

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from recognition.language.grammar import Grammar
from recognition.language.orientation import Way, images_of, other_text, readable

TURNING = "0689HINOSXZ"
MIRRORING = "038BCDEHIKOX"
# what a die cuts alike is the same character, whichever way it is read
TWIN = str.maketrans("O", "0")


def shown(text: str, way: Way) -> str:
    """The text that a person reads, of characters whose images have the same shape."""
    table = str.maketrans("69", "96") if way is Way.UPSIDE_DOWN else {}
    return (text[::-1] if way.reverses else text).translate(table)


@pytest.mark.parametrize(
    ("way", "alphabet"),
    [(Way.UPSIDE_DOWN, TURNING), (Way.ROWS_REVERSED, MIRRORING), (Way.LEFT_RIGHT, "08AHIMOTUVWXY")],
)
@pytest.mark.parametrize("places", [1, 2])
def test_every_text_of_turning_characters_is_known_to_read_otherwise(
    way: Way, alphabet: str, places: int
) -> None:
    for text in map("".join, itertools.product(alphabet, repeat=places)):
        other = other_text(text, way, None)
        if shown(text, way).translate(TWIN) == text.translate(TWIN):
            assert other is None, text
        else:
            assert other is not None, text
            assert other.exact
            assert other.text.translate(TWIN) == shown(text, way).translate(TWIN)


@pytest.mark.parametrize("way", list(Way))
def test_images_are_mutual(way: Way) -> None:
    for exact in (True, False):
        for char in "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789abdlnopqsuxz":
            assert all(
                char in images_of(image, way, exact=exact) for image in images_of(char, way, exact=exact)
            )


@given(
    st.text("0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ", min_size=1, max_size=7),
    st.sampled_from(Way),
    st.sampled_from(["*" * 7, "A999999", "9999AAA", None]),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_another_text_is_one_of_the_format_and_reads_back(text: str, way: Way, mask: str | None) -> None:
    grammar = None if mask is None else Grammar(format=mask[: len(text)])
    other = other_text(text, way, grammar)
    if other is None:
        return
    assert other.text != text
    assert grammar is None or grammar.allows(other.text)
    back = other.text[::-1] if way.reverses else other.text
    assert all(c in images_of(o, way, exact=other.exact) for c, o in zip(text, back, strict=True))
    assert readable(text, way, grammar)


@given(st.text("0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ", min_size=1, max_size=40), st.sampled_from(Way))
@example("904817148332", Way.UPSIDE_DOWN)
@example("1" * 40, Way.ROWS_REVERSED)
@example("Z" * 40, Way.LEFT_RIGHT)
@settings(max_examples=40, deadline=None)
def test_long_texts_are_turned_as_fast_as_short_ones(text: str, way: Way) -> None:
    """Each character has up to ten images, and a text of 40 some 10^20 others that are equally likely."""
    start = time.process_time()
    other = other_text(text, way, None)
    assert time.process_time() - start < 1.0
    assert other is None or (other.text != text and len(other.text) == len(text))


@pytest.mark.parametrize(
    ("text", "mask", "way", "other"),
    [
        ("900608", "999999", Way.UPSIDE_DOWN, "809006"),
        ("900608", "999999", Way.LEFT_RIGHT, None),  # not exactly: 9 and 6 have no mirror image
        ("HX9806", "AA9999", Way.UPSIDE_DOWN, None),  # 9086XH is none of the format
        ("HX9806", "******", Way.UPSIDE_DOWN, "9086XH"),
        ("8008", "9999", Way.UPSIDE_DOWN, None),  # the same serial
        ("KB0380", "******", Way.ROWS_REVERSED, None),
        ("R27K", "A99A", Way.ROWS_REVERSED, None),
        ("", "9", Way.UPSIDE_DOWN, None),
    ],
)
def test_the_format_decides(text: str, mask: str, way: Way, other: str | None) -> None:
    found = other_text(text, way, Grammar(format=mask))
    assert (None if found is None or not found.exact else found.text) == other


def test_a_check_digit_or_a_list_of_serials_rules_the_other_text_out() -> None:
    assert (
        other_text("900608", Way.UPSIDE_DOWN, Grammar.parse("999999", lexicon=["900608", "123456"])) is None
    )
    both = Grammar.parse("999999", lexicon=["900608", "809006"])
    other = other_text("900608", Way.UPSIDE_DOWN, both)
    assert other.text == "809006"
    # of these two serials that Luhn's digit allows, one is a serial upside down as well
    luhn = Grammar.parse("99999+check=luhn")
    assert luhn.allows("06098")
    assert luhn.allows("00869")
    other = other_text("00869", Way.UPSIDE_DOWN, luhn)
    assert other is None or not other.exact
    also = other_text("06098", Way.UPSIDE_DOWN, luhn)
    assert luhn.allows(also.text)


@pytest.mark.parametrize(
    ("text", "way"), [("332302", Way.ROWS_REVERSED), ("VAW", Way.UPSIDE_DOWN), ("1881", Way.LEFT_RIGHT)]
)
def test_likely_images_ask_for_a_look(text: str, way: Way) -> None:
    other = other_text(text, way, None)
    assert not other.exact
