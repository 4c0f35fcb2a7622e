"""Check a part against its expected serial: confirmed, refuted or undecided.

    place             1    2    3  ...    same    = product of b(e)               all are as expected
    expected e        K    7    4         unknown = product of (b(e) + r) - same  none differs, not all read
    posterior b(e)   .99  .98  .01        differs = 1 - product of (b(e) + r)     one is clearly another
    none r           .00  .01  .01

A dirty place counts neither for nor against; one character that is clearly another refutes the whole. Other
texts need not fit the format: a wrong serial may break it. At prior 1/2 the lattice's posteriors are used
unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from glyphs.errors import MarksError
from glyphs.surface.display import one_line
from recognition.language.confusions import CharacterState, PlaceState, state_of
from recognition.language.constrained_decoding import choose
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
    """One expected character, or one place that is left over.

    Attributes:
        expected: the expected character; empty for a place that is left over.
        place: place in the lattice, from 0; None for a character without a place.
        state: state of the place; its `char` is the best one.
        probability: posterior of the expected character (of no character, for a place left over).
        rival: best other character; empty if none is possible.
        rival_probability: posterior of the rival.
    """

    expected: str
    place: int | None
    state: PlaceState
    probability: float
    rival: str
    rival_probability: float

    @property
    def message(self) -> str:
        """The finding in words."""
        if self.place is None:
            return f"no place was found for {self.expected}"
        if self.state.state is CharacterState.NOT_READ and self.expected:
            return f"{self.expected} cannot be made out"
        return self.state.message


@dataclass(frozen=True)
class Verification:
    """The verdict and what it rests on.

    Attributes:
        expected: the text, without blanks.
        verdict: the verdict on it.
        probability: probability of the expected text; 0 if the number of characters differs.
        refutation: probability that at least one character is clearly another.
        rival: best other text with as many characters as were found (within the grammar, if one is given);
            empty if none is possible.
        log10_odds: odds of the expected text against that rival, with the prior; +inf without a rival.
        characters: checks in the order of the text; places left over come where they were found.
        places: number of characters found.
    """

    expected: str
    verdict: Verdict
    probability: float
    refutation: float
    rival: str
    log10_odds: float
    characters: tuple[CharacterCheck, ...]
    places: int

    __repr__ = one_line

    def messages(self) -> tuple[str, ...]:
        """Return the differences in words, with places of the text counted from 1."""
        differences = []
        if self.places != len(self.expected):
            differences.append(f"{self.places} characters were found where {len(self.expected)} are expected")
        at = 0
        for check in self.characters:
            at += bool(check.expected)
            if check.state.state is not CharacterState.READ:
                where = f"place {at}" if check.expected else f"after place {at}" if at else "before place 1"
                differences.append(f"{where}: {check.message}")
        return tuple(differences)


def verify(
    lattice: Lattice,
    expected: str,
    *,
    prior: float = 0.5,
    grammar: Grammar | None = None,
    confirm: float = 0.99,
    refute: float = 0.99,
) -> Verification:
    """Compare the posteriors of a line with the text that is expected.

    The lattice must have been made without knowledge of the text, and must allow other characters than the
    expected ones.

    Args:
        lattice: posteriors of the places.
        expected: the text; blanks are ignored.
        prior: probability of the text before the part was felt, between 0 and 1.
        grammar: format of the rival; the expected text must fit it, too.
        confirm: least probability of "same" for CONFIRMED; also, no character may contradict the expected one.
        refute: least probability of "differs" for REFUTED.

    Raises:
        VerifyError: the text is empty, breaks the grammar, or has characters that the lattice lacks; or the
            prior or a limit is out of range.
    """
    text = "".join(expected.split())
    _check(lattice, text, prior, grammar, confirm, refute)
    pairs = _align(lattice, text)
    belief = np.exp(lattice.log_belief)
    nothing = np.maximum(0.0, 1.0 - belief.sum(axis=1))
    column = {c: k for k, c in enumerate(lattice.chars)}
    whole = lattice.n_places == len(text)
    same, not_other = float(whole), 1.0
    checks = []
    for place, char in pairs:
        if place is None:
            state = PlaceState(CharacterState.NOT_READ, "", 0.0, expected=char)
            checks.append(CharacterCheck(char, None, state, 0.0, "", 0.0))
            continue
        beliefs = dict(zip(lattice.chars, belief[place].tolist(), strict=True))
        state = state_of(beliefs, expected=char)
        known = float(belief[place, column[char]]) if char else float(nothing[place])
        rival = max((c for c in lattice.chars if c != char), key=lambda c: beliefs[c], default="")
        against = beliefs.get(rival, 0.0)
        checks.append(CharacterCheck(char, place, state, known, rival if against else "", against))
        if char:
            same *= known
            not_other *= min(1.0, known + float(nothing[place]))
    differs = 1.0 - not_other
    weights = np.array([2.0 * prior * same, 2.0 * (1.0 - prior) * differs, max(0.0, not_other - same)])
    total = float(weights.sum())
    probability, refutation = (float(w) / total if total > 0.0 else 0.0 for w in weights[:2])
    rival_text, odds = _best_rival(lattice, text, prior, grammar, whole)
    contradicted = any(c.state.state is CharacterState.MISMATCH for c in checks)
    verdict = Verdict.UNDECIDED
    if refutation >= refute:
        verdict = Verdict.REFUTED
    elif probability >= confirm and whole and not contradicted:
        verdict = Verdict.CONFIRMED
    return Verification(
        expected=text,
        verdict=verdict,
        probability=probability,
        refutation=refutation,
        rival=rival_text,
        log10_odds=odds,
        characters=tuple(checks),
        places=lattice.n_places,
    )


def _check(
    lattice: Lattice, text: str, prior: float, grammar: Grammar | None, confirm: float, refute: float
) -> None:
    if not text:
        raise VerifyError("the expected text is empty", hint="give the serial that the part should read")
    if not 0.0 < prior < 1.0:
        raise VerifyError(f"prior is {prior}", hint="it must be above 0 and below 1")
    for name, limit in (("confirm", confirm), ("refute", refute)):
        if not 0.5 < limit <= 1.0:
            raise VerifyError(f"{name} is {limit}", hint="it must be above 0.5 and at most 1")
    unknown = sorted(set(text) - set(lattice.chars))
    if unknown and lattice.n_places:
        raise VerifyError(
            f"the expected text {text!r} has {' '.join(unknown)}, which was not looked for",
            hint="read with a font and a format that include it",
        )
    if grammar is not None and (broken := grammar.objections(text)):
        raise VerifyError(
            f"the expected text {text!r} does not fit the format: {'; '.join(broken)}",
            hint="correct one of them",
        )


def _best_rival(
    lattice: Lattice, text: str, prior: float, grammar: Grammar | None, whole: bool
) -> tuple[str, float]:
    """The best other text and the odds (log10) of the expected one against it."""
    choice = choose(lattice, grammar, k=2)
    named = [(choice.text, choice.probability), *((r.text, r.probability) for r in choice.rivals)]
    rival = next((t for t, p in named if t and t != text and p > 0.0), "")
    column = {c: k for k, c in enumerate(lattice.chars)}

    def log_weight(s: str) -> float:
        return math.fsum(float(lattice.log_belief[k, column[c]]) for k, c in enumerate(s))

    if not whole:
        return rival, -math.inf if rival else 0.0
    if not rival:
        return "", math.inf if lattice.n_places else 0.0
    odds = log_weight(text) - log_weight(rival) + math.log(prior / (1.0 - prior))
    return rival, odds / math.log(10.0)


def _align(lattice: Lattice, text: str, *, missing: float = 1e-3) -> list[tuple[int | None, str]]:
    """Align places with expected characters; None or "" stands for a missing partner.

    If there are equally many, they are paired one to one; else by the alignment with the largest product of
    posteriors.

    Args:
        lattice: posteriors of the places.
        text: expected characters.
        missing: likelihood of a place or an expected character that is left over, if their numbers differ.
    """
    n, m = lattice.n_places, len(text)
    if n == m:
        return list(enumerate(text))
    column = {c: k for k, c in enumerate(lattice.chars)}
    cost = math.log(missing)
    # a pair never costs more than leaving both over, so no more than necessary are left over
    worst = 2.0 * cost
    best = np.full((n + 1, m + 1), -np.inf)
    best[:, 0] = cost * np.arange(n + 1)
    best[0, :] = cost * np.arange(m + 1)

    def paired(i: int, j: int) -> float:
        return max(worst, float(lattice.log_belief[i, column[text[j]]]))

    for i in range(n):
        for j in range(m):
            best[i + 1, j + 1] = max(best[i, j] + paired(i, j), best[i, j + 1] + cost, best[i + 1, j] + cost)
    out: list[tuple[int | None, str]] = []
    i, j = n, m
    while i or j:
        if i and j and best[i, j] == best[i - 1, j - 1] + paired(i - 1, j - 1):
            i, j = i - 1, j - 1
            out.append((i, text[j]))
        elif i and (not j or best[i, j] == best[i - 1, j] + cost):
            i -= 1
            out.append((i, ""))
        else:
            j -= 1
            out.append((None, text[j]))
    return out[::-1]
