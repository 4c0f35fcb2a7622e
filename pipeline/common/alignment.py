"""Which character was read for which: a true serial beside the one that was read.

Serials of one length are compared place by place, for the places are known::

    true   A B 1 2 3        of another length the fewest edits are taken       true   A B 1 2 3
    read   A 8 1 2 3        (Levenshtein), EXTRA and MISSING where one has     read   A   1 2 3 7
                            nothing beside it                                         MISSING   EXTRA
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.trials import Trial

MISSING = "nothing"
"""Read for a character that was stamped: nothing."""
EXTRA = "nothing stamped"
"""Stamped for a character that was read: nothing."""


@dataclass(frozen=True)
class Pair:
    """A place of the alignment.

    Attributes:
        true: character stamped, or EXTRA.
        read: character read, or MISSING.
        place: of the character read, from 0; None where none was.
    """

    true: str
    read: str
    place: int | None

    @property
    def right(self) -> bool:
        """Whether it was read as it was stamped."""
        return self.true == self.read


def align(true: str, read: str) -> tuple[Pair, ...]:
    """The two serials beside each other, left to right."""
    if len(true) == len(read):
        return tuple(Pair(t, r, k) for k, (t, r) in enumerate(zip(true, read, strict=True)))
    cost = np.zeros((len(true) + 1, len(read) + 1), dtype=np.int64)
    cost[:, 0], cost[0, :] = np.arange(len(true) + 1), np.arange(len(read) + 1)
    for i, t in enumerate(true, start=1):
        for j, r in enumerate(read, start=1):
            cost[i, j] = min(cost[i - 1, j - 1] + (t != r), cost[i - 1, j] + 1, cost[i, j - 1] + 1)
    pairs = []
    i, j = len(true), len(read)
    while i or j:
        if i and j and cost[i, j] == cost[i - 1, j - 1] + (true[i - 1] != read[j - 1]):
            i, j = i - 1, j - 1
            pairs.append(Pair(true[i], read[j], j))
        elif i and cost[i, j] == cost[i - 1, j] + 1:
            i -= 1
            pairs.append(Pair(true[i], MISSING, None))
        else:
            j -= 1
            pairs.append(Pair(EXTRA, read[j], j))
    return tuple(reversed(pairs))


def characters_right(trial: Trial) -> int:
    """Characters stamped less the edits (wrong, missing, too many), not below 0."""
    edits = sum(not pair.right for pair in align(trial.truth, trial.text))
    return max(0, len(trial.truth) - edits)


@dataclass(frozen=True, eq=False)
class Confusion:
    """What was read for what.

    Attributes:
        true: names of the rows: characters stamped, in order, EXTRA last if there was any.
        read: names of the columns: characters read, in order, MISSING last if there was any.
        counts: (rows, columns) how often.
    """

    true: tuple[str, ...]
    read: tuple[str, ...]
    counts: NDArray[np.int64]

    def mistakes(self) -> list[tuple[str, str, int]]:
        """(true, read, how often) of what was confused, the most frequent first."""
        found = [
            (t, r, int(self.counts[i, j]))
            for i, t in enumerate(self.true)
            for j, r in enumerate(self.read)
            if t != r and self.counts[i, j]
        ]
        return sorted(found, key=lambda m: (-m[2], m[0], m[1]))


def confusion(trials: Iterable[Trial]) -> Confusion:
    """The confusion matrix of some trials."""
    counts = Counter((p.true, p.read) for trial in trials for p in align(trial.truth, trial.text))
    true = _ordered({t for t, _ in counts}, EXTRA)
    read = _ordered({r for _, r in counts}, MISSING)
    matrix = np.zeros((len(true), len(read)), dtype=np.int64)
    for (t, r), n in counts.items():
        matrix[true.index(t), read.index(r)] = n
    return Confusion(true, read, matrix)


def _ordered(names: set[str], last: str) -> tuple[str, ...]:
    return (*sorted(names - {last}), *((last,) if last in names else ()))
