"""Strings of one length that several rules allow, as layers of states, with exact sums and the best strings.

    place        0          1          2
              .--A--> o --7--> o --4--.        layer i holds the states after i characters; a path through the
    start -> o        |         `--9--> o      layers is a string, each string is one path; states from which
              `--B--> o --1--> o --0--'        the end cannot be reached are left out

A path's probability is the product of the probabilities of its characters at their places. Sweeps over the layers give
the sum over all paths, the part of it that passes through each step, and the best paths in order. The strings are never
listed: 36^8 strings with a check character are 8 layers of 37 states.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.serials import FormatError

Places = NDArray[np.int64]
Beliefs = NDArray[np.float64]
MOST_STATES = 100_000
"""Most states of all layers together: 30 MB with the usual 36 characters, and 0.1 s for each sweep."""


@dataclass(frozen=True, eq=False)
class Machine:
    """One rule as a state machine over the characters of texts of one length: `table` of a place (states, C) has the
    next state of each state and character, -1 where not allowed; `accepts` (states,) whether the text may end there."""

    table: Callable[[int], Places]
    accepts: NDArray[np.bool_]
    start: int = 0


class _Path(NamedTuple):
    cost: float
    char: int
    rank_after: int


@dataclass(frozen=True, eq=False)
class Automaton:
    """Strings of one length, at least one."""

    chars: tuple[str, ...]
    # one per place, (states before, C) int64: the state after each character, -1 where it is not allowed. The
    # first has one row. A string may end in any state after the last place.
    steps: tuple[Places, ...]

    @cached_property
    def places(self) -> tuple[str, ...]:
        return tuple(
            "".join(self.chars[k] for k in np.flatnonzero((step >= 0).any(axis=0))) for step in self.steps
        )

    def accepts(self, codes: Places) -> NDArray[np.bool_]:
        """(words, places) indices of characters -> (words,): which are strings of this automaton."""
        state = np.zeros(codes.shape[0], dtype=np.int64)
        for place, step in enumerate(self.steps):
            state = np.where(state < 0, -1, step[np.maximum(state, 0), codes[:, place]])
        return np.asarray(state >= 0)

    def log_mass(self, log_belief: Beliefs) -> float:
        return float(self._after(log_belief, best=False)[0][0])

    def log_marginals(self, log_belief: Beliefs) -> Beliefs:
        """(places, C): logarithm of the summed probabilities of all strings with this character at this place."""
        out = np.full(log_belief.shape, -np.inf)
        after = self._after(log_belief, best=False)
        before = np.zeros(1)
        for place, step in enumerate(self.steps):
            reach = before[:, None] + np.where(step >= 0, log_belief[place], -np.inf)
            out[place] = _log_sum(reach + after[place + 1][step], axis=0)
            before = _gather(reach, step, after[place + 1].size)
        return out

    def best(self, log_belief: Beliefs) -> Iterator[tuple[str, float]]:
        """Yield strings and their log probabilities, best first, without impossible ones.

        The recursive enumeration algorithm [1]_: each state keeps its best paths to the end, and asks the state after
        a path's first character for one more only when that path has been used. A string takes at most two steps per
        place, however many strings are equally probable.

        .. [1] V. M. Jiménez and A. Marzal, "Computing the K shortest paths: a new algorithm and an experimental
           comparison", WAE 1999, LNCS 1668, 15-29.
        """
        after = self._after(log_belief, best=True)
        # of each state: paths that may be its next best, as a heap, and its best paths, in order
        ranked: dict[tuple[int, int], tuple[list[_Path], list[_Path]]] = {}

        def path(place: int, state: int, rank: int) -> _Path | None:
            step = self.steps[place][state]
            if (place, state) not in ranked:
                costs = np.where(step >= 0, -log_belief[place] - after[place + 1][step], np.inf)
                ways = [_Path(float(costs[k]), int(k), 0) for k in np.flatnonzero(costs < np.inf)]
                heapq.heapify(ways)
                ranked[place, state] = ways, []
            waiting, best = ranked[place, state]
            while len(best) <= rank:
                if best and place + 1 < len(self.steps):
                    _, char, rank_after = best[-1]
                    if after_it := path(place + 1, int(step[char]), rank_after + 1):
                        cost = after_it.cost - float(log_belief[place, char])
                        heapq.heappush(waiting, _Path(cost, char, rank_after + 1))
                if not waiting:
                    return None
                best.append(heapq.heappop(waiting))
            return best[rank]

        for number in count():
            text, state, rank = "", 0, number
            for place, step in enumerate(self.steps):
                if (here := path(place, state, rank)) is None:
                    return
                text, state, rank = text + self.chars[here.char], int(step[state, here.char]), here.rank_after
            yield text, -ranked[0, 0][1][number].cost

    def _after(self, log_belief: Beliefs, *, best: bool) -> list[Beliefs]:
        ends = int(self.steps[-1].max()) + 1
        after = [np.zeros(ends)]
        for place in range(len(self.steps) - 1, -1, -1):
            step = self.steps[place]
            ways = np.where(step >= 0, log_belief[place] + after[-1][step], -np.inf)
            after.append(ways.max(axis=1) if best else _log_sum(ways, axis=1))
        return after[::-1]


@dataclass(frozen=True, eq=False)
class WordList:
    """Strings of one length written out, at least one: a lexicon."""

    chars: tuple[str, ...]
    words: tuple[str, ...]

    @cached_property
    def codes(self) -> Places:
        return encode(self.words, self.chars)

    @cached_property
    def places(self) -> tuple[str, ...]:
        return tuple("".join(self.chars[k] for k in np.unique(column)) for column in self.codes.T)

    def log_mass(self, log_belief: Beliefs) -> float:
        return float(_log_sum(self._scores(log_belief), axis=0))

    def log_marginals(self, log_belief: Beliefs) -> Beliefs:
        out: Beliefs = np.full(log_belief.shape, -np.inf)
        scores = self._scores(log_belief)
        for place, column in enumerate(self.codes.T):
            out[place] = _gather(scores, column, len(self.chars))
        return out

    def best(self, log_belief: Beliefs) -> Iterator[tuple[str, float]]:
        scores = self._scores(log_belief)
        for k in np.argsort(-scores, kind="stable").tolist():
            if scores[k] == -np.inf:
                return
            yield self.words[k], float(scores[k])

    def _scores(self, log_belief: Beliefs) -> Beliefs:
        return np.asarray(log_belief[np.arange(log_belief.shape[0]), self.codes].sum(axis=1))


Strings = Automaton | WordList


def encode(words: Sequence[str], chars: tuple[str, ...]) -> Places:
    """(words, places) int64 indices of characters; the words have one length and only these characters."""
    number = {c: k for k, c in enumerate(chars)}
    flat = np.fromiter((number[c] for word in words for c in word), dtype=np.int64)
    return flat.reshape(len(words), -1)


def unroll(machines: Sequence[Machine], n_places: int, chars: tuple[str, ...]) -> Automaton | None:
    """Automaton of the strings of a length that all machines allow, if any. Raises FormatError for too many states."""
    here = np.array([[m.start for m in machines]], dtype=np.int64)
    steps: list[Places] = []
    states = 0
    for place in range(n_places):
        states += here.shape[0]
        if states > MOST_STATES:
            raise FormatError(
                f"the rules of this format together are too complex: serials of {n_places} characters need more than "
                f"{MOST_STATES:,} states",
                hint="leave one out, or limit the length of the serials",
            )
        allowed = np.ones((here.shape[0], len(chars)), dtype=bool)
        parts = []
        for k, machine in enumerate(machines):
            to = machine.table(place)[here[:, k]]
            allowed &= to >= 0
            parts.append(to)
        if not allowed.any():
            return None
        pairs = np.stack([to[allowed] for to in parts], axis=1) if parts else np.zeros((allowed.sum(), 0))
        here, which = _distinct(pairs.astype(np.int64))
        step = np.full(allowed.shape, -1, dtype=np.int64)
        step[allowed] = which
        steps.append(step)
    good = np.ones(here.shape[0], dtype=bool)
    for k, machine in enumerate(machines):
        good &= machine.accepts[here[:, k]]
    for place in range(n_places - 1, -1, -1):
        number = np.where(good, np.cumsum(good) - 1, -1)
        step = np.where(steps[place] >= 0, number[steps[place]], -1)
        good = np.asarray((step >= 0).any(axis=1))
        steps[place] = step[good]
    return Automaton(chars, tuple(steps)) if n_places and good.any() else None


def _distinct(pairs: Places) -> tuple[Places, Places]:
    if pairs.shape[1] == 0:
        return pairs[:1], np.zeros(pairs.shape[0], dtype=np.int64)
    # one number per row: far faster than comparing rows; numbered anew after each column, so that none overflows
    which = np.zeros(pairs.shape[0], dtype=np.int64)
    for column in pairs.T:
        code = which * (int(column.max()) + 1) + column
        _, first, which = np.unique(code, return_index=True, return_inverse=True)
    return pairs[first], which


def _log_sum(values: Beliefs, axis: int) -> Beliefs:
    top = values.max(axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(values - top).sum(axis=axis)) + np.squeeze(top, axis=axis))


def _gather(values: Beliefs, to: Places, size: int) -> Beliefs:
    values, to = values.ravel(), to.ravel()
    keep = (to >= 0) & (values > -np.inf)
    values, to = values[keep], to[keep]
    top = np.full(size, -np.inf)
    np.maximum.at(top, to, values)
    finite = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.bincount(to, np.exp(values - finite[to]), minlength=size)) + finite)
