r"""Compile Python's regular expressions to state machines, if they only say which characters may follow each other.

    "[A-Z]{2}\d+"  --Python's parser-->  nodes that consume one character or none  -->  states and their table

A state is a set of nodes (subset construction); an expression that needs too many is rejected. Classes are ASCII. The
library greenery takes half a minute for `(A|B|C{2,9}){1,12}D`.
"""

from __future__ import annotations

import re
import string
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from re import _compiler, _parser  # type: ignore[attr-defined]  # from 3.11 on; hypothesis uses the parser as well
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.serials import FormatError
from recognition.language.automaton import Machine

Chars: TypeAlias = frozenset[str]
MOST_LENGTH = 500
MOST_PLACES = 64
"""Longest serial that is considered."""
MOST_CHARACTERS = 200
"""Most different characters of a format. No recogniser knows as many, and each takes memory in every state."""
MOST_NODES, MOST_STATES = 20_000, 4_000
"""Most nodes of an expression with its repeats written out, and most states of its machine."""
MOST_STEPS = 2_000_000
"""Most steps of compilation: two seconds of work. `(A|B|C{2,9}){1,12}D` takes 180,000."""


_BODY = re.compile(r"\^?((?:[^\\]|\\.)*?)\$?", re.DOTALL)
"""An expression without the anchors of a whole text."""


def _written(items: Iterable[tuple[Any, Any]]) -> Iterator[str]:
    for item, value in items:
        match str(item):
            case "LITERAL":
                yield chr(value)
            case "RANGE":
                yield from map(chr, range(value[0], value[1] + 1))
            case "CATEGORY" if str(value) == "CATEGORY_DIGIT":
                yield from string.digits
            case "IN" if str(value[0][0]) != "NEGATE":
                yield from _written(value)
            case "BRANCH":
                for row in value[1]:
                    yield from _written(row)
            case "SUBPATTERN" | "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
                yield from _written(value[-1])


@dataclass(frozen=True, eq=False)
class ExpressionMachine:
    """A deterministic state machine; it starts in state 0; (states, C) next ones are -1 where none may follow."""

    next_state: NDArray[np.int64]
    final: NDArray[np.bool_]

    @property
    def machine(self) -> Machine:
        return Machine(lambda _: self.next_state, self.final)

    def lengths(self) -> frozenset[int]:
        """Lengths of the texts that match, up to `MOST_PLACES`."""
        steps = np.zeros((self.final.size, self.final.size), dtype=bool)
        rows, columns = np.nonzero(self.next_state >= 0)
        steps[rows, self.next_state[rows, columns]] = True
        here = np.zeros(self.final.size, dtype=bool)
        here[0] = True
        lengths = set()
        for length in range(MOST_PLACES + 1):
            if (here & self.final).any():
                lengths.add(length)
            here = np.asarray(steps[here].any(axis=0))
        return frozenset(lengths)


@lru_cache(maxsize=64)
def expression_machine(pattern: str, chars: tuple[str, ...]) -> ExpressionMachine:
    """Compile an expression that must match the whole text to a machine over given characters. Raises FormatError."""
    net = _Net(pattern, frozenset(chars))
    # characters that all parts treat alike share their transitions
    kinds = list(dict.fromkeys(kind for kind, _ in net.eats.values()))
    alike: dict[tuple[bool, ...], list[int]] = {}
    for k, char in enumerate(chars):
        alike.setdefault(tuple(char in kind for kind in kinds), []).append(k)
    ways = {kind: [of for of in alike if of[i]] for i, kind in enumerate(kinds)}
    first = net.reachable({net.begin})
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
                    raise _too_complex(pattern, f"is too complex: it needs more than {MOST_STATES:,} states")
                numbers[state] = len(numbers)
                waiting.append(state)
            row[alike[of]] = numbers[state]
        rows.append(row)
    return ExpressionMachine(np.stack(rows), np.array([net.end in state for state in numbers]))


def written_characters(pattern: str) -> Chars:
    r"""All characters that an expression names, one by one, in a range or as `\d`. Raises FormatError."""
    written = set()
    for char in _written(_parse(pattern)):
        written.add(char)
        if len(written) > MOST_CHARACTERS:
            raise too_many_characters(pattern)
    return frozenset(written)


