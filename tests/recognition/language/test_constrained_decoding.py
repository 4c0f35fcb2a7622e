"""The best allowed strings against writing every string out."""

from __future__ import annotations

import itertools
import math
import re
import time
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stdnum import luhn
from stdnum.iso7064 import mod_11_2, mod_37_36, mod_97_10

from recognition.language.constrained_decoding import ROUNDING, blind_warnings, choose
from recognition.language.elements import ELEMENTS
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.remainders import REMAINDERS

EXACT = 1e-9
"""Relative: sums of some thousand products in another order."""
Allowed = Callable[[str], bool]

CASES: dict[str, tuple[tuple[str, ...], str, Allowed]] = {
    "none": ((), "AB12", lambda s: True),
    "mask": (("A99",), "AB12", lambda s: bool(re.fullmatch("[A-Z][0-9]{2}", s))),
    "sets": (("sets:A1,B2,12,A",), "AB12", lambda s: bool(re.fullmatch("[A1][B2][12]A", s))),
    "expression": ((r"re:(A|B\d)+1?",), "AB12", lambda s: bool(re.fullmatch(r"(A|B\d)+1?", s))),
    "variable": ((r"re:A*[12]{1,3}B?",), "AB12", lambda s: bool(re.fullmatch("A*[12]{1,3}B?", s))),
    "luhn": (("check:luhn",), "0459", luhn.is_valid),
    "luhn of a part": (("check:luhn@2-",), "A459", lambda s: s[1:].isdigit() and luhn.is_valid(s[1:])),
    "mod 11-2": (("check:iso7064mod11_2",), "03X7", lambda s: "X" not in s[:-1] and mod_11_2.is_valid(s)),
    "mod 37-36": (("check:iso7064mod37_36",), "A1ZQ0", mod_37_36.is_valid),
    "mod 97-10": (
        ("check:iso7064mod97_10",),
        "AK7052",
        lambda s: len(s) > 2 and s[-2:].isdigit() and mod_97_10.is_valid(s),
    ),
    "both": (
        (r"re:[A-Z]?\d+", "check:luhn@2-+exclude=5"),
        "A1459",
        lambda s: (
            bool(re.fullmatch(r"[A-Z]?\d+", s)) and s[1:].isdigit() and luhn.is_valid(s[1:]) and "5" not in s
        ),
    ),
    "opaque": (("check:stdnum:luhn",), "0459", luhn.is_valid),
}


def strings(grammar: Grammar, chars: str, n: int, allowed: Allowed) -> list[str]:
    """Every allowed string, by trying all; a check digit needs a character to check."""
    own = [check for check in grammar.checks if check not in grammar.opaque]
    if own and n - own[0].first_place + 1 < 2:
        return []
    return [s for s in map("".join, itertools.product(chars, repeat=n)) if allowed(s)]


@st.composite
def lattices(draw: st.DrawFn, chars: str) -> Lattice:
    """Beliefs of all kinds: sure, undecided, impossible characters, places with nothing."""
    n = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    sharp = draw(st.sampled_from([0.0, 1.0, 4.0]))
    weight = np.exp(sharp * rng.normal(size=(n, len(chars))))
    weight[rng.random(weight.shape) < draw(st.sampled_from([0.0, 0.2]))] = 0.0
    nothing = rng.random((n, 1)) * draw(st.sampled_from([0.0, 0.05, 0.9])) * weight.max(initial=1.0)
    with np.errstate(divide="ignore"):
        log = np.log(weight / np.maximum(weight.sum(axis=1, keepdims=True) + nothing, 1e-300))
    return Lattice(tuple(chars), log)


def weight_of(lattice: Lattice, text: str) -> float:
    return math.prod(math.exp(lattice.log_belief[k, lattice.chars.index(c)]) for k, c in enumerate(text))


