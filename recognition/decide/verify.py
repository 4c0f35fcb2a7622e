"""Check a part against its expected serial: confirmed, refuted or undecided.

    place             1    2    3  ...    same    = product of b(e)               all are as expected
    expected e        K    7    4         unknown = product of (b(e) + r) - same  none differs, not all read
    posterior b(e)   .99  .98  .01        differs = 1 - product of (b(e) + r)     one is clearly another
    none r           .00  .01  .01

A dirty place counts neither way; one character that is clearly another refutes the whole. Other texts may break the
format. An accepted reading of the expected text confirms it too: its score also counts what the format excludes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

import numpy as np

from glyphs.errors import MarksError
from glyphs.surface.display import OneLine
from recognition.language.confusions import CharacterState, PlaceState, state_of
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice


class VerifyError(MarksError):
    """An expected text that cannot be verified."""


class Verdict(StrEnum):
    """The verdict on the expected serial."""

    CONFIRMED = "confirmed"
    REFUTED = "refuted"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class CharacterCheck:
    """One expected character, or one extra place where none is expected."""

    place: int | None
    state: PlaceState

    @property
    def message(self) -> str:
        if self.place is None:
            return f"no place was found for {self.state.expected}"
        if self.state.state is CharacterState.NOT_READ and self.state.expected:
            return f"{self.state.expected} cannot be made out"
        return self.state.message


@dataclass(frozen=True, repr=False)
class Verification(OneLine):
    """The verdict and its evidence; the probability is 0 if the number of characters differs."""

    expected: str
    verdict: Verdict
    probability: float
    refutation: float
    characters: tuple[CharacterCheck, ...]
    places: int

    def messages(self) -> tuple[str, ...]:
        """Return the differences in words; of numbers of characters that differ by 2 or more, only those."""
        differences = []
        if self.places != len(self.expected):
            differences.append(f"{self.places} characters were found where {len(self.expected)} are expected")
            if abs(self.places - len(self.expected)) > 1:
                return tuple(differences)
        place = 0
        for check in self.characters:
            place += bool(check.state.expected)
            if check.state.state is not CharacterState.READ:
                beside = f"after place {place}" if place else "before place 1"
                where = f"place {place}" if check.state.expected else beside
                differences.append(f"{where}: {check.message}")
        return tuple(differences)


def verify(
    lattice: Lattice | None,
    expected: str,
    *,
    grammar: Grammar | None = None,
    contradicted: bool = False,
    accepted: float = 0.0,
    least: float = 0.99,
) -> Verification:
    """Compare the posteriors of a line, made without knowledge of the text, with the expected text. Raises VerifyError.

    The lattice must allow other characters. Below a probability of `least`, nothing is confirmed or refuted.
    """
    if lattice is None:
        lattice = Lattice((), np.zeros((0, 0)))
    text = "".join(expected.split())
    if not text:
        raise VerifyError("the expected text is empty", hint="give the serial that the part should read")
    unknown = sorted(set(text) - set(lattice.chars))
    if unknown and lattice.n_places:
        raise VerifyError(
            f"the expected text {text!r} has {' '.join(unknown)}, which the reader does not look for",
            hint="read with a font and a format that include it",
        )
    if grammar is not None and (broken := grammar.objections(text)):
        raise VerifyError(
            f"the expected text {text!r} does not fit the format: {'; '.join(broken)}",
            hint="correct one of them",
        )
    belief = np.exp(lattice.log_belief)
    nothing = np.maximum(0.0, 1.0 - belief.sum(axis=1))
    whole = lattice.n_places == len(text)
    same, not_other = float(whole), 1.0
    checks = []
    for place, char in _align(lattice, text):
        if place is None:
            checks.append(CharacterCheck(None, PlaceState(CharacterState.NOT_READ, "", 0.0, expected=char)))
            continue
        beliefs = dict(zip(lattice.chars, belief[place].tolist(), strict=True))
        checks.append(CharacterCheck(place, state_of(beliefs, expected=char)))
        if char:
            same *= beliefs[char]
            not_other *= min(1.0, beliefs[char] + float(nothing[place]))
    contradicted |= any(c.state.state is CharacterState.MISMATCH for c in checks)
    verdict = Verdict.UNDECIDED
    if 1.0 - not_other >= least:
        verdict = Verdict.REFUTED
    elif (same >= least or (whole and accepted)) and not contradicted:
        verdict, same = Verdict.CONFIRMED, max(same, accepted)
    return Verification(text, verdict, same, 1.0 - not_other, tuple(checks), lattice.n_places)


def _align(lattice: Lattice, text: str, *, missing: float = 1e-3) -> Sequence[tuple[int | None, str]]:
    n, m = lattice.n_places, len(text)
    if n == m:
        return list(enumerate(text))
    cost = math.log(missing)

    @cache
    def best(i: int, j: int) -> tuple[float, tuple[tuple[int | None, str], ...]]:
        ways: list[tuple[int, int, float, tuple[int | None, str]]] = []
        if i and j:
            log_belief = float(lattice.log_belief[i - 1, lattice.chars.index(text[j - 1])])
            # a pair never costs more than leaving both over, so no more than necessary are left over
            ways.append((i - 1, j - 1, max(2.0 * cost, log_belief), (i - 1, text[j - 1])))
        if i:
            ways.append((i - 1, j, cost, (i - 1, "")))
        if j:
            ways.append((i, j - 1, cost, (None, text[j - 1])))
        steps = ((best(*before), worth, pair) for *before, worth, pair in ways)
        tried = [(log + worth, (*pairs, pair)) for (log, pairs), worth, pair in steps]
        return max(tried, key=lambda candidate: candidate[0], default=(0.0, ()))

    return best(n, m)[1]
