"""Readings of the same parts in pairs: reader against reader, and one reader given more against given less."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pipeline.benchmark.analysis.confusion import characters_right
from pipeline.benchmark.analysis.groups import GIVEN_FACTOR, GroupKey, group_trials
from pipeline.benchmark.analysis.pairs import CharacterTest, SerialTest, compare_characters, mcnemar
from pipeline.benchmark.exam.condition import GIVEN
from pipeline.benchmark.readers.experts import EXPERT_MODES
from pipeline.benchmark.readers.modes import WITHOUT
from pipeline.benchmark.trials.journal import Trial

SINGLE_MODES = ("tactile", "vision")
FUSED = "fused"


@dataclass(frozen=True)
class Comparison:
    """Two readings of each of the same parts.

    Attributes:
        first: one group of readings.
        second: the group it is compared with.
        parts: how many.
        serials: whole serials compared.
        characters: characters compared.
    """

    first: GroupKey
    second: GroupKey
    parts: int
    serials: SerialTest
    characters: CharacterTest

    @property
    def severity(self) -> float | None:
        """Severity of the dirt; None over all."""
        return self.first.severity


def compare(
    first: GroupKey, first_trials: Sequence[Trial], second: GroupKey, second_trials: Sequence[Trial]
) -> Comparison:
    """Compare two groups of readings of the same parts, each part once in each.

    Raises:
        ValueError: not the same parts.
    """
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
    """At the same levels: fused against the better single sense, a sense against each of its experts, a mode without a
    rule against the whole mode, touch and fused against every other reader.

    Where neither is there, the first reader against the others.
    """
    for levels in dict.fromkeys(key.levels for key in groups):
        here = {key.mode: key for key in groups if key.levels == levels}
        for first, second in _rivals({mode: groups[key] for mode, key in here.items()}):
            yield compare(here[first], groups[here[first]], here[second], groups[here[second]])


def _rivals(readings: Mapping[str, Sequence[Trial]]) -> Iterator[tuple[str, str]]:
    """Modes to be compared, the first with the second."""
    singles = [mode for mode in SINGLE_MODES if mode in readings]
    less = {mode: mode.partition(WITHOUT)[0] for mode in readings if WITHOUT in mode}
    others = [mode for mode in readings if mode not in (*SINGLE_MODES, *EXPERT_MODES, FUSED, *less)]
    yield from ((mode, whole) for mode, whole in less.items() if whole in readings)
    yield from (
        (s, mode) for s in singles for mode in EXPERT_MODES if mode in readings and mode.startswith(s)
    )
    if FUSED in readings:
        if singles:
            yield FUSED, max(singles, key=lambda mode: _merit(readings[mode]))
        yield from ((FUSED, other) for other in others)
    if singles:
        yield from ((singles[0], other) for other in (*singles[1:], *others))
    elif FUSED not in readings:
        yield from ((others[0], other) for other in others[1:])


def between_givens(trials: Sequence[Trial]) -> Iterator[Comparison]:
    """Every reader that was given more, against itself given less: what the knowledge brings."""
    groups = group_trials(trials, (GIVEN_FACTOR,))
    for more in groups:
        for less in groups:
            if less.mode == more.mode and _things(less) < _things(more):
                yield compare(more, groups[more], less, groups[less])


def _things(key: GroupKey) -> frozenset[str]:
    return frozenset(str(key.level(GIVEN_FACTOR)).split(",")) & frozenset(GIVEN)


def _merit(trials: Sequence[Trial]) -> tuple[int, int]:
    """Rank of a mode: serials right, then characters right."""
    return sum(t.right for t in trials), sum(characters_right(t) for t in trials)
