"""Stability of readings: decisions and texts that flip under perturbations that should not matter.

part --read as it is-----> text, decision --+
     --perturbed, read---> text, decision --+--> flips of each perturbation; a fault where both are accepted and differ
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.benchmark.analysis.groups import GIVEN_FACTOR, GroupKey, group_trials
from pipeline.benchmark.analysis.shares import exact_share
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.shares import Share


@dataclass(frozen=True)
class Fault:
    """An accepted serial that became another accepted serial.

    Attributes:
        part: its name.
        perturbation: that did it.
        truth: what was stamped.
        before: accepted as it is.
        after: accepted under the perturbation.
    """

    part: str
    perturbation: str
    truth: str
    before: str
    after: str


@dataclass(frozen=True)
class Stability:
    """Flips of the parts of one reader under one perturbation.

    Attributes:
        key: the reader, and what it was given where that differs.
        perturbation: its name; empty: under any of them, a part counted once.
        verdicts: parts with another decision, an error being one.
        texts: parts with another text.
        accepted_texts: of the parts accepted as they are, those with another text.
        faults: accepted both times, with another text.
    """

    key: GroupKey
    perturbation: str
    verdicts: Share
    texts: Share
    accepted_texts: Share
    faults: tuple[Fault, ...]


def unperturbed(trials: Sequence[Trial]) -> list[Trial]:
    """The trials of parts read as they are."""
    return [t for t in trials if not t.perturbed]


def stability_of(trials: Sequence[Trial]) -> tuple[Stability, ...]:
    """One a reader and perturbation, and before these one a reader under any; none where nothing was perturbed."""
    several = len({t.given for t in trials}) > 1
    found: list[Stability] = []
    for key, members in group_trials(trials, (GIVEN_FACTOR,) if several else ()).items():
        before = {t.part: t for t in members if not t.perturbed}
        pairs = [(before[t.part], t) for t in members if t.perturbed]
        for name in dict.fromkeys(name for _, t in pairs for name in ("", t.perturbed)):
            found.append(_stability(key, name, [p for p in pairs if name in ("", p[1].perturbed)]))
    return tuple(found)


def _stability(key: GroupKey, perturbation: str, pairs: Sequence[tuple[Trial, Trial]]) -> Stability:
    parts = {a.part for a, _ in pairs}
    accepted = {a.part for a, _ in pairs if a.accepted}
    texts = {a.part for a, b in pairs if a.text != b.text}
    return Stability(
        key,
        perturbation,
        verdicts=exact_share(len({a.part for a, b in pairs if a.decision != b.decision}), len(parts)),
        texts=exact_share(len(texts), len(parts)),
        accepted_texts=exact_share(len(texts & accepted), len(accepted)),
        faults=tuple(
            Fault(a.part, b.perturbed, a.truth, a.text, b.text)
            for a, b in pairs
            if a.accepted and b.accepted and a.text != b.text
        ),
    )
