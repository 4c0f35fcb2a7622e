"""Declared swaps, and what is known of one place."""

from __future__ import annotations

from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.language.confusions import (
    SWAP_SETS,
    CharacterState,
    state_of,
    swap_reason,
)


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
