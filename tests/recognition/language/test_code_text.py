"""What codes say, and what is known of one place."""

from __future__ import annotations

import string
from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.language.code_text import CodeField, fields_of, holds
from recognition.language.confusions import SWAP_SETS, CharacterState, state_of, swap_reason

# --------------------------------------------------------------------------------------------------------- code text

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


# -------------------------------------------------------------------------------------------------------- confusions


def test_swaps_go_both_ways_and_have_reasons() -> None:
    for chars in SWAP_SETS:
        for char, partner in permutations(chars, 2):
            assert swap_reason(char, partner) == swap_reason(partner, char) != ""
    assert swap_reason("0", "1") == swap_reason("0", "0") == swap_reason("-", "0") == ""
    for pair in ("0O", "0Q", "0D", "1I", "1L", "17", "2Z", "5S", "8B", "6G"):
        assert swap_reason(*pair) != ""


@pytest.mark.parametrize(
    ("beliefs", "state", "said"),
    [
        ({"8": 0.97, "B": 0.02}, CharacterState.READ, "8 is read"),
        ({"8": 0.5, "B": 0.45}, CharacterState.CONFUSED, "8 or B (the left side"),
        ({"8": 0.5, "7": 0.45}, CharacterState.CONFUSED, "8 or 7"),
        ({"8": 0.3, "B": 0.1}, CharacterState.NOT_READ, "no character"),
        ({"8": 0.45, "B": 0.01, "3": 0.01}, CharacterState.NOT_READ, "no character"),
        (dict.fromkeys("0123456789", 0.1), CharacterState.NOT_READ, "no character"),
        ({}, CharacterState.NOT_READ, "no character"),
        ({"8": 0.0}, CharacterState.NOT_READ, "no character"),
    ],
)
def test_confused_is_not_the_same_as_not_read(
    beliefs: dict[str, float], state: CharacterState, said: str
) -> None:
    state_found = state_of(beliefs)
    assert state_found.state is state
    assert state_found.message.startswith(said)


def test_a_known_character_is_met_doubted_or_contradicted() -> None:
    assert state_of({"8": 0.97, "B": 0.02}, expected="8").state is CharacterState.READ
    contradicted = state_of({"8": 0.97, "B": 0.02}, expected="B")
    assert contradicted.state is CharacterState.MISMATCH
    assert contradicted.message == "8 where B is expected"
    doubted = state_of({"8": 0.6, "B": 0.3}, expected="B")
    assert (doubted.state, doubted.char, doubted.rival) == (CharacterState.CONFUSED, "8", "B")
    assert state_of({"8": 0.1}, expected="B").state is CharacterState.NOT_READ
    assert state_of({"8": 0.9}, expected="").message == "8 where nothing is expected"


@given(st.dictionaries(st.sampled_from("08BDO"), st.floats(0.0, 1.0), max_size=5), st.sampled_from("08-"))
def test_any_beliefs_have_a_state(beliefs: dict[str, float], expected: str) -> None:
    total = sum(beliefs.values())
    shared = {c: p / max(total, 1.0) for c, p in beliefs.items()}
    state_found = state_of(shared, expected=expected)
    assert state_found.message
    if state_found.state is CharacterState.READ:
        assert state_found.char == expected
        assert shared[expected] >= 0.5
    if state_found.state is CharacterState.MISMATCH:
        assert state_found.rival != expected
        assert shared.get(expected, 0.0) <= 0.1 * state_found.probability
    if state_found.state is CharacterState.CONFUSED:
        assert state_found.rival not in ("", state_found.char)


def test_what_are_no_beliefs_is_refused() -> None:
    for wrong in ({"A": 0.7, "B": 0.7}, {"A": -0.1}, {"A": float("nan")}):
        with pytest.raises(ValueError, match="must not be negative"):
            state_of(wrong)
