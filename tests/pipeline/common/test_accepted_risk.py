"""Thresholds that keep a risk: bounds, the order of the tests, groups, and how often the true risk is exceeded."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from pipeline.common.accepted_risk import (
    THRESHOLDS,
    Shown,
    ThresholdTest,
    parts_missing,
    parts_needed,
    proven_threshold,
    threshold_tests,
)
from pipeline.common.shares import share_bounds
from tests.benchmarks.fit_score import risk_thresholds

RISK, CONFIDENCE = 0.05, 0.9
RUNS, PARTS = 200, 300
Floats = np.ndarray


def of_draw(scores: Floats, right: Floats) -> tuple:
    return threshold_tests(scores.tolist(), right.tolist(), risk=RISK, confidence=CONFIDENCE)


def test_bounds_are_those_at_which_chance_is_as_said() -> None:
    for count, total in ((0, 6), (1, 40), (7, 90)):
        low, high = share_bounds(count, total, confidence=0.95)
        assert binom.cdf(count, total, high) == pytest.approx(0.05, abs=1e-9)
        if count:
            assert binom.sf(count - 1, total, low) == pytest.approx(0.05, abs=1e-9)
    assert share_bounds(0, 0, confidence=0.95) == (0.0, 1.0)
    # none of 6 wrong shows no more than 39 %
    assert share_bounds(0, 6, confidence=0.95)[1] == pytest.approx(0.393, abs=0.001)


def test_how_many_parts_a_risk_takes() -> None:
    assert parts_needed(0.001, confidence=0.95) == 2995
    for wrong in (0, 1, 2, 9):
        n = parts_needed(0.01, confidence=0.95, wrong=wrong)
        assert binom.cdf(wrong, n, 0.01) <= 0.05 < binom.cdf(wrong, n - 1, 0.01)
    # more wrong ones than parts that would do without any
    assert binom.cdf(50, parts_needed(0.5, confidence=0.9, wrong=50), 0.5) <= 0.1


@pytest.mark.parametrize(("risk", "confidence"), [(0.0, 0.95), (1.0, 0.95), (0.01, 1.0), (float("nan"), 0.9)])
def test_a_share_that_is_none_is_refused(risk: float, confidence: float) -> None:
    with pytest.raises(ValueError, match="cannot be tested"):
        parts_needed(risk, confidence=confidence)


def test_the_most_lenient_threshold_before_the_first_that_fails() -> None:
    scores = np.r_[np.full(200, 0.9995), np.full(100, 0.96), np.full(60, 0.91)]
    right = np.r_[np.ones(300, dtype=bool), np.zeros(60, dtype=bool)]
    tests = of_draw(scores, right)
    chosen = proven_threshold(tests)
    assert chosen is not None
    assert (chosen.threshold, chosen.accepted, chosen.wrong) == (0.92, 300, 0)
    assert chosen.bound <= RISK
    by_threshold = {test.threshold: test.shown for test in tests}
    assert by_threshold[0.9999] is Shown.TOO_FEW
    assert by_threshold[0.91] is Shown.NO
    assert by_threshold[0.5] is Shown.NOT_TESTED


def test_too_few_parts_say_how_many_are_missing() -> None:
    scores, right = np.full(20, 0.97), np.ones(20, dtype=bool)
    tests = of_draw(scores, right)
    assert proven_threshold(tests) is None
    # 45 accepted ones without a wrong one show 5 % at 90 %; of 40 parts half were accepted
    missing = parts_missing(tests, 40, risk=RISK, confidence=CONFIDENCE)
    assert missing == 50
    more = round(20 * (40 + missing) / 40)
    assert proven_threshold(of_draw(np.full(more, 0.97), np.ones(more, dtype=bool))) is not None


def test_no_number_of_parts_helps_a_reader_that_is_too_often_wrong() -> None:
    right = np.arange(100) % 10 > 0
    assert parts_missing(of_draw(np.full(100, 0.97), right), 100, risk=RISK, confidence=CONFIDENCE) is None
    assert parts_missing(of_draw(np.zeros(0), np.zeros(0)), 9, risk=RISK, confidence=CONFIDENCE) is None


def _steep(scores: Floats) -> Floats:
    return np.clip(1.3 * (1.0 - scores), 0.0, 1.0)


def _overconfident(scores: Floats) -> Floats:
    return 0.01 + 0.6 * (1.0 - scores)


def _just_too_risky(scores: Floats) -> Floats:
    return np.full(scores.shape, RISK * 1.02)


def _worst_where_surest(scores: Floats) -> Floats:
    """What the guarantee takes for granted not to be: the surest are wrong more often."""
    return np.where(scores > 0.995, 0.08, 0.04)


@pytest.mark.parametrize("wrong_at", [_steep, _overconfident, _just_too_risky, _worst_where_surest])
@pytest.mark.parametrize("sure", [1.0, 4.0])
def test_the_true_risk_is_exceeded_in_no_more_runs_than_said(
    wrong_at: Callable[[Floats], Floats], sure: float
) -> None:
    rng = np.random.default_rng(16)

    def drawn(n: int) -> Floats:
        # confidences as readers have them: most near 1
        return 1.0 - 0.5 * rng.beta(1.0, 2.0 * sure, size=n) ** sure

    many = np.sort(drawn(100_000))[::-1]
    true_risk = np.cumsum(wrong_at(many)) / np.arange(1, many.size + 1)
    exceeded = 0
    for _ in range(RUNS):
        scores = drawn(PARTS)
        chosen = proven_threshold(of_draw(scores, rng.random(PARTS) >= wrong_at(scores)))
        if chosen is not None:
            accepted = int(np.searchsorted(-many, -chosen.threshold, side="right"))
            exceeded += true_risk[accepted - 1] > RISK
    # at most 1 - confidence of the runs, and what chance may add to that in so many: 1 in 1,000
    assert exceeded <= binom.ppf(0.999, RUNS, 1.0 - CONFIDENCE)


def test_thresholds_fall() -> None:
    assert list(THRESHOLDS) == sorted(set(THRESHOLDS), reverse=True)
    with pytest.raises(ValueError, match="must fall"):
        threshold_tests([0.9], [True], risk=0.1, confidence=0.9, thresholds=(0.5, 0.9))
    with pytest.raises(ValueError, match="1 scores for 2"):
        threshold_tests([0.9], [True, True], risk=0.1, confidence=0.9)


def test_each_group_must_keep_its_own_risk() -> None:
    """A few wrong readings, all of one small group: together they keep the risk, in that group they do not."""
    scores = np.r_[np.full(4000, 0.99), np.full(100, 0.95)]
    right = np.r_[np.ones(4000, dtype=bool), np.arange(100) >= 12]
    groups = [("large",)] * 4000 + [("small", "late")] * 100
    thresholds = (0.99, 0.95)
    options = {"risk": 0.01, "confidence": 0.95, "thresholds": thresholds}
    together = threshold_tests(scores.tolist(), right.tolist(), **options)
    each = threshold_tests(scores.tolist(), right.tolist(), groups=groups, **options)
    assert [test.shown for test in together] == [Shown.YES, Shown.YES]
    assert share_bounds(12, 100, confidence=0.95)[1] > 0.05
    # at the stricter threshold nothing of the small group is accepted, so it is not tested by itself
    assert [test.shown for test in each] == [Shown.YES, Shown.NO]
    proven = proven_threshold(each)
    assert proven is not None
    assert proven.threshold == 0.99
    with pytest.raises(ValueError, match="2 scores for 2 readings of 1 groups"):
        threshold_tests([0.9, 0.8], [True, True], groups=[("one",)], **options)


def steepness(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Scores and right readings whose share wrong is 1.5 (1 - score): the risk at a threshold t is 0.75 (1 - t)."""
    scores = rng.random(3000)
    return scores, rng.random(3000) >= np.clip(1.5 * (1.0 - scores), 0.0, 1.0)


