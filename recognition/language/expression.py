"""Regular expressions as machines that are asked one character a place.

    "[A-Z]{2}\\d+"  -->  tree  -->  nodes that each eat a character, or lead on freely  -->  states and a table

The table is that of the sets of nodes that one can be in; it is given up when it grows too large.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.serials import FormatError
from recognition.language.expression_tree import Choices, Kind, Repeated, expression_tree

__all__ = ["MOST_PLACES", "ExpressionMachine", "FormatError", "expression_machine"]

MOST_PLACES = 64
"""Longest serial that is thought of."""
MOST_NODES, MOST_STATES = 20_000, 4_000
"""Most parts of an expression written out, and most states of its automaton."""
MOST_STEPS = 2_000_000
"""On the way to that machine: two seconds' work at most. `(A|B|C{2,9}){1,12}D` takes 180,000."""


@dataclass(frozen=True, eq=False)
class ExpressionMachine:
    """A deterministic machine; its state 0 is the start.

    Attributes:
        next_state: (states, C) int64, -1 where the character may not follow.
        final: (states,) bool, where the text may end.
    """

    next_state: NDArray[np.int64]
    final: NDArray[np.bool_]

    def start(self, n_places: int) -> int:
        """The state before the first character."""
        return 0

    def table(self, place: int, n_places: int, chars: tuple[str, ...]) -> NDArray[np.int64]:
        """(states, C): the same at every place; the characters are those it was made for."""
        return self.next_state

    def accepts(self, n_places: int) -> NDArray[np.bool_]:
        """(states,): where the text may end."""
        return self.final

    def lengths(self) -> frozenset[int]:
        """Lengths of the texts that match, up to `MOST_PLACES`."""
        steps = np.zeros((self.final.size, self.final.size), dtype=bool)
        rows, columns = np.nonzero(self.next_state >= 0)
        steps[rows, self.next_state[rows, columns]] = True
        here = np.zeros(self.final.size, dtype=bool)
        here[0] = True
        found = set()
        for length in range(MOST_PLACES + 1):
            if (here & self.final).any():
                found.add(length)
            here = np.asarray(steps[here].any(axis=0))
        return frozenset(found)


@lru_cache(maxsize=64)
def expression_machine(pattern: str, chars: tuple[str, ...]) -> ExpressionMachine:
    """The machine that tells which of these characters may follow.

    Args:
        pattern: must match the whole text; `^` in front and `$` at the end change nothing.
        chars: characters that stand at places, without blanks.

    Raises:
        FormatError: not an expression, one that uses look-around, references or options, or one whose
            machine would be too large.
    """
    net = _Net(pattern)
    end = net.node()
    begin = net.choices(expression_tree(pattern), end)
    # characters that no part tells apart go the same ways
    kinds = list(dict.fromkeys(kind for kind, _ in net.eats.values()))
    alike: dict[tuple[bool, ...], list[int]] = {}
    for k, char in enumerate(chars):
        alike.setdefault(tuple(kind.has(char) for kind in kinds), []).append(k)
    ways = {kind: [of for of in alike if of[i]] for i, kind in enumerate(kinds)}
    first = net.reachable({begin})
    numbers = {first: 0}
    rows: list[NDArray[np.int64]] = []
    waiting = deque([first])
    while waiting:
        here = waiting.popleft()
        targets: dict[tuple[bool, ...], set[int]] = {}
        for node in here:
            if node in net.eats:
                kind, after = net.eats[node]
                for of in ways[kind]:
                    targets.setdefault(of, set()).add(after)
        row = np.full(len(chars), -1, dtype=np.int64)
        for of, after_all in targets.items():
            state = net.reachable(frozenset(after_all))
            if state not in numbers:
                if len(numbers) >= MOST_STATES:
                    raise FormatError(f"{pattern!r} is too involved", hint="give mask: or sets: instead")
                numbers[state] = len(numbers)
                waiting.append(state)
            row[alike[of]] = numbers[state]
        rows.append(row)
    return ExpressionMachine(np.stack(rows), np.array([end in state for state in numbers]))


class _Net:
    """Nodes of an expression: each eats one character of a class, or goes on freely to others."""

    def __init__(self, pattern: str) -> None:
        self.text = pattern
        self.steps = 0
        self.free: list[list[int]] = []
        self.eats: dict[int, tuple[Kind, int]] = {}

    def node(self, *free: int) -> int:
        if len(self.free) >= MOST_NODES:
            raise FormatError(f"{self.text!r} repeats too much", hint="give mask: or sets: instead")
        self.free.append(list(free))
        return len(self.free) - 1

    def choices(self, choices: Choices, end: int) -> int:
        """The node from which a text of one of the rows leads to `end`."""
        begins = []
        for row in choices.rows:
            begin = end
            for repeated in reversed(row):
                begin = self._repeat(repeated, begin)
            begins.append(begin)
        return self.node(*begins)

    def _repeat(self, repeated: Repeated, end: int) -> int:
        if repeated.most is None:
            loop = self.node(end)
            self.free[loop].append(self._once(repeated.part, loop))
            end = loop
        else:
            leave = end
            for _ in range(repeated.most - repeated.least):
                end = self.node(leave, self._once(repeated.part, end))
        for _ in range(repeated.least):
            end = self._once(repeated.part, end)
        return end

    def _once(self, part: Kind | Choices, end: int) -> int:
        if isinstance(part, Choices):
            return self.choices(part, end)
        node = self.node()
        self.eats[node] = (part, end)
        return node

    def reachable(self, nodes: frozenset[int] | set[int]) -> frozenset[int]:
        """The nodes and all that they go on to freely."""
        seen, waiting = set(nodes), list(nodes)
        while waiting:
            on = self.free[waiting.pop()]
            self.steps += 1 + len(on)
            if self.steps > MOST_STEPS:
                raise FormatError(f"{self.text!r} is too involved", hint="give mask: or sets: instead")
            for node in on:
                if node not in seen:
                    seen.add(node)
                    waiting.append(node)
        return frozenset(seen)
