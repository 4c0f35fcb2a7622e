"""What the benchmark was to show, and whether it did."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from glyphs.soiling.soiled import WORKSHOP
from pipeline.benchmark.analysis.bounds import Bounded, bounded, parts_without_wrong
from pipeline.benchmark.analysis.comparisons import FUSED, SINGLE_MODES
from pipeline.benchmark.analysis.groups import Group
from pipeline.benchmark.analysis.statistics import Statistics
from pipeline.common.shares import Share

SIGNIFICANT = 0.05
WRONG_LIMIT = 0.001
"""Accepted but wrong, of those accepted: the limit that every reader is judged by."""
FLIPS_LIMIT = 0.01
"""Decisions that may flip under perturbations that should not matter."""


@dataclass(frozen=True)
class Target:
    """A share that a mode is to reach at one severity.

    Attributes:
        mode: which.
        severity: of the dirt.
        measure: "characters", "accepted" or "wrong_of_accepted" of a group.
        limit: to be reached, or not to be passed.
        most: the limit is not to be passed.
    """

    mode: str
    severity: float
    measure: str
    limit: float
    most: bool = False

    def describe(self) -> str:
        """In words."""
        if self.most:
            return f"of accepted serials wrong at most 1 in {1.0 / self.limit:,.0f}"
        what = {"characters": "characters right", "accepted": "serials accepted"}[self.measure]
        return f"{what} at least {self.limit:.1%}"


TARGETS = (
    Target("tactile", 0.3, "characters", 0.999),
    Target("tactile", 0.6, "characters", 0.99),
    Target("tactile", 0.9, "characters", 0.95),
    Target("tactile", 0.3, "accepted", 0.90),
    Target("tactile", 0.3, "wrong_of_accepted", 0.001, most=True),
    Target("tactile", 0.9, "wrong_of_accepted", 0.005, most=True),
)
"""Of the soil workshop: of other soils nothing was promised."""


class Outcome(Enum):
    """What became of a target."""

    MET = "met"
    NOT_MET = "not met"
    NOT_SHOWN = "not shown"


@dataclass(frozen=True)
class Verdict:
    """Whether a target was met.

    Attributes:
        reader: who.
        severity: at which severity; None over all, or where it is not known.
        target: in words.
        found: what was measured, in words.
        outcome: whether that meets it: met where the exact bound does, of 6 parts therefore hardly ever; not met where
            not even the share found does; else not shown.
        sure: whether the whole interval agrees (of a test: whether the difference is more than chance).
    """

    reader: str
    severity: float | None
    target: str
    found: str
    outcome: Outcome
    sure: bool


def verdicts(statistics: Statistics, targets: tuple[Target, ...] = TARGETS) -> list[Verdict]:
    """One a target that was measured, one a severity for the fused mode against the better single one, and what is
    asked of parts that were perturbed.
    """
    workshop = set(statistics.levels.get("soil", ())) <= {WORKSHOP}
    found = [
        _verdict(target, group)
        for target in (targets if workshop else ())
        for group in statistics.at(target.mode, target.severity)
    ]
    return [*found, *_fused(statistics), *_steady(statistics)]


def _verdict(target: Target, group: Group) -> Verdict:
    measured: Share = getattr(group, target.measure)
    text = f"{measured.value:.2%} ({measured.count} of {measured.total}; "
    if isinstance(measured, Bounded):
        outcome, sure = at_most(measured, target.limit)
        text += f"at most {measured.high:.2%})"
        if outcome is Outcome.NOT_SHOWN:
            text += f": needs {parts_without_wrong(target.limit):,} accepted parts without a wrong one"
    else:
        exact = bounded(measured.count, measured.total)
        ends = group.characters_by_part if target.measure == "characters" else (exact.low, exact.high)
        outcome, sure = at_least(measured, min(exact.low, ends[0]), max(exact.high, ends[1]), target.limit)
        text += f"at least {min(exact.low, ends[0]):.2%})"
    return Verdict(group.key.reader, target.severity, target.describe(), text, outcome, sure)


def at_most(measured: Bounded, limit: float) -> tuple[Outcome, bool]:
    """Whether a share is at most a limit, by its exact bound; and whether the whole interval agrees."""
    if measured.high <= limit:
        return Outcome.MET, True
    if measured.value > limit:
        return Outcome.NOT_MET, measured.low > limit
    return Outcome.NOT_SHOWN, False


def _steady(statistics: Statistics) -> Iterator[Verdict]:
    """Of our own readers: over all perturbations few verdicts flip, and no accepted serial becomes another."""
    for s in statistics.stability:
        if s.perturbation or s.key.mode not in (*SINGLE_MODES, FUSED):
            continue
        outcome, sure = at_most(s.verdicts, FLIPS_LIMIT)
        found = f"{s.verdicts.count} of {s.verdicts.total}, at most {s.verdicts.high:.2%}"
        target = f"decisions that flip under a perturbation at most {FLIPS_LIMIT:.0%}"
        yield Verdict(s.key.reader, None, target, found, outcome, sure)
        texts = s.accepted_texts
        found = (
            f"{texts.count} of {texts.total}, at most {texts.high:.2%}; {len(s.faults)} accepted as another"
        )
        target = f"no accepted part reads otherwise under a perturbation: none found, and at most {FLIPS_LIMIT:.0%}"
        outcome, sure = (Outcome.NOT_MET, True) if texts.count else at_most(texts, FLIPS_LIMIT)
        yield Verdict(s.key.reader, None, target, found, outcome, sure)


def at_least(measured: Share, low: float, high: float, limit: float) -> tuple[Outcome, bool]:
    """Whether a share is at least a limit, by its bounds; and whether the whole interval agrees."""
    if low >= limit:
        return Outcome.MET, True
    if measured.value < limit:
        return Outcome.NOT_MET, high < limit
    return Outcome.NOT_SHOWN, False


def _fused(statistics: Statistics) -> Iterator[Verdict]:
    for c in statistics.comparisons:
        at_one = "severity" in dict(c.first.levels)  # over all severities it would be judged twice
        if not at_one or c.first.mode != FUSED or c.second.mode not in SINGLE_MODES:
            continue
        lost = c.serials.only_second - c.serials.only_first
        met = lost <= 0 and c.characters.difference >= 0.0
        p = min(c.serials.p_first_worse, c.characters.p_first_worse)
        found = (
            f"serials {c.serials.only_first} gained, {c.serials.only_second} lost "
            f"(McNemar p = {c.serials.p_differ:.3g}); "
            f"characters {c.characters.difference:+.2%} "
            f"({c.characters.low:+.2%} to {c.characters.high:+.2%}, p = {c.characters.p_differ:.3g})"
        )
        if not met and p >= SIGNIFICANT:
            found += "; no more than chance may bring"
        sure = p < SIGNIFICANT if not met else c.characters.low > 0.0
        outcome = Outcome.NOT_MET if not met else Outcome.MET if sure else Outcome.NOT_SHOWN
        target = f"not below {c.second.mode}, the better single mode"
        yield Verdict(c.first.reader, c.severity, target, found, outcome, sure)