@pytest.mark.parametrize("start_share", [0.3, 1.0])
def test_thresholds_of_risks_keep_them_and_fall_with_the_risk(start_share: float) -> None:
    """Over many draws, the true risk at the chosen threshold exceeds the promised one in at most 1 of 20."""
    risks, thresholds = (0.1, 0.05, 0.03), tuple(np.round(np.arange(0.99, 0.3, -0.01), 2))
    exceeded = dict.fromkeys(risks, 0)
    for seed in range(RUNS):
        scores, right = steepness(np.random.default_rng((9, seed)))
        proven = risk_thresholds(
            scores.tolist(),
            right.tolist(),
            risks,
            confidence=0.95,
            thresholds=thresholds,
            start_share=start_share,
        )
        chosen = [proven[risk].threshold for risk in risks if risk in proven]
        assert chosen == sorted(chosen)
        for risk, test in proven.items():
            exceeded[risk] += 0.75 * (1.0 - test.threshold) > risk
    assert max(exceeded.values()) <= binom.ppf(0.999, RUNS, 0.05)


@given(
    st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans(), st.sampled_from(["A", "B", "AC"])), max_size=120)
)
def test_the_sequence_of_tests_is_fixed(readings: list[tuple[float, bool, str]]) -> None:
    """Too few, then shown, then one not shown, then none tested; the tested groups keep the bound where it is shown."""
    scores, right, groups = (
        (list(column) for column in zip(*readings, strict=True)) if readings else ([],) * 3
    )
    tests = threshold_tests(scores, right, risk=0.15, confidence=0.9, groups=groups)
    order = {Shown.TOO_FEW: 0, Shown.YES: 1, Shown.NO: 2, Shown.NOT_TESTED: 3}
    steps = [order[test.shown] for test in tests]
    assert steps == sorted(steps)
    assert steps.count(2) <= 1
    for threshold in (test.threshold for test in tests if test.shown is Shown.YES):
        for name, most in (("", 0.15), *((name, 0.75) for name in set("".join(groups)))):
            wrong = [not good for score, good, groups in readings if score >= threshold and name in groups]
            if not name or len(wrong) >= parts_needed(most, confidence=0.9):
                assert share_bounds(sum(wrong), len(wrong), confidence=0.9)[1] <= most


def test_a_group_that_is_too_small_for_a_risk_does_not_lower_its_threshold() -> None:
    """Of the 95 readings of a group ten are wrong: too many for five times 2 %, and too few to be tested for 3 %."""
    scores = [0.99] * 3000 + [0.9] * 95
    right = [True] * 3000 + [True] * 85 + [False] * 10
    groups = [("many",)] * 3000 + [("few",)] * 95
    by_risk = {
        risk: risk_thresholds(
            scores, right, (risk,), confidence=0.95, thresholds=(0.95, 0.85), groups=groups
        )[risk].threshold
        for risk in (0.02, 0.006)
    }
    assert by_risk == {0.02: 0.95, 0.006: 0.85}
    together = risk_thresholds(
        scores, right, (0.02, 0.006), confidence=0.95, thresholds=(0.95, 0.85), groups=groups
    )
    assert {risk: test.threshold for risk, test in together.items()} == {0.02: 0.95, 0.006: 0.95}


def test_a_risk_that_nothing_shows_has_no_threshold() -> None:
    few: Mapping[float, ThresholdTest] = risk_thresholds(
        [0.99] * 40, [True] * 40, (0.1, 0.001), confidence=0.95
    )
    assert set(few) == {0.1}
