"""Group trials, and compute the figures of a group: shares, edits, confused characters, times.

A group has one mode, and one level of each of some factors. Different given facts are always a factor, so that no group
holds a part twice and Wilson's intervals are valid. A rejected serial may be right.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.benchmark.analysis.confidence import Reliability, RiskCoverage, reliability, risk_coverage
from pipeline.benchmark.analysis.estimates import Estimate, bootstrap_share, exact_share
from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.shares import Share, share
from pipeline.common.texts import align

# the set of facts given to a reader, as one factor
GIVEN_FACTOR = "given"
# outcomes of a part: accepted (right or wrong), review, reject, or an error
FATES = ("accepted_right", "accepted_wrong", "review", "rejected", "failed")
# of a trial: the program's, its share for reading, its share for the simulated scan, and the real array's
TIMES = ("compute_s", "reading_s", "simulated_s", "scan_s")


def edits(trial: Trial) -> int:
    """Least number of characters wrong, missing and too many (Levenshtein)."""
    from rapidfuzz.distance import Levenshtein

    return int(Levenshtein.distance(trial.truth, trial.text))


def places_wrong(trial: Trial) -> int:
    """Number of stamped characters that the text does not have at the same place."""
    return len(trial.truth) - sum(a == b for a, b in zip(trial.truth, trial.text, strict=False))


def characters_right(trial: Trial) -> int:
    """Stamped characters minus the edits, not below 0."""
    return max(0, len(trial.truth) - edits(trial))


def confusion(trials: Iterable[Trial]) -> Counter[tuple[str, str]]:
    """Count (stamped, read) pairs of characters; EXTRA if nothing was stamped, MISSING if nothing was read."""
    return Counter((p.true, p.read) for trial in trials for p in align(trial.truth, trial.text))


def mistakes(confused: Counter[tuple[str, str]]) -> list[tuple[str, str, int]]:
    """(stamped, read, count) of confused characters, the most frequent first."""
    wrong = [(true, read, n) for (true, read), n in confused.items() if true != read]
    return sorted(wrong, key=lambda m: (-m[2], m[0], m[1]))


@dataclass(frozen=True)
class GroupKey:
    """Mode of a group of trials, and the (factor, level) that they have in common."""

    mode: str
    levels: tuple[tuple[str, Level], ...] = ()

    def level(self, factor: str) -> Level:
        return dict(self.levels).get(factor)

    @property
    def severity(self) -> float | None:
        level = self.level("severity")
        return None if level is None else float(level)

    @property
    def reader(self) -> str:
        facts = self.level(GIVEN_FACTOR)
        return self.mode if facts is None else f"{self.mode}, given {str(facts).replace(',', ', ')}"


def level_of(trial: Trial, factor: str) -> Level:
    """Level of a factor of a trial; None if unknown."""
    return trial.given if factor == GIVEN_FACTOR else trial.levels.get(factor)


def group_trials(trials: Iterable[Trial], factors: Sequence[str] = ()) -> dict[GroupKey, list[Trial]]:
    """Group trials by mode and the levels of some factors, in order of appearance."""
    groups: dict[GroupKey, list[Trial]] = {}
    for trial in trials:
        key = GroupKey(trial.mode, tuple((factor, level_of(trial, factor)) for factor in factors))
        groups.setdefault(key, []).append(trial)
    return groups


@dataclass(frozen=True, eq=False)
class Group:
    """The figures of a group."""

    key: GroupKey
    serials: Share
    characters: Share
    character_error_rate: float  # edits per stamped character (CER); above 1 if far more is read
    place_error_rate: float  # share of stamped characters that the text does not have at the same place
    characters_by_part: Estimate  # share right, with a 95 % interval from resampling whole parts
    split: dict[str, int]  # number of parts by outcome, see `FATES`
    accepted: Share
    wrong_of_accepted: Share  # with exact one-sided bounds
    risk: RiskCoverage
    serial_reliability: Reliability
    character_reliability: Reliability
    confused: Counter[tuple[str, str]]
    seconds: dict[str, tuple[float, float]]  # (median, 95th percentile) of the times in `TIMES`
    stage_s: float  # mean scan time of the real array


def group_of(key: GroupKey, trials: Sequence[Trial]) -> Group:
    """Compute the figures of trials of one mode."""
    read = [t for t in trials if not t.error]
    stamped, right = [len(t.truth) for t in trials], [characters_right(t) for t in trials]
    counts = Counter(_fate(trial) for trial in trials)
    accepted = counts["accepted_right"] + counts["accepted_wrong"]
    by_character = list(_characters(read))
    return Group(
        key=key,
        serials=share(sum(t.right for t in trials), len(trials)),
        characters=share(sum(right), sum(stamped)),
        character_error_rate=sum(map(edits, trials)) / max(1, sum(stamped)),
        place_error_rate=sum(map(places_wrong, trials)) / max(1, sum(stamped)),
        characters_by_part=bootstrap_share(right, stamped),
        split={fate: counts[fate] for fate in FATES},
        accepted=share(accepted, len(trials)),
        wrong_of_accepted=exact_share(counts["accepted_wrong"], accepted),
        risk=risk_coverage([t.confidence for t in trials], [t.right for t in trials]),
        serial_reliability=reliability([t.confidence for t in read], [t.right for t in read]),
        character_reliability=reliability(
            [sure for sure, _ in by_character], [right for _, right in by_character]
        ),
        confused=confusion(trials),
        seconds={name: _spread([getattr(t, name) for t in read]) for name in TIMES},
        stage_s=float(np.mean([t.scan_s for t in trials])),
    )


def _fate(trial: Trial) -> str:
    if trial.error:
        return "failed"
    if trial.accepted:
        return "accepted_right" if trial.right else "accepted_wrong"
    return "review" if trial.decision == "review" else "rejected"


def levels_in(trials: Iterable[Trial]) -> dict[str, tuple[Level, ...]]:
    """The levels of every factor, in order, unknown ones last."""
    rows = list(trials)
    names = dict.fromkeys(name for trial in rows for name in trial.levels)
    return {name: ordered_levels(level_of(t, name) for t in rows) for name in names}


def ordered_levels(levels: Iterable[Level]) -> tuple[Level, ...]:
    """Distinct levels: numbers by size, then words in their order, then unknown ones."""

    def rank(level: Level) -> tuple[int, float]:
        number = isinstance(level, int | float)
        return (2 if level is None else 0 if number else 1, float(level) if number else 0.0)  # type: ignore[arg-type]

    return tuple(sorted(dict.fromkeys(levels), key=rank))


def _characters(trials: Iterable[Trial]) -> Iterator[tuple[float, bool]]:
    for trial in trials:
        if "".join(c.char for c in trial.characters) != trial.text:
            continue
        for pair in align(trial.truth, trial.text):
            if pair.place is not None:
                yield min(1.0, max(0.0, trial.characters[pair.place].confidence)), pair.right


def _spread(seconds: Sequence[float]) -> tuple[float, float]:
    middle, high = np.percentile(seconds or (0.0,), [50.0, 95.0])
    return (float(middle), float(high))
