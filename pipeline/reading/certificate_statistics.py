"""Statistics of a certificate: the risk of accepted readings, and whether parts are like those that were certified.

    most certain ----------------------> least certain
    0.9999   0.999   0.99   0.98   0.97  ...
    too few  shown   shown  not shown          the last threshold that was shown to hold is certified: 0.99

Clopper and Pearson 1934 for the bounds. The threshold is found as in "Learn then Test" (Angelopoulos, Bates, Candès,
Jordan and Lei, arXiv:2110.01052): each threshold is a hypothesis "of what is accepted here, more than the risk is
wrong", tested by the exact binomial, from the strictest to the most lenient, up to the first that cannot be refuted.
Tested in a sequence that was fixed beforehand, each may use the whole of 1 - confidence: no matter how many there are,
the chance that one is certified whose true risk is higher is at most 1 - confidence.

Two things are assumed: the parts are independent and like future parts, and less sure readings are not right more
often. Thresholds that accept too few parts for any answer are skipped; only the number of parts decides this.

Whether parts are of the same kind is tested by their measures::

    certified parts --KindOfParts.of--> values of each measure ---+
                                                                  +--Kolmogorov-Smirnov--> Unlike, or nothing
    parts read ------------> latest values of each measure -------+

Each measure is tested by itself, at P_VALUE divided by the number of measures (Bonferroni). All measures together then
give a false alarm in at most P_VALUE of the tests.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from recognition.decide.score import Measure

THRESHOLDS = (
    0.9999, 0.9998, 0.9995, 0.999, 0.998, 0.995, 0.99, 0.985, 0.98, 0.97, 0.96, 0.95, 0.94, 0.93, 0.92, 0.91,
    0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5,
)  # fmt: skip
"""Confidences from which readings may be accepted, strictest first; fixed before any part is read."""
P_VALUE = 1e-4
"""Chance of a false alarm on parts of the same kind, for one test of all measures."""
LEAST_PARTS = 20
"""Fewest parts on either side for a comparison."""


class Shown(StrEnum):
    """The result of testing a threshold."""

    YES = "shown"
    NO = "not shown"
    TOO_FEW = "too few"
    NOT_TESTED = "not tested"


@dataclass(frozen=True)
class ThresholdTest:
    """One threshold, tested.

    Attributes:
        threshold: least confidence for acceptance.
        accepted: number of parts with at least this confidence.
        wrong: number of these that were read wrong.
        bound: upper bound of the share of wrong readings among the accepted, for this threshold alone.
        shown: whether the risk is shown to hold here.
    """

    threshold: float
    accepted: int
    wrong: int
    bound: float
    shown: Shown


def share_bounds(count: int, total: int, *, confidence: float) -> tuple[float, float]:
    """Clopper and Pearson's one-sided bounds of a share, lower and upper, each by itself.

    Args:
        count: number of cases.
        total: number of trials; for 0 the bounds are 0 and 1.
        confidence: confidence of each bound, between 0 and 1.

    Raises:
        ValueError: the count is below 0 or above the total, or the confidence does not lie between 0 and 1.
    """
    from scipy.special import betaincinv

    if not 0 <= count <= total:
        raise ValueError(f"{count} of {total} is not a share")
    _check_share("confidence", confidence)
    low = float(betaincinv(count, total - count + 1, 1.0 - confidence)) if count else 0.0
    high = float(betaincinv(count + 1, total - count, confidence)) if count < total else 1.0
    return low, high


def parts_needed(risk: float, *, confidence: float, wrong: int = 0) -> int:
    """Least number of accepted parts that proves the risk, with a given number of wrong ones among them.

    Without a wrong one it is ln(1 - confidence) / ln(1 - risk): 2,995 for 1 in 1,000 at 95 %.

    Raises:
        ValueError: the risk or the confidence does not lie between 0 and 1.
    """
    from scipy.special import bdtrin

    _check_share("risk", risk)
    _check_share("confidence", confidence)
    # the inverse is good to some 1e-8
    return math.ceil(float(bdtrin(wrong, 1.0 - confidence, risk)) - 1e-7)


def threshold_tests(
    confidences: Sequence[float],
    right: Sequence[bool],
    *,
    risk: float,
    confidence: float,
    thresholds: Sequence[float] = THRESHOLDS,
    allowed_wrong: Sequence[int] = (2, 1, 0),
) -> tuple[ThresholdTest, ...]:
    """Test the thresholds in order, as the module describes; the last one shown to hold is the one to use.

    Args:
        confidences: confidence of each reading that is accepted if it reaches the threshold.
        right: whether each is right.
        risk: largest share of wrong readings among the accepted.
        confidence: confidence level of the tests.
        thresholds: strictest first; chosen before any part is read.
        allowed_wrong: number of wrong readings at which the first tested threshold can still be shown to hold; the
            first number is used for which enough readings are accepted.

    Raises:
        ValueError: the lengths differ, the risk or the confidence does not lie between 0 and 1, or the thresholds do
            not fall.
    """
    said, good = np.asarray(confidences, dtype=np.float64), np.asarray(right, dtype=bool)
    if said.shape != good.shape:
        raise ValueError(f"{said.size} confidences for {good.size} readings")
    if any(a <= b for a, b in pairwise(thresholds)):
        raise ValueError("thresholds must fall, each once")
    counts = [(t, int((said >= t).sum()), int((~good[said >= t]).sum())) for t in thresholds]
    most = max((n for _, n, _ in counts), default=0)
    needed = [parts_needed(risk, confidence=confidence, wrong=wrong) for wrong in allowed_wrong]
    least = next((n for n in needed if n <= most), needed[-1])
    tests, going = [], True
    for threshold, accepted, wrong in counts:
        bound = share_bounds(wrong, accepted, confidence=confidence)[1]
        if accepted < least:
            shown = Shown.TOO_FEW
        elif not going:
            shown = Shown.NOT_TESTED
        else:
            shown = Shown.YES if bound <= risk else Shown.NO
            going = shown is Shown.YES
        tests.append(ThresholdTest(threshold, accepted, wrong, bound, shown))
    return tuple(tests)


def certified_threshold(tests: Sequence[ThresholdTest]) -> ThresholdTest | None:
    """The most lenient proven threshold; None without one."""
    return next((test for test in reversed(tests) if test.shown is Shown.YES), None)


def parts_missing(
    tests: Sequence[ThresholdTest], parts: int, *, risk: float, confidence: float, most_wrong: int = 10_000
) -> int | None:
    """Estimate how many more parts would show the risk to hold at some threshold; None if no number would.

    The estimate assumes the same shares of accepted and of wrong readings among further parts.

    Args:
        tests: tests on the present parts.
        parts: number of these parts, accepted or not.
        risk: largest share of wrong readings among the accepted.
        confidence: confidence level of the tests.
        most_wrong: number of wrong readings at which the search ends.
    """
    totals = []
    for test in tests:
        if not test.accepted or test.wrong / test.accepted >= risk:
            continue
        for wrong in range(test.wrong, most_wrong):
            times = parts_needed(risk, confidence=confidence, wrong=wrong) / test.accepted
            if test.wrong * times <= wrong:
                totals.append(math.ceil(parts * times))
                break
    return max(1, min(totals) - parts) if totals else None


def _check_share(name: str, value: float) -> None:
    if not 0.0 < value < 1.0:
        raise ValueError(f"a {name} of {value} cannot be tested; it must lie between 0 and 1")


@dataclass(frozen=True)
class KindOfParts:
    """Distribution of each measure over some parts.

    Attributes:
        values: ascending values of each measure; for many parts, evenly spaced quantiles.

    Raises:
        ValueError: values that are not finite, or not ascending.
    """

    values: Mapping[Measure, tuple[float, ...]]

    def __post_init__(self) -> None:
        for name, values in self.values.items():
            if not all(math.isfinite(v) for v in values):
                raise ValueError(f"{name.value} has values that are not finite")
            if list(values) != sorted(values):
                raise ValueError(f"the values of {name.value} are not ascending")

    @classmethod
    def of(cls, parts: Collection[Mapping[Measure, float]], *, most_kept: int = 200) -> KindOfParts:
        """Compute the distributions over these parts, without measures that fewer than LEAST_PARTS have.

        Args:
            parts: measures of each part.
            most_kept: most values of a measure that are kept; of more parts, as many quantiles are kept.
        """
        found = {}
        for name in Measure:
            values = np.sort([part[name] for part in parts if name in part])
            if values.size > most_kept:
                values = np.quantile(values, (np.arange(most_kept) + 0.5) / most_kept)
            if values.size >= LEAST_PARTS:
                found[name] = tuple(float(f"{v:.6g}") for v in values)
        return cls(found)


@dataclass(frozen=True)
class Unlike:
    """A difference between two sets of parts in one measure.

    Attributes:
        measure: measure that differs.
        certified: median over the certified parts.
        now: median over the latest parts.
        p: p-value of the two-sample test.
        parts: number of latest parts.
    """

    measure: Measure
    certified: float
    now: float
    p: float
    parts: int

    def __str__(self) -> str:
        return (
            f"{self.measure.value} {self.now:.3g}, certified {self.certified:.3g} (medians, p = {self.p:.1g})"
        )


def unlike(kind: KindOfParts, parts: Collection[Mapping[Measure, float]]) -> tuple[Unlike, ...]:
    """Find the measures in which parts differ from a kind, lowest p-value first; none if there are too few parts.

    Each measure has a two-sample Kolmogorov-Smirnov test, exact for few parts (`scipy.stats.ks_2samp`).
    """
    from scipy.stats import ks_2samp

    found = []
    for name, certified in kind.values.items():
        now = [part[name] for part in parts if name in part]
        if min(len(now), len(certified)) < LEAST_PARTS:
            continue
        p = float(ks_2samp(now, certified).pvalue)
        if p * len(kind.values) < P_VALUE:
            found.append(Unlike(name, float(np.median(certified)), float(np.median(now)), p, len(now)))
    return tuple(sorted(found, key=lambda one: one.p))
