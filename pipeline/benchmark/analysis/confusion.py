"""Confused characters and edits of trials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from pipeline.benchmark.trials.journal import Trial
from pipeline.common.texts import align


def edits(trial: Trial) -> int:
    """Characters wrong, missing and too many."""
    return sum(not pair.right for pair in align(trial.truth, trial.text))


def characters_right(trial: Trial) -> int:
    """Characters stamped less the edits, not below 0."""
    return max(0, len(trial.truth) - edits(trial))


def confusion(trials: Iterable[Trial]) -> Counter[tuple[str, str]]:
    """Number of (stamped, read) characters; EXTRA is stamped where too much is read, MISSING read where too little."""
    return Counter((p.true, p.read) for trial in trials for p in align(trial.truth, trial.text))


def mistakes(confused: Counter[tuple[str, str]]) -> list[tuple[str, str, int]]:
    """(stamped, read, how often) of different characters, the most frequent first."""
    found = [(true, read, n) for (true, read), n in confused.items() if true != read]
    return sorted(found, key=lambda m: (-m[2], m[0], m[1]))
