"""Constrained decoding: the best serial that the format allows, with its probability.

    lattice: 8 0.6  B 0.3 | 5 0.7  S 0.2 | ...        grammar: format, check digit ...
    b_i(c): belief in c at place i                    a_i: sum of b_i over the characters that some allowed
    r_i = 1 - sum of b_i: "no character"                   string of this length has at place i

    w(s) = product of b_i(s_i)                        belief in a string
    Z    = sum of w over all allowed strings          the serial is read whole
    N    = product of (a_i + r_i) - product of a_i    at least one place has no character
    probability of s = w(s) / (Z + N)

The best *allowed* string is found, and Z is exact: see `automaton`. N is exact for formats and sets; otherwise it is an
upper bound. The format is assumed to hold; its own probability by the lattice is the valid mass, Z.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from recognition.language.check_digits import blind_pairs
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice

ROUNDING = 1e-12
"""Greatest rounding error of a place's sum of probabilities."""


@dataclass(frozen=True)
class Rival:
    """Another allowed string and its probability."""

    text: str
    probability: float


@dataclass(frozen=True, eq=False, repr=False)
class Choice(OneLine):
    """The best text of a lattice under a grammar, and its rivals; one character per place, without blanks."""

    text: str
    # w / (Z + N), see the module. With an opaque check digit, a lower bound: strings that were not tested
    # count against it.
    probability: float
    rivals: tuple[Rival, ...]
    chars: tuple[str, ...]
    # (places, C) probability of each character at each place under the grammar: its share of Z, times a_i /
    # (a_i + r_i). The rest of a row to 1 is "no character", or unknown.
    places: NDArray[np.float64]
    # Z, the lattice's own probability of all allowed strings together (an upper bound with an opaque check
    # digit)
    valid_mass: float
    exhausted: bool = False

    def place(self, k: int) -> dict[str, float]:
        order = np.argsort(-self.places[k], kind="stable")
        return {self.chars[c]: float(self.places[k, c]) for c in order if self.places[k, c] > 0.0}


# cached: a part is decided on several times, by the camera's own look, by touch alone, and with its expected text
@lru_cache(maxsize=32)
def choose(
    lattice: Lattice, grammar: Grammar | None = None, *, k: int = 5, most_tests: int = 2_000
) -> Choice:
    """Find the best strings that the grammar allows, and their probabilities. Raises ValueError."""
    if k < 1 or most_tests < 1:
        raise ValueError(f"k is {k} and most_tests is {most_tests}; both must be at least 1")
    log, chars, n = lattice.log_belief, lattice.chars, lattice.n_places
    grammar = grammar if grammar is not None else Grammar(alphabet="".join(chars))
    strings = grammar.strings(n, chars) if n and chars else None
    log_z = strings.log_mass(log) if strings is not None else -math.inf
    if strings is None or log_z == -math.inf:
        return Choice("", 0.0, (), chars, np.zeros(log.shape), 0.0)
    inside = np.array([[c in place for c in chars] for place in strings.places])
    log_allowed = np.logaddexp.reduce(np.where(inside, log, -math.inf), axis=1)
    nothing = _nothing(log)
    log_n = _log_with_holes(log_allowed, nothing)
    log_d = float(np.logaddexp(log_z, log_n))
    exhausted = False
    if grammar.opaque and grammar.lexicon is None:
        tested = _test_strings(strings.best(log), log_z, log_d, grammar, lattice, most_tests)
        best_strings, exhausted = tested.valid[:k], tested.gave_up
        of_z = tested.good + tested.left
        log_d = float(np.logaddexp(log_z + _log(of_z), log_n))
        share = tested.by_place / max(of_z, 1e-300)
        log_z += _log(of_z)
    else:
        best_strings = list(islice(strings.best(log), k))
        share = np.exp(strings.log_marginals(log) - log_z)
    named = [Rival(text, math.exp(min(0.0, weight - log_d))) for text, weight in best_strings]
    best = named[0] if named else Rival("", 0.0)
    return Choice(
        text=best.text,
        probability=best.probability,
        rivals=tuple(named[1:]),
        chars=chars,
        places=np.minimum(share, 1.0) * np.exp(log_allowed - _log_added(log_allowed, nothing))[:, None],
        valid_mass=min(1.0, math.exp(log_z)),
        exhausted=exhausted,
    )


@dataclass
class _Tested:
    by_place: NDArray[np.float64]
    valid: list[tuple[str, float]] = field(default_factory=list)
    good: float = 0.0
    left: float = 1.0
    gave_up: bool = False


def _test_strings(
    strings: Iterator[tuple[str, float]],
    log_z: float,
    log_d: float,
    grammar: Grammar,
    lattice: Lattice,
    most_tests: int,
    *,
    resolved: float = 1e-4,
) -> _Tested:
    number = {c: i for i, c in enumerate(lattice.chars)}
    tested = _Tested(np.zeros(lattice.log_belief.shape))
    for text, weight in islice(strings, most_tests):
        share = math.exp(weight - log_z)
        # sums of shares are accurate to about 1e-12: a smaller rest is not treated as zero
        tested.left = max(tested.left - share, 1e-12)
        if all(check.holds(text) for check in grammar.opaque):
            tested.valid.append((text, weight))
            tested.good += share
            tested.by_place[np.arange(len(text)), [number[c] for c in text]] += share
        beside = tested.good + math.exp(log_d - log_z) - 1.0
        if tested.valid and tested.left <= resolved * (tested.left + beside):
            return tested
    tested.gave_up = next(strings, None) is not None
    tested.left *= tested.gave_up
    return tested


def _nothing(log: NDArray[np.float64]) -> NDArray[np.float64]:
    left = 1.0 - np.exp(log).sum(axis=1)
    return np.where(left > ROUNDING, left, 0.0)


def _log_added(log_allowed: NDArray[np.float64], nothing: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(divide="ignore"):
        return np.asarray(np.logaddexp(log_allowed, np.log(nothing)))


def _log_with_holes(log_allowed: NDArray[np.float64], nothing: NDArray[np.float64]) -> float:
    whole = float(log_allowed.sum())
    more = float(_log_added(log_allowed, nothing).sum()) - whole
    # log(exp(more) - 1), accurate for small and large values
    return whole + more + math.log(-math.expm1(-more)) if more > 0.0 else -math.inf


def _log(value: float) -> float:
    return math.log(value) if value > 0.0 else -math.inf


def blind_warnings(choice: Choice, grammar: Grammar, *, least: float = 0.01) -> dict[int, str]:
    """Warn, by place, of each character that no check digit distinguishes from another probable one."""
    rules = [check for check in grammar.checks if check.remainder is not None]
    if not choice.text or not rules:
        return {}
    beliefs = [choice.place(k) for k in range(len(choice.text))]
    allowed = ["".join(belief) for belief in beliefs]
    blind = frozenset.intersection(*(blind_pairs(rule, allowed) for rule in rules))
    names = " and ".join(str(rule) for rule in rules)
    return {
        k: f"place {k}: {char} may be {other} ({believed:.0%}), which the check digit {names} cannot tell apart"
        for k, (char, belief) in enumerate(zip(choice.text, beliefs, strict=True), start=1)
        for other, believed in belief.items()
        if other != char and believed >= least and (min(char, other), max(char, other), k) in blind
    }
