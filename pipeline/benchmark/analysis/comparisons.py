"""Paired readings of the same parts: by two readers, by one reader with more or fewer facts, perturbed or not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipeline.benchmark.analysis.estimates import (
    CharacterTest,
    SerialTest,
    compare_characters,
    exact_share,
    mcnemar,
)
from pipeline.benchmark.analysis.groups import GIVEN_FACTOR, GroupKey, characters_right, group_trials
from pipeline.benchmark.exam.condition import GIVEN
from pipeline.benchmark.readers.modes import EXPERTS, WITHOUT
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.shares import Share

SINGLE_MODES = ("tactile", "vision")
FUSED = "fused"


@dataclass(frozen=True)
class Comparison:
    """Two groups of readings of each of the same parts."""

    first: GroupKey
    second: GroupKey
    parts: int
    serials: SerialTest
    characters: CharacterTest

    @property
    def severity(self) -> float | None:
        return self.first.severity


def compare(
    first: GroupKey, first_trials: Sequence[Trial], second: GroupKey, second_trials: Sequence[Trial]
) -> Comparison:
    """Compare two groups of readings of the same parts, each once in each. Raises ValueError: other parts."""
    others = {t.part: t for t in second_trials}
    if set(others) != {t.part for t in first_trials} or not len(others) == len(first_trials) == len(
        second_trials
    ):
        raise ValueError("a paired test needs the same parts on both sides, each once")
    pairs = [(t, others[t.part]) for t in first_trials]
    return Comparison(
        first=first,
        second=second,
        parts=len(pairs),
        serials=mcnemar([a.right for a, _ in pairs], [b.right for _, b in pairs]),
        characters=compare_characters(
            [characters_right(a) for a, _ in pairs],
            [characters_right(b) for _, b in pairs],
            [len(a.truth) for a, _ in pairs],
        ),
    )


def between_readers(groups: Mapping[GroupKey, Sequence[Trial]]) -> Iterator[Comparison]:
    """Compare, at the same levels: fused with the better single sense, a sense with its experts, a mode without a rule
    with the full mode, touch and fused (or else the first reader) with every other reader."""
    for levels in dict.fromkeys(key.levels for key in groups):
        here = {key.mode: key for key in groups if key.levels == levels}
        for first, second in _rivals({mode: groups[key] for mode, key in here.items()}):
            yield compare(here[first], groups[here[first]], here[second], groups[here[second]])


def _rivals(readings: Mapping[str, Sequence[Trial]]) -> Iterator[tuple[str, str]]:
    singles = [mode for mode in SINGLE_MODES if mode in readings]
    less = {mode: mode.partition(WITHOUT)[0] for mode in readings if WITHOUT in mode}
    others = [mode for mode in readings if mode not in (*SINGLE_MODES, *EXPERTS, FUSED, *less)]
    yield from ((mode, whole) for mode, whole in less.items() if whole in readings)
    yield from ((s, mode) for s in singles for mode in EXPERTS if mode in readings and mode.startswith(s))
    if FUSED in readings:
        if singles:
            yield FUSED, max(singles, key=lambda mode: _merit(readings[mode]))
        yield from ((FUSED, other) for other in others)
    if singles:
        yield from ((singles[0], other) for other in (*singles[1:], *others))
    elif FUSED not in readings:
        yield from ((others[0], other) for other in others[1:])


def between_givens(trials: Sequence[Trial]) -> Iterator[Comparison]:
    """Compare every reader with itself when it knows fewer facts, to show the benefit of knowledge."""
    groups = group_trials(trials, (GIVEN_FACTOR,))
    for more in groups:
        for less in groups:
            if less.mode == more.mode and _facts(less) < _facts(more):
                yield compare(more, groups[more], less, groups[less])


def _facts(key: GroupKey) -> frozenset[str]:
    return frozenset(str(key.level(GIVEN_FACTOR)).split(",")) & frozenset(GIVEN)


def _merit(trials: Sequence[Trial]) -> tuple[int, int]:
    return sum(t.right for t in trials), sum(characters_right(t) for t in trials)


@dataclass(frozen=True)
class Fault:
    """An accepted serial that became another accepted serial under a perturbation."""

    part: str
    perturbation: str
    truth: str
    before: str
    after: str


@dataclass(frozen=True)
class Stability:
    """Flips of the parts of one reader under one perturbation."""

    key: GroupKey
    perturbation: str  # empty: any of them, each part counted once
    verdicts: Share  # share of parts with another decision, where an error counts as a decision
    texts: Share
    accepted_texts: Share  # share of the parts accepted unperturbed that were read with another text
    faults: tuple[Fault, ...]  # parts accepted both times, with different texts


def unperturbed(trials: Sequence[Trial]) -> list[Trial]:
    """The trials of unperturbed parts."""
    return [t for t in trials if not t.perturbed]


def stability_of(trials: Sequence[Trial]) -> tuple[Stability, ...]:
    """One result per reader over all perturbations, then one per perturbation; empty without perturbations."""
    several = len({t.given for t in trials}) > 1
    stabilities: list[Stability] = []
    for key, members in group_trials(trials, (GIVEN_FACTOR,) if several else ()).items():
        before = {t.part: t for t in members if not t.perturbed}
        pairs = [(before[t.part], t) for t in members if t.perturbed]
        for name in dict.fromkeys(name for _, t in pairs for name in ("", t.perturbed)):
            stabilities.append(_stability(key, name, [p for p in pairs if name in ("", p[1].perturbed)]))
    return tuple(stabilities)


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
