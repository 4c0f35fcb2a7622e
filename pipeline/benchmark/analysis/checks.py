"""Checks of every benchmark: fusion against the better sense, and stability under perturbations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from pipeline.benchmark.analysis.comparisons import FUSED, SINGLE_MODES
from pipeline.benchmark.analysis.statistics import Statistics
from pipeline.common.shares import Share

SIGNIFICANT = 0.05
WRONG_LIMIT = 0.001
"""Accepted but wrong, of those accepted: the limit that every reader is judged by."""
FLIPS_LIMIT = 0.01
"""Decisions that may flip under perturbations that should not matter."""


class Outcome(Enum):
    """The result of a check."""

    MET = "met"
    NOT_MET = "not met"
    NOT_SHOWN = "not shown"


@dataclass(frozen=True)
class Verdict:
    """The result of a check, in words.

    Attributes:
        reader: who.
        severity: at which severity; None over all, or where it is not known.
        target: what is checked.
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


def verdicts(statistics: Statistics) -> list[Verdict]:
    """Judge the fused mode against the better single one at every severity, and readings of perturbed parts."""
    return [*_fused(statistics), *_steady(statistics)]


def at_most(measured: Share, limit: float) -> tuple[Outcome, bool]:
    """Judge whether a share is at most a limit, by its exact bound; and whether the whole interval agrees."""
    if measured.high <= limit:
        return Outcome.MET, True
    if measured.value > limit:
        return Outcome.NOT_MET, measured.low > limit
    return Outcome.NOT_SHOWN, False


def _steady(statistics: Statistics) -> Iterator[Verdict]:
    """Judge our own readers over all perturbations: few decisions flip, and no accepted serial becomes another."""
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


def _fused(statistics: Statistics) -> Iterator[Verdict]:
    for c in statistics.comparisons:
        at_one = "severity" in dict(c.first.levels)  # over all severities it would be judged twice
        if not at_one or c.first.mode != FUSED or c.second.mode not in SINGLE_MODES:
            continue
        difference, p = c.characters.difference, min(c.serials.p_differ, c.characters.p_differ)
        met = c.serials.only_second <= c.serials.only_first and difference.value >= 0.0
        found = (
            f"serials {c.serials.only_first} gained, {c.serials.only_second} lost "
            f"(McNemar p = {c.serials.p_differ:.3g}); characters {difference.value:+.2%} "
            f"({difference.low:+.2%} to {difference.high:+.2%}, p = {c.characters.p_differ:.3g})"
        )
        if not met and p >= SIGNIFICANT:
            found += "; no more than chance may bring"
        sure = difference.low > 0.0 if met else p < SIGNIFICANT
        outcome = Outcome.NOT_MET if not met else Outcome.MET if sure else Outcome.NOT_SHOWN
        target = f"not below {c.second.mode}, the better single mode"
        yield Verdict(c.first.reader, c.severity, target, found, outcome, sure)
