"""Compare two benchmarks of the same parts, reading by reading."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from glyphs.errors import MarksError
from pipeline.benchmark.analysis.comparisons import Comparison, compare, unperturbed
from pipeline.benchmark.analysis.groups import GIVEN_FACTOR, GroupKey, group_trials, levels_in
from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.texts import first_of
from pipeline.common.version import differences

_NOT_OF_PARTS = ("name", "given", "kept_out_soils", "cross")


class NotComparableError(MarksError):
    """The two benchmarks did not read the same parts."""


class Flip(Enum):
    """Kinds of change of a reading, the most serious first."""

    ACCEPTED_WRONG = "newly accepted wrong"
    LOST = "right before, wrong now"
    NOT_ACCEPTED = "right and accepted before, not accepted now"
    WITHDRAWN = "wrong and accepted before, not accepted now"
    GAINED = "wrong before, right now"
    ACCEPTED = "right before, accepted now"


@dataclass(frozen=True)
class Change:
    """One reading that changed: in A before, in B after."""

    flip: Flip
    before: Trial
    after: Trial

    @property
    def reader(self) -> str:
        return GroupKey(self.after.mode, ((GIVEN_FACTOR, self.after.given),)).reader


@dataclass(frozen=True)
class Row:
    """Paired comparison of the readings of B (first) with those of A, at a factor's level or, without one, over all."""

    factor: str
    level: Level
    compared: Comparison


@dataclass(frozen=True)
class Changes:
    """Differences between two benchmarks: rows of paired readers, and changed readings, the most serious first."""

    overall: tuple[Row, ...]
    by_factor: tuple[Row, ...]
    flips: tuple[Change, ...]
    parts: int
    left_out: tuple[str, ...]

    @property
    def counts(self) -> dict[str, Counter[Flip]]:
        counts: dict[str, Counter[Flip]] = {row.compared.first.reader: Counter() for row in self.overall}
        for change in self.flips:
            counts[change.reader][change.flip] += 1
        return counts


def changes(
    before: Sequence[Trial],
    after: Sequence[Trial],
    descriptions: tuple[Mapping[str, Any], Mapping[str, Any]] | None = None,
) -> Changes:
    """Compare the unperturbed parts of two benchmarks, A and B. Raises NotComparableError: other parts or readers."""
    if descriptions is not None:
        _check_made_alike(*(d["parts"] for d in descriptions))
    before, after = unperturbed(before), unperturbed(after)
    _check_same_parts(before, after)
    old, new = group_trials(before, (GIVEN_FACTOR,)), group_trials(after, (GIVEN_FACTOR,))
    shared = [key for key in new if key in old]
    if not shared:
        raise NotComparableError(
            "no reader is in both benchmarks with the same facts",
            hint=f"A has {_readers(old)}. B has {_readers(new)}",
        )
    pairs = {(t.part, t.mode, t.given): t for t in before}
    flips = [
        Change(flip, was, now)
        for key in shared
        for now in new[key]
        if (flip := flip_of(was := pairs[(now.part, now.mode, now.given)], now)) is not None
    ]
    flips.sort(key=lambda change: list(Flip).index(change.flip))
    return Changes(
        overall=tuple(Row("", None, compare(key, new[key], key, old[key])) for key in shared),
        by_factor=tuple(row for key in shared for row in _rows(key, new[key], old[key])),
        flips=tuple(flips),
        parts=len({t.part for t in after}),
        left_out=tuple(sorted(key.reader for key in {*old, *new} - set(shared))),
    )


def flip_of(before: Trial, after: Trial) -> Flip | None:
    """Classify the change of a reading; None if it neither gained nor lost."""
    wrong_now, wrong_then = after.accepted and not after.right, before.accepted and not before.right
    if wrong_now and not wrong_then:
        return Flip.ACCEPTED_WRONG
    if before.right != after.right:
        return Flip.GAINED if after.right else Flip.LOST
    if before.accepted == after.accepted:
        return None
    if after.accepted:
        return Flip.ACCEPTED
    return Flip.NOT_ACCEPTED if after.right else Flip.WITHDRAWN


def _rows(key: GroupKey, now: Sequence[Trial], then: Sequence[Trial]) -> Iterator[Row]:
    for factor, levels in levels_in(now).items():
        for level in levels if len(levels) > 1 else ():
            new, old = ([t for t in side if t.levels.get(factor) == level] for side in (now, then))
            yield Row(factor, level, compare(key, new, key, old))


def _check_made_alike(before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    was, now = ({k: v for k, v in parts.items() if k not in _NOT_OF_PARTS} for parts in (before, after))
    if was != now:
        raise NotComparableError(
            f"the two runs did not read the same parts ({differences(was, now)})",
            hint="run the same design with both programs",
        )


def _check_same_parts(before: Sequence[Trial], after: Sequence[Trial]) -> None:
    old, new = ({t.part: (t.truth, _levels(t)) for t in side} for side in (before, after))
    for name, only in (("first", set(old) - set(new)), ("second", set(new) - set(old))):
        if only:
            raise NotComparableError(
                f"{len(only):,} parts are only in the {name} run: {first_of(sorted(only))}",
                hint="finish both runs with the same number of parts",
            )
    if others := {part for part in old if old[part] != new[part]}:
        raise NotComparableError(
            f"{len(others):,} parts have the same name but differ: {first_of(sorted(others))}",
            hint="run the same design with both programs",
        )


def _levels(trial: Trial) -> dict[str, Level]:
    return {name: level for name, level in trial.levels.items() if not name.endswith("_given")}


def _readers(keys: Iterable[GroupKey]) -> str:
    return "; ".join(sorted({key.reader for key in keys}))