def too_many_characters(format: str) -> FormatError:
    """The error about a format with more than `MOST_CHARACTERS`."""
    return FormatError(
        f"{format[:80]!r} has more than {MOST_CHARACTERS} different characters", hint="name those that occur"
    )


def _parse(pattern: str) -> Any:
    if not pattern or len(pattern) > MOST_LENGTH:
        raise FormatError(
            f"an expression has 1 to {MOST_LENGTH} characters", hint=f"this one has {len(pattern)}"
        )
    try:
        re.compile(pattern)
        return _parser.parse(_BODY.fullmatch(pattern)[1])  # type: ignore[index]
    except (re.error, OverflowError, RecursionError) as error:
        raise FormatError(f"{pattern!r} is not a regular expression: {error}") from error


def _too_complex(pattern: str, why: str) -> FormatError:
    return FormatError(f"{pattern!r} {why}", hint="give mask: or sets: instead")


class _Net:
    def __init__(self, pattern: str, chars: Chars) -> None:
        items = _parse(pattern)
        self.chars = chars
        self.text = pattern
        self.steps = 0
        self.free: list[list[int]] = []
        self.eats: dict[int, tuple[Chars, int]] = {}
        self.known: dict[str, Chars] = {}
        self.end = self.node()
        if items.state.flags & ~re.UNICODE:
            raise self._more_than_characters()
        self.begin = self._row(items, self.end)

    def node(self, *free: int) -> int:
        if len(self.free) >= MOST_NODES:
            raise _too_complex(
                self.text, f"repeats too much: written out it has more than {MOST_NODES:,} characters"
            )
        self.free.append(list(free))
        return len(self.free) - 1

    def _row(self, items: Any, end: int) -> int:
        for k in range(len(items) - 1, -1, -1):
            end = self._item(items[k : k + 1], end)
        return end

    def _members(self, part: Any) -> Chars:
        if (name := repr(part.data)) not in self.known:
            matches = _compiler.compile(part, re.ASCII).fullmatch
            self.known[name] = frozenset(filter(matches, self.chars))
        return self.known[name]

    def _item(self, part: Any, end: int) -> int:
        ((item, value),) = part
        match str(item):
            case "ANY" | "LITERAL" | "NOT_LITERAL" | "IN":
                node = self.node()
                self.eats[node] = (self._members(part), end)
                return node
            case "SUBPATTERN" if not (value[1] or value[2]):  # a group that sets or clears no options
                return self._row(value[3], end)
            case "BRANCH":
                return self.node(*[self._row(row, end) for row in value[1]])
            case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
                least, most, repeated = value
                return self._repeat(least, most, repeated, end)
        raise self._more_than_characters()

    def _more_than_characters(self) -> FormatError:
        return FormatError(
            f"{self.text!r} says more than which characters follow each other; write it "
            r"with characters, [sets], \d, \w, ., |, (groups), ?, *, + and {m,n} only: no look-ahead, reference or "
            "option, and ^ and $ at the ends or not at all (the whole text is matched anyway)"
        )

    def _repeat(self, least: int, most: int, part: Any, end: int) -> int:
        if part.getwidth()[1] == 0:  # it matches only the empty text
            return end
        if most == _parser.MAXREPEAT:
            loop = self.node(end)
            self.free[loop].append(self._row(part, loop))
            end = loop
        else:
            leave = end
            for _ in range(most - least):
                end = self.node(leave, self._row(part, end))
        for _ in range(least):
            end = self._row(part, end)
        return end

    def reachable(self, nodes: frozenset[int] | set[int]) -> frozenset[int]:
        seen, waiting = set(nodes), list(nodes)
        while waiting:
            on = self.free[waiting.pop()]
            self.steps += 1 + len(on)
            if self.steps > MOST_STEPS:
                raise _too_complex(self.text, f"is too complex: it needs more than {MOST_STEPS:,} steps")
            for node in on:
                if node not in seen:
                    seen.add(node)
                    waiting.append(node)
        return frozenset(seen)
