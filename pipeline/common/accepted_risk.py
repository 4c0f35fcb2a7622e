"""The threshold that keeps a risk: what share of the accepted readings is wrong, tested on readings with a known text.

    most certain ----------------------> least certain
    0.9999   0.999   0.99   0.98   0.97  ...
    too few  shown   shown  not shown          the last threshold that was shown to hold is the one to use: 0.99

As in "Learn then Test" (Angelopoulos, Bates, Candès, Jordan and Lei, arXiv:2110.01052): each threshold is a hypothesis,
tested by the exact binomial (Clopper and Pearson 1934), from the strictest to the first that cannot be refuted. As the
sequence is fixed beforehand, each test may use the whole of 1 - confidence. A threshold must also keep `group_factor`
times the risk in each group of readings, such as a generator of parts.

Assumed: the parts are independent and like future parts, and less sure readings are not right more often. Thresholds
and groups with too few accepted parts for any answer are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import share_bounds

THRESHOLDS = (
    0.9999, 0.9998, 0.9995, 0.999, 0.998, 0.995, 0.99, 0.985, 0.98, 0.97, 0.96, 0.95, 0.94, 0.93, 0.92, 0.91,
    0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5,
)  # fmt: skip
"""Scores from which readings may be accepted, strictest first; fixed before any part is read."""
ALLOWED_WRONG = (2, 1, 0)
"""Numbers of wrong readings at which the first tested threshold can still hold; the first possible one is used."""


class Shown(StrEnum):
    """The result of testing a threshold."""

    YES = "shown"
    NO = "not shown"
    TOO_FEW = "too few"
    NOT_TESTED = "not tested"


@dataclass(frozen=True)
class ThresholdTest:
    """One threshold, tested; `bound` is the upper bound of the accepted that are wrong, for this threshold alone."""

    threshold: float
    accepted: int
    wrong: int
    bound: float
    shown: Shown


def parts_needed(risk: float, *, confidence: float, wrong: int = 0) -> int:
    """Least number of accepted parts that proves the risk, with `wrong` wrong ones: 2,995 for 1 in 1,000 at 95 % and
    none wrong. Raises ValueError: risk or confidence does not lie between 0 and 1."""
    from scipy.special import bdtrin

    for name, value in (("risk", risk), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise ValueError(f"a {name} of {value} cannot be tested; it must lie between 0 and 1")
    # the inverse is good to some 1e-8
    return math.ceil(float(bdtrin(wrong, 1.0 - confidence, risk)) - 1e-7)


def threshold_tests(
    scores: Sequence[float],  # of each reading; it is accepted if its score reaches the threshold
    right: Sequence[bool],
    *,
    risk: float,  # largest share of wrong readings among the accepted
    confidence: float,
    thresholds: Sequence[float] = THRESHOLDS,  # strictest first; chosen before any part is read
    groups: Sequence[Collection[str]] = (),  # of each reading, such as its generator; none without groups
    group_factor: float = 5.0,  # risk of each group by itself, as a multiple of `risk`
    start_share: float = 1.0,  # most that the first tested threshold may accept to be allowed a wrong one
) -> tuple[ThresholdTest, ...]:
    """Test the thresholds in order, as the module describes; the last one shown to hold is the one to use.

    Below 1, `start_share` is for many doubtful readings, which would all be accepted at the first tested threshold.
    Raises ValueError: the lengths differ, a probability is not between 0 and 1, or the thresholds do not fall.
    """
    values, wrong = np.asarray(scores, dtype=np.float64), ~np.asarray(right, dtype=bool)
    if values.shape != wrong.shape or (groups and len(groups) != values.size):
        raise ValueError(f"{values.size} scores for {wrong.size} readings of {len(groups)} groups")
    if any(a <= b for a, b in pairwise(thresholds)):
        raise ValueError("thresholds must fall, each once")
    column_of = partial(_Column, thresholds=thresholds, confidence=confidence, start_share=start_share)
    columns = [column_of(values, wrong, risk=risk)]
    if group_factor * risk < 1.0:
        columns += [
            column_of(values[inside], wrong[inside], risk=group_factor * risk)
            for name in sorted(set[str]().union(*groups))
            if (inside := np.array([name in names for names in groups])).any()
        ]
    tests, going = [], True
    for k, threshold in enumerate(thresholds):
        if columns[0].too_few(k):
            shown = Shown.TOO_FEW
        elif not going:
            shown = Shown.NOT_TESTED
        else:
            shown = (
                Shown.YES if all(column.keeps(k) for column in columns if column.is_tested(k)) else Shown.NO
            )
            going = shown is Shown.YES
        count, accepted = columns[0].counts[k]
        tests.append(ThresholdTest(threshold, accepted, count, columns[0].bound(k), shown))
    return tuple(tests)


class _Column:
    def __init__(
        self,
        scores: NDArray[np.float64],
        wrong: NDArray[np.bool_],
        *,
        thresholds: Sequence[float],
        risk: float,
        confidence: float,
        start_share: float,
    ) -> None:
        accepted = [scores >= threshold for threshold in thresholds]
        self.counts = [(int((wrong & over).sum()), int(over.sum())) for over in accepted]
        most = max((total for _, total in self.counts), default=0)
        needed = [parts_needed(risk, confidence=confidence, wrong=allowed) for allowed in ALLOWED_WRONG]
        self.least = next((total for total in needed if total <= start_share * most), needed[-1])
        self.least_of_group = needed[-1]
        self.risk, self.confidence = risk, confidence

    def too_few(self, k: int) -> bool:
        return self.counts[k][1] < self.least

    def is_tested(self, k: int) -> bool:
        return self.counts[k][1] >= self.least_of_group

    def bound(self, k: int) -> float:
        return share_bounds(*self.counts[k], confidence=self.confidence)[1]

    def keeps(self, k: int) -> bool:
        return self.bound(k) <= self.risk


def proven_threshold(tests: Sequence[ThresholdTest]) -> ThresholdTest | None:
    """The most lenient proven threshold; None without one."""
    return next((test for test in reversed(tests) if test.shown is Shown.YES), None)


def parts_missing(
    tests: Sequence[ThresholdTest], parts: int, *, risk: float, confidence: float, most_wrong: int = 10_000
) -> int | None:
    """Estimate how many more parts, with the same shares of accepted and wrong readings and at most `most_wrong` wrong
    ones, would show the risk to hold at some threshold; None if no number would."""
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
