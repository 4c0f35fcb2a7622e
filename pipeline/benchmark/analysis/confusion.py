"""Confusion matrix and edits of trials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.benchmark.trials.journal import Trial
from pipeline.common.texts import EXTRA, MISSING, align


def edits(trial: Trial) -> int:
    """Characters wrong, missing and too many."""
    return sum(not pair.right for pair in align(trial.truth, trial.text))


def characters_right(trial: Trial) -> int:
    """Characters stamped less the edits, not below 0."""
    return max(0, len(trial.truth) - edits(trial))


@dataclass(frozen=True, eq=False)
class Confusion:
    """A confusion matrix.

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
