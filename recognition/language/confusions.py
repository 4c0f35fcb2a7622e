"""Sets of characters that are easily confused, and the state of each place, for people: they change no probability."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

SWAP_SETS = {
    "0OQD": "closed round outlines; the tail of Q and the corners of D are short",
    "1IL7": "one upright; flag, serifs and foot are short or missing in some fonts",
    "2Z": "the bow of 2 has a corner in narrow fonts",
    "5S": "the corners of 5 wear round",
    "8B": "the left side of 8 is nearly straight in narrow fonts",
    "6G": "the bow of 6 stays open where it is struck shallow",
    "38": "3 closed by grime, or 8 with its left side filled",
    "69": "alike after half a turn",
    "MW": "alike after half a turn",
    "UV": "the bottom of U is narrow",
    "VY": "a short stem is filled",
    "CG": "the bar of G is short",
    "PR": "the leg of R is filled or was not struck",
    "EF": "the foot of E is filled or was not struck",
    "OC": "the right side of O is filled",
    "4A": "4 closed at the top, with a low bar",
    "KX": "the upright of K is filled",
    "MN": "one diagonal of M is filled",
}
"""Characters that are easily confused, and why."""


def swap_reason(char: str, other: str) -> str:
    """Reason why two characters are easily confused; empty if no set has both."""
    return next(
        (why for chars, why in SWAP_SETS.items() if char != other and char in chars and other in chars), ""
    )


class CharacterState(StrEnum):
    """States of a place."""

    READ = "read"
    CONFUSED = "confused"
    NOT_READ = "not read"
    MISMATCH = "mismatch"


@dataclass(frozen=True)
class PlaceState:
    """The state of one place; `rival` is the confused character, or the one read in place of the expected one."""

    state: CharacterState
    char: str
    probability: float
    rival: str = ""
    expected: str = ""

    @property
    def chars(self) -> tuple[str, ...]:
        match self.state:
            case CharacterState.CONFUSED:
                return (self.char, self.rival)
            case CharacterState.MISMATCH:
                return (self.rival, self.expected)
        return ()

    @property
    def message(self) -> str:
        match self.state:
            case CharacterState.READ:
                return f"{self.char} is read"
            case CharacterState.CONFUSED:
                reason = swap_reason(self.char, self.rival)
                return f"{self.char} or {self.rival}" + (f" ({reason})" if reason else "")
            case CharacterState.NOT_READ:
                return "no character can be made out"
            case CharacterState.MISMATCH:
                return f"{self.rival} where {self.expected or 'nothing'} is expected"


def state_of(
    probabilities: Mapping[str, float],
    *,
    expected: str | None = None,
    # least probability of the best character, and its least lead over the second, for a place to count as read;
    # acceptance of the reading has thresholds of its own
    read_belief: float = 0.5,
    read_margin: float = 0.3,
    nothing_belief: float = 0.5,
    share_of_first: float = 0.25,
    mismatch_share: float = 0.1,
) -> PlaceState:
    """Return the state of a place; `expected` is "" where no character is. The rest of the probabilities to 1 is "no
    character"; in a tie the first wins. Raises ValueError."""
    total = math.fsum(probabilities.values())
    if not total <= 1.0 + 1e-6 or any(not p >= 0.0 for p in probabilities.values()):
        raise ValueError(
            f"probabilities {dict(probabilities)} must not be negative, nor add up to more than 1"
        )
    ranked = sorted(probabilities.items(), key=lambda item: -item[1])
    (char, first), (second_char, second) = (*ranked, ("", 0.0), ("", 0.0))[:2]
    state_is = partial(PlaceState, expected=expected or "")
    if first == 0.0:
        return state_is(CharacterState.NOT_READ, "", 0.0)
    clear = first >= read_belief and first - second >= read_margin
    shared = first + second >= read_belief and second >= share_of_first * first
    if 1.0 - total >= nothing_belief or not (clear or shared):
        return state_is(CharacterState.NOT_READ, char, first)
    if expected is not None and char != expected:
        if probabilities.get(expected, 0.0) < mismatch_share * first:
            return state_is(CharacterState.MISMATCH, char, first, char)
        return state_is(CharacterState.CONFUSED, char, first, expected)
    if clear:
        return state_is(CharacterState.READ, char, first)
    return state_is(CharacterState.CONFUSED, char, first, second_char)
