"""What the benchmark was to show, and whether it did."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.benchmark.statistics import FUSED, Group, Statistics
from pipeline.common.shares import Share

SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Target:
    """A share that a mode is to reach at one severity.

    Attributes:
        mode: which.
        severity: of the dirt.
        measure: "characters", "accepted" or "accepted_wrong" of a group.
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
        what = {
            "characters": "characters right",
            "accepted": "serials accepted",
            "accepted_wrong": "serials accepted but wrong",
        }[self.measure]
        return f"{what} {'at most' if self.most else 'at least'} {self.limit:.1%}"


TARGETS = (
    Target("tactile", 0.3, "characters", 0.999),
    Target("tactile", 0.6, "characters", 0.99),
    Target("tactile", 0.9, "characters", 0.95),
    Target("tactile", 0.3, "accepted", 0.90),
    Target("tactile", 0.3, "accepted_wrong", 0.001, most=True),
    Target("tactile", 0.9, "accepted_wrong", 0.005, most=True),
)


@dataclass(frozen=True)
class Verdict:
    """Whether a target was met.

    Attributes:
        mode: of which mode.
        severity: at which severity; None where it is not known.
        target: in words.
        found: what was measured, in words.
        met: whether the figure measured meets it; None where it was not measured.
        sure: whether the whole interval agrees (of a test: whether the difference is more than chance).
    """

    mode: str
    severity: float | None
    target: str
    found: str
    met: bool | None
    sure: bool


def verdicts(statistics: Statistics, targets: tuple[Target, ...] = TARGETS) -> list[Verdict]:
    """One a target, and one a severity for the fused mode against the better single one."""
    found = [_verdict(target, statistics.at(target.mode, target.severity)) for target in targets]
    return [*found, *_fused(statistics)]


def _verdict(target: Target, group: Group | None) -> Verdict:
    if group is None:
        return Verdict(target.mode, target.severity, target.describe(), "not measured", None, False)
    measured: Share = getattr(group, target.measure)
    if target.most:
        met = measured.value <= target.limit + 1e-12
        sure = measured.high <= target.limit if met else measured.low > target.limit
    else:
        met = measured.value >= target.limit - 1e-12
        sure = measured.low >= target.limit if met else measured.high < target.limit
    text = f"{measured.value:.2%} ({measured.count} of {measured.total}; {measured.low:.2%} to {measured.high:.2%})"
    return Verdict(target.mode, target.severity, target.describe(), text, met, sure)


def _fused(statistics: Statistics) -> Iterator[Verdict]:
    for c in statistics.comparisons:
        if c.first != FUSED:
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
        yield Verdict(FUSED, c.severity, f"not below {c.second}, the better single mode", found, met, sure)
