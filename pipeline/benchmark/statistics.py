"""All figures of a benchmark, from its trials alone.

Trials are looked at in groups: of one severity, mode, font and format; over the fonts and formats; and over the
severities as well. What is right is judged whatever was decided: a serial that was rejected may be right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.benchmark.calibration import Reliability, reliability
from pipeline.benchmark.confusion import Confusion, characters_right, confusion
from pipeline.benchmark.pairs import CharacterTest, SerialTest, compare_characters, mcnemar
from pipeline.benchmark.risk import RiskCoverage, risk_coverage
from pipeline.benchmark.shares import resampled
from pipeline.benchmark.trials import Trial
from pipeline.common.alignment import align
from pipeline.common.shares import Share, share

SINGLE_MODES = ("tactile", "vision")
FUSED = "fused"


@dataclass(frozen=True)
class Split:
    """What became of the parts.

    Attributes:
        accepted_right: vouched for, and right.
        accepted_wrong: vouched for, and wrong: the worst there is.
        review: left to a person.
        rejected: refused.
        failed: an error, so no reading.
    """

    accepted_right: int
    accepted_wrong: int
    review: int
    rejected: int
    failed: int


@dataclass(frozen=True)
class GroupKey:
    """Which trials; None stands for all.

    Attributes:
        mode: what read.
        severity: of the dirt; None for all, or where it is not known.
        font: of the mark.
        format: of the serial.
    """

    mode: str
    severity: float | None = None
    font: str | None = None
    format: str | None = None


@dataclass(frozen=True, eq=False)
class Group:
    """The figures of some trials of one mode.

    Attributes:
        key: which.
        serials: whole serials right.
        characters: characters right (stamped less edits).
        characters_by_part: 95 % interval of their share, whole parts drawn again.
        split: what became of the parts.
        accepted: parts vouched for.
        accepted_wrong: parts vouched for and wrong, of all parts.
        risk: risk against coverage.
        serial_reliability: of the confidence in whole serials.
        character_reliability: of the confidence in single characters.
        confused: what was read for what.
        compute_s: (median, 95th percentile) of the program's time for a part: the simulated scan and the reading.
        reading_s: (median, 95th percentile) of the reading alone.
        simulated_s: (median, 95th percentile) of simulating the scan.
        scan_s: (median, 95th percentile) of the real array's.
    """

    key: GroupKey
    serials: Share
    characters: Share
    characters_by_part: tuple[float, float]
    split: Split
    accepted: Share
    accepted_wrong: Share
    risk: RiskCoverage
    serial_reliability: Reliability
    character_reliability: Reliability
    confused: Confusion
    compute_s: tuple[float, float]
    reading_s: tuple[float, float]
    simulated_s: tuple[float, float]
    scan_s: tuple[float, float]


@dataclass(frozen=True)
class Comparison:
    """Two modes on the same parts of one severity.

    Attributes:
        severity: of the dirt; None where it is not known.
        first: a mode.
        second: the mode it is compared with.
        parts: how many.
        serials: whole serials compared.
        characters: characters compared.
    """

    severity: float | None
    first: str
    second: str
    parts: int
    serials: SerialTest
    characters: CharacterTest


@dataclass(frozen=True, eq=False)
class Statistics:
    """All figures.

    Attributes:
        groups: one a severity, mode, font and format.
        by_severity: one a severity and mode, over fonts and formats.
        by_mode: one a mode.
        comparisons: fused against the better single mode, touch against the others, at every severity.
    """

    groups: tuple[Group, ...]
    by_severity: tuple[Group, ...]
    by_mode: tuple[Group, ...]
    comparisons: tuple[Comparison, ...]

    def at(self, mode: str, severity: float | None) -> Group | None:
        """The group over fonts and formats; None where there is none."""
        return next((g for g in self.by_severity if g.key.mode == mode and g.key.severity == severity), None)


def statistics_of(trials: Sequence[Trial]) -> Statistics:
    """All figures of some trials, at least one."""
    return Statistics(
        groups=_grouped(trials, lambda t: GroupKey(t.mode, t.severity, t.font, t.format)),
        by_severity=_grouped(trials, lambda t: GroupKey(t.mode, t.severity)),
        by_mode=_grouped(trials, lambda t: GroupKey(t.mode)),
        comparisons=tuple(_comparisons(trials)),
    )


def _grouped(trials: Sequence[Trial], key: Callable[[Trial], GroupKey]) -> tuple[Group, ...]:
    found: dict[GroupKey, list[Trial]] = {}
    for trial in trials:
        found.setdefault(key(trial), []).append(trial)
    return tuple(group_of(k, members) for k, members in found.items())


def group_of(key: GroupKey, trials: Sequence[Trial]) -> Group:
    """The figures of some trials of one mode."""
    right = [t.right for t in trials]
    chars = [len(t.truth) for t in trials]
    chars_right = [characters_right(t) for t in trials]
    read = [t for t in trials if not t.error]
    split = split_of(trials)
    said, was = _characters_said(read)
    return Group(
        key=key,
        serials=share(sum(right), len(trials)),
        characters=share(sum(chars_right), sum(chars)),
        characters_by_part=resampled(chars_right, chars),
        split=split,
        accepted=share(split.accepted_right + split.accepted_wrong, len(trials)),
        accepted_wrong=share(split.accepted_wrong, len(trials)),
        risk=risk_coverage([t.confidence for t in trials], right),
        serial_reliability=reliability([t.confidence for t in read], [t.right for t in read]),
        character_reliability=reliability(said, was),
        confused=confusion(trials),
        compute_s=_spread([t.compute_s for t in read]),
        reading_s=_spread([t.reading_s for t in read]),
        simulated_s=_spread([t.simulated_s for t in read]),
        scan_s=_spread([t.scan_s for t in read]),
    )


def split_of(trials: Iterable[Trial]) -> Split:
    """What became of the parts."""
    accepted_right = accepted_wrong = review = rejected = failed = 0
    for trial in trials:
        if trial.error:
            failed += 1
        elif trial.accepted:
            accepted_right += trial.right
            accepted_wrong += not trial.right
        elif trial.decision == "review":
            review += 1
        else:
            rejected += 1
    return Split(accepted_right, accepted_wrong, review, rejected, failed)


def _characters_said(trials: Iterable[Trial]) -> tuple[list[float], list[bool]]:
    """Confidence of every character read, and whether it was right."""
    said, was = [], []
    for trial in trials:
        if "".join(c.char for c in trial.characters) != trial.text:
            continue
        for pair in align(trial.truth, trial.text):
            if pair.place is not None:
                said.append(min(1.0, max(0.0, trial.characters[pair.place].confidence)))
                was.append(pair.right)
    return said, was


def _spread(seconds: Sequence[float]) -> tuple[float, float]:
    if not seconds:
        return (0.0, 0.0)
    middle, high = np.percentile(seconds, [50.0, 95.0])
    return (float(middle), float(high))


def _comparisons(trials: Sequence[Trial]) -> Iterable[Comparison]:
    modes = list(dict.fromkeys(t.mode for t in trials))
    # a part that was read with more given of it is another pair
    for severity, given in dict.fromkeys((t.severity, t.given) for t in trials):
        here = {
            m: [t for t in trials if (t.mode, t.severity, t.given) == (m, severity, given)] for m in modes
        }
        singles = [m for m in SINGLE_MODES if here.get(m)]
        if here.get(FUSED) and singles:
            yield compare(severity, here[FUSED], here[max(singles, key=lambda m: _merit(here[m]))])
        for other in modes:
            if here.get("tactile") and other not in ("tactile", FUSED):
                yield compare(severity, here["tactile"], here[other])


def _merit(trials: Sequence[Trial]) -> tuple[int, int]:
    """Of two modes the better: more serials right, then more characters."""
    return sum(t.right for t in trials), sum(characters_right(t) for t in trials)


def compare(severity: float | None, first: Sequence[Trial], second: Sequence[Trial]) -> Comparison:
    """Compare two modes on the same parts.

    Raises:
        ValueError: not the same parts.
    """
    others = {t.part: t for t in second}
    if set(others) != {t.part for t in first} or len(others) != len(first):
        raise ValueError("a paired test needs the same parts from both modes")
    pairs = [(t, others[t.part]) for t in first]
    return Comparison(
        severity=severity,
        first=first[0].mode,
        second=second[0].mode,
        parts=len(pairs),
        serials=mcnemar([a.right for a, _ in pairs], [b.right for _, b in pairs]),
        characters=compare_characters(
            [characters_right(a) for a, _ in pairs],
            [characters_right(b) for _, b in pairs],
            [len(a.truth) for a, _ in pairs],
        ),
    )


def plain(value: Any) -> Any:
    """The figures as JSON values, rounded to what they mean; times, which differ from run to run, left out."""
    if isinstance(value, Group):
        return {
            **plain(value.key.__dict__),
            **{
                name: plain(getattr(value, name))
                for name in (
                    "serials", "characters", "characters_by_part", "split", "accepted", "accepted_wrong", "risk",
                    "serial_reliability", "character_reliability",
                )
            },
            "mistakes": [{"true": t, "read": r, "count": n} for t, r, n in value.confused.mistakes()],
        }  # fmt: skip
    if isinstance(value, Share):
        return {
            "count": value.count,
            "total": value.total,
            **plain({"share": value.value, "low": value.low, "high": value.high}),
        }
    if isinstance(value, RiskCoverage):
        step = max(1, value.coverage.size // 100)
        points = [*range(step - 1, value.coverage.size - 1, step), value.coverage.size - 1]
        curve = [[plain(float(value.coverage[k])), plain(float(value.risk[k]))] for k in points if k >= 0]
        return {"aurc": plain(value.area), "least_aurc": plain(value.least_area), "curve": curve}
    if isinstance(value, float):
        return round(value, 6)
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    return value
