"""Acceptance at a risk, by one procedure for every reader, ours and others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from pipeline.benchmark.analysis.estimates import exact_share
from pipeline.benchmark.analysis.groups import GroupKey, level_of
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.accepted_risk import proven_threshold, threshold_tests
from pipeline.common.shares import Share, share


@dataclass(frozen=True)
class RiskAcceptance:
    """Readings that a reader accepts at a threshold fitted to other parts."""

    key: GroupKey
    risk: float
    accepted: Share
    wrong_of_accepted: Share  # with exact one-sided bounds
    least: tuple[float, float]  # thresholds of the fits, the most lenient and the strictest


def acceptance_at_risks(
    groups: Iterable[tuple[GroupKey, Sequence[Trial]]],
    risks: Sequence[float],
    *,
    confidence: float = 0.95,
    left_out: str = "soil",
) -> Iterator[RiskAcceptance]:
    """What each group of trials of one mode accepts at each risk that its trials can prove. The levels of the factor
    `left_out` are left out in turn; groups with one level are passed over."""
    for key, trials in groups:
        levels = dict.fromkeys(level_of(trial, left_out) for trial in trials)
        for risk in risks if len(levels) > 1 else ():
            accepted: list[Trial] = []
            thresholds: list[float] = []
            for level in levels:
                others = [t for t in trials if level_of(t, left_out) != level and _may_be_accepted(t)]
                test = proven_threshold(
                    threshold_tests(
                        [t.confidence for t in others],
                        [t.right for t in others],
                        risk=risk,
                        confidence=confidence,
                    )
                )
                if test is not None:
                    thresholds.append(test.threshold)
                    accepted += [
                        t
                        for t in trials
                        if level_of(t, left_out) == level
                        and _may_be_accepted(t)
                        and t.confidence >= test.threshold
                    ]
            if thresholds:
                yield RiskAcceptance(
                    key,
                    risk,
                    share(len(accepted), len(trials)),
                    exact_share(sum(not t.right for t in accepted), len(accepted)),
                    (min(thresholds), max(thresholds)),
                )


def _may_be_accepted(trial: Trial) -> bool:
    return not trial.error and not trial.broken and trial.decision != "reject"
