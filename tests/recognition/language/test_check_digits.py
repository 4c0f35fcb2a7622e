"""Check digits against python-stdnum, and the pairs that they cannot see."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from stdnum import ean, luhn
from stdnum.iso7064 import mod_11_2, mod_11_10, mod_37_2, mod_37_36, mod_97_10

from glyphs.fonts.serials import FormatError
from recognition.language.check_digits import CHECK_DIGITS, CheckDigit, blind_pairs
from recognition.language.remainders import ALPHANUMERIC, DIGITS, VIN_CHARACTERS

VIN = "1M8GDM9AXKP042788"
"""49 CFR 565.15(c)(5), the regulation's own example."""
PEERS = {
    "luhn": (luhn, DIGITS, luhn.calc_check_digit),
    "iso7064mod11_2": (mod_11_2, DIGITS, mod_11_2.calc_check_digit),
    "iso7064mod37_2": (mod_37_2, ALPHANUMERIC, mod_37_2.calc_check_digit),
    "iso7064mod97_10": (mod_97_10, ALPHANUMERIC, mod_97_10.calc_check_digits),
    "iso7064mod11_10": (mod_11_10, DIGITS, mod_11_10.calc_check_digit),
    "iso7064mod37_36": (mod_37_36, ALPHANUMERIC, mod_37_36.calc_check_digit),
}


@pytest.mark.parametrize("name", PEERS)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_as_python_stdnum(name: str, data: st.DataObject) -> None:
    peer, alphabet, digits = PEERS[name]
    body = data.draw(st.text(alphabet, min_size=1, max_size=12))
    check = CheckDigit(name)
    good = body + digits(body)
    assert check.holds(good)
    place = data.draw(st.integers(0, len(good) - 1))
    other = good[:place] + data.draw(st.sampled_from(alphabet)) + good[place + 1 :]
    if name != "iso7064mod97_10" or other[-2:].isdigit():
        assert check.holds(other) == peer.is_valid(other)


@given(st.sampled_from([7, 11, 12, 13]).flatmap(lambda n: st.text(DIGITS, min_size=n, max_size=n)))
def test_gs1_as_python_stdnum(body: str) -> None:
    good = body + ean.calc_check_digit(body)
    assert CheckDigit("gs1").holds(good)
    assert CheckDigit("stdnum:ean").holds(good)
    wrong = body + str((int(good[-1]) + 1) % 10)
    assert not CheckDigit("gs1").holds(wrong)


@pytest.mark.parametrize("name", ["vin", "vin-na"])
def test_vin(name: str) -> None:
    check = CheckDigit.parse(name)
    assert check.holds(VIN)
    assert check.holds("1" * 17)  # the well-known test number
    assert check.length == 17
    for k in range(17):
        # every single substitution by a character of another value is seen
        assert not check.holds(VIN[:k] + ("1" if VIN[k] not in "1AJ" else "2") + VIN[k + 1 :])
    assert not check.holds(VIN[:-1])
    assert not check.holds("I" + VIN[1:])


def test_blind_pairs_by_trying_them() -> None:
    """Two characters are blind exactly when swapping them never changes whether a text holds."""
    rng = np.random.default_rng(2)
    check = CheckDigit("vin-na")
    pairs = blind_pairs(check, [VIN_CHARACTERS] * 17)
    assert all(place != 9 for *_, place in pairs)  # at the check digit itself it sees every one
    blind = {frozenset((one, other)) for one, other, _ in pairs}
    for _ in range(300):
        place = int(rng.choice([k for k in range(17) if k != 8]))
        other = str(rng.choice(list(VIN_CHARACTERS)))
        swapped = VIN[:place] + other + VIN[place + 1 :]
        assert check.holds(swapped) == (other == VIN[place] or frozenset((other, VIN[place])) in blind)


@pytest.mark.parametrize("name", [n for n in PEERS if n != "iso7064mod97_10"])
def test_other_rules_see_every_single_error(name: str) -> None:
    assert blind_pairs(CheckDigit(name), [ALPHANUMERIC] * 7) == set()


def test_only_allowed_characters_are_paired() -> None:
    assert blind_pairs(CheckDigit("vin-na"), ["2S", "2"] + ["0"] * 15) == {("2", "S", 1)}
    # an S stands for Europe, where the check digit says nothing
    assert blind_pairs(CheckDigit("vin"), ["2S", "2"] + ["0"] * 15) == set()


@given(st.text(VIN_CHARACTERS, min_size=17, max_size=17))
@example("WVWZZZ1KZAW000871")
@example("LWVWZZZ1KZAW00087")
@example(VIN)
def test_only_north_america_and_china_check_a_vin(text: str) -> None:
    by_region, strict = CheckDigit("vin"), CheckDigit("vin-na")
    assert by_region.holds(text) == (text[0] not in "12345L" or strict.holds(text))
    assert not by_region.holds(text[:-1])
    assert not by_region.holds(text[:8] + "O" + text[9:])


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("ISO 7064 mod 37-2", "iso7064mod37_2"),
        ("iso7064mod97_10", "iso7064mod97_10"),
        ("ISO7064-MOD11,10", "iso7064mod11_10"),
        (" Luhn@3-8 ", "luhn@3-8"),
        ("luhn@2-", "luhn@2-"),
        ("stdnum:imei", "stdnum:imei"),
    ],
)
def test_names_are_taken_in_many_spellings(text: str, name: str) -> None:
    check = CheckDigit.parse(text)
    assert str(check) == name
    assert CheckDigit.parse(str(check)) == check


def test_places_outside_do_not_count() -> None:
    check = CheckDigit.parse("luhn@3-6")
    number = "18" + "1" + luhn.calc_check_digit("181")
    assert check.holds("AB" + number + "ZZ") == luhn.is_valid(number)
    assert check.holds("AB0000ZZ")
    assert not check.holds("AB0001ZZ")
    assert not check.holds("AB0")
    assert not check.holds("AB000")  # a search finds no such text either
    assert check.length is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("crc32", "known are vin, vin-na, luhn"),
        ("luhn@5-2", "looks at no place"),
        ("luhn@0-2", "looks at no place"),
        ("luhn@", "is not a check digit"),
        ("stdnum:no_such", "has no 'no_such'"),
        ("stdnum:os;x", "is not a module"),
        ("stdnum:util", "checks no numbers"),
    ],
)
def test_rules_that_cannot_be_are_said(text: str, said: str) -> None:
    with pytest.raises(FormatError, match=said):
        CheckDigit.parse(text)


def test_a_missing_python_stdnum_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stdnum", None)
    with pytest.raises(FormatError, match=r"tactile-marks\[checkdigits\]"):
        CheckDigit.parse("stdnum:isin")


def test_an_opaque_rule_has_no_machine() -> None:
    with pytest.raises(FormatError, match="whole text"):
        blind_pairs(CheckDigit("stdnum:imei"), [DIGITS] * 15)
    assert CHECK_DIGITS[-1] == "stdnum:NAME"