@pytest.mark.parametrize("name", CASES)
@settings(max_examples=20, deadline=None)
@given(data=st.data(), k=st.integers(1, 6))
def test_as_by_writing_every_string_out(name: str, data: st.DataObject, k: int) -> None:
    texts, chars, allowed = CASES[name]
    lattice = data.draw(lattices(chars))
    grammar = Grammar.parse(*texts) if texts else None
    every = strings(grammar or Grammar(), chars, lattice.n_places, allowed)
    weights = {s: w for s in every if (w := weight_of(lattice, s)) > 0.0}
    choice = choose(lattice, grammar, k=k, most_tests=10_000)

    if not weights:
        assert choice.text == ""
        assert choice.probability == 0.0
        return
    opaque = name == "opaque"
    places = [set(chars) if opaque else {s[i] for s in every} for i in range(lattice.n_places)]
    belief = np.exp(lattice.log_belief)
    some = [sum(belief[i, chars.index(c)] for c in places[i]) for i in range(lattice.n_places)]
    left = 1.0 - belief.sum(axis=1)
    nothing = np.where(left > ROUNDING, left, 0.0)  # beliefs that sum to 1 do so to rounding
    z = math.fsum(weights.values())
    n = max(0.0, math.prod(a + r for a, r in zip(some, nothing, strict=True)) - math.prod(some))
    named = [(choice.text, choice.probability), *((r.text, r.probability) for r in choice.rivals)]
    best = sorted(weights.values(), reverse=True)[:k]
    # an opaque search may end when the strings left hold less than this of all belief
    slack = 2e-4 if opaque else EXACT
    if not opaque:
        assert len(named) == len(best)
    for (text, probability), weight in zip(named, best, strict=False):
        assert weights[text] == pytest.approx(weight, rel=EXACT)
        assert probability == pytest.approx(weight / (z + n), rel=slack, abs=1e-14)
        assert not opaque or probability <= weight / (z + n) * (1.0 + EXACT)
    assert len({text for text, _ in named}) == len(named)
    assert choice.valid_mass == pytest.approx(z, rel=EXACT, abs=1e-4 if opaque else 1e-14)
    for i in range(lattice.n_places):
        for c, char in enumerate(chars):
            share = math.fsum(w for s, w in weights.items() if s[i] == char) / z
            expected = share * some[i] / (some[i] + nothing[i])
            assert choice.places[i, c] <= expected + EXACT
            assert opaque or choice.places[i, c] == pytest.approx(expected, abs=EXACT)


def sure(text: str, *, chars: str, belief: float = 0.98, nothing: float = 0.005) -> Lattice:
    """Each character believed in, the rest spread over the others."""
    p = np.full((len(text), len(chars)), (1.0 - belief - nothing) / (len(chars) - 1))
    p[np.arange(len(text)), [chars.index(c) for c in text]] = belief
    return Lattice(tuple(chars), np.log(p))


ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"


def doubted(text: str, place: int, other: str, share: float) -> Lattice:
    """`text`, but at one place another character holds this share of the belief."""
    lattice = sure(text, chars=ALPHABET)
    p = np.exp(lattice.log_belief)
    column = [ALPHABET.index(c) for c in (text[place], other)]
    p[place, column] = np.array([1.0 - share, share]) * p[place, column].sum()
    return Lattice(lattice.chars, np.log(p))


def test_a_sure_reading_that_breaks_the_check_digit_is_not_made_sure() -> None:
    """All characters clear, check digit wrong: whatever is chosen must not be believed in."""
    wrong = "1M8GDM9AXKP042789"
    choice = choose(sure(wrong, chars=ALPHABET, belief=0.995, nothing=0.002), Grammar.parse("vin"))
    assert choice.text != wrong
    assert choice.valid_mass < 0.01
    assert choice.probability < 0.1


@pytest.mark.parametrize("vin", ["WVWZZZ1KZAW000871", "VF1BB05CF12345678", "JN1TANT31U0012345"])
def test_a_vin_of_a_region_without_a_check_digit_is_read_as_it_stands(vin: str) -> None:
    choice = choose(sure(vin, chars=ALPHABET, belief=0.995, nothing=0.002), Grammar.parse("vin"))
    assert choice.text == vin
    assert choice.probability > 0.9


def test_blind_pairs_that_are_believed_in_are_warned_of() -> None:
    grammar = Grammar.parse("vin")
    vin = "1M8GDM9AXKP042788"
    warned = blind_warnings(choose(doubted(vin, 2, "H", 0.2), grammar), grammar)
    assert list(warned) == [3]
    assert warned[3].startswith("place 3: 8 may be H (")
    # 8 and B differ for the check digit: it settles them, and nothing is to be warned of
    assert blind_warnings(choose(doubted(vin, 2, "B", 0.2), grammar), grammar) == {}
    assert blind_warnings(choose(doubted(vin, 2, "H", 0.2)), Grammar()) == {}


def test_a_lexicon_is_the_same_as_its_words() -> None:
    rng = np.random.default_rng(4)
    words = {"".join(rng.choice(list("AB12"), 3)) for _ in range(20)} | {"AB", "1212"}
    p = rng.dirichlet(np.ones(4) * 0.5, size=3) * 0.97
    lattice = Lattice(tuple("AB12"), np.log(p))
    choice = choose(lattice, Grammar(lexicon=frozenset(words)), k=100)
    of_length = [w for w in words if len(w) == 3]
    assert [choice.text, *(r.text for r in choice.rivals)] == sorted(
        of_length, key=lambda w: -weight_of(lattice, w)
    )
    assert choice.valid_mass == pytest.approx(sum(weight_of(lattice, w) for w in of_length), rel=EXACT)
    share = sum(weight_of(lattice, w) for w in of_length if w[0] == "A") / choice.valid_mass
    some = sum(p[0, "AB12".index(c)] for c in {w[0] for w in of_length})
    assert choice.place(0).get("A", 0.0) == pytest.approx(share * some / (some + 0.03), rel=EXACT)


def test_a_wrong_length_and_no_place_at_all_give_nothing() -> None:
    grammar = Grammar.parse("AA999999")
    for lattice in (sure("AB12345", chars=ALPHABET), Lattice(tuple("AB"), np.empty((0, 2)))):
        choice = choose(lattice, grammar)
        assert (choice.text, choice.probability, choice.rivals) == ("", 0.0, ())


def test_work_is_bounded_and_the_end_of_it_is_said() -> None:
    figures = "0123456789"
    p = np.full((12, 10), 0.099)
    lattice = Lattice(tuple(figures), np.log(p))
    grammar = Grammar.parse("check:stdnum:imei")
    choice = choose(lattice, grammar, most_tests=50)
    assert choice.exhausted
    assert choice.probability < 1e-6
    with pytest.raises(ValueError, match="at least 1"):
        choose(lattice, grammar, k=0)


def test_very_small_beliefs_do_not_vanish() -> None:
    """Beliefs of exp(-900) a place underflow as products; their order and shares must not."""
    log = np.full((4, 3), -900.0)
    log[:, 0] -= np.log(2.0)
    log[:, 2] = -1e-9
    choice = choose(Lattice(tuple("ABC"), log), Grammar.parse("re:[AB]{4}"), k=2)
    assert choice.text == "BBBB"
    assert choice.rivals[0].probability == pytest.approx(choice.probability / 2.0, rel=1e-6)
    assert choice.valid_mass == 0.0


FORMATS = (
    None,
    "vin",
    "vin-na",
    *(f"check:{name}" for name in REMAINDERS),
    "check:stdnum:luhn",
    "check:iso7064mod97_10+check=luhn@2-4",
    *(f"fields:{name}" if name.isalpha() else f"fields:({name})" for name in ELEMENTS),
    "fields:MFR/SER/PNR/LOT",
    "re:(A+)+$",
    "re:.*A.{9}",
    r"re:([A-Z]{1,9}\d{1,9})+",
    "re:(A|B|C{2,9}){1,12}D",
    *(mask * 40 for mask in "Aa9*"),
    "sets:" + ",".join(["0O8B6"] * 40),
)
"""Every named format, and masks, sets and expressions; masks and sets are cut to the length of the line."""


@settings(max_examples=80, deadline=None)
@given(
    format=st.sampled_from(FORMATS),
    places=st.integers(1, 40),
    alphabet=st.sampled_from([ALPHABET, "01", "0O8B6"]),
    levels=st.integers(1, 2),
    seed=st.integers(0, 2**32 - 1),
)
def test_equally_likely_serials_of_any_length_take_no_longer(
    format: str | None, places: int, alphabet: str, levels: int, seed: int
) -> None:
    """36^40 serials of one probability: the best are named within seconds, best first, and allowed."""
    body = None if format is None else format[:places] if format[0] in "Aa9*" else format
    if body is not None and body.startswith("sets:"):
        body = body[: 5 + 6 * places - 1]
    grammar = None if body is None else Grammar.parse(body)
    chars = tuple(sorted({*alphabet, *("" if grammar is None else grammar.characters)}))
    weight = np.random.default_rng(seed).integers(1, levels + 1, size=(places, len(chars)))
    lattice = Lattice(chars, np.log(0.9 * weight / weight.sum(axis=1, keepdims=True)))
    start = time.process_time()
    choice = choose(lattice, grammar, k=6)
    seconds = time.process_time() - start
    named = [choice.text, *(rival.text for rival in choice.rivals)]
    assert seconds < 3.0
    assert len(set(named)) == len(named)
    probabilities = [choice.probability, *(rival.probability for rival in choice.rivals)]
    assert probabilities == sorted(probabilities, reverse=True)
    if choice.text and grammar is not None:
        assert all(map(grammar.allows, named))
