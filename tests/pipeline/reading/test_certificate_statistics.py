"""What is accepted wrongly at most, the threshold that holds a risk, and whether parts are like the certified ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import binom

from pipeline.reading.certificate_statistics import (
    LEAST_PARTS,
    THRESHOLDS,
    KindOfParts,
    Shown,
    certified_threshold,
    parts_missing,
    parts_needed,
    share_bounds,
    threshold_tests,
    unlike,
)
from recognition.decide.score import Measure, roughness

RISK, CONFIDENCE = 0.05, 0.9
RUNS, PARTS = 200, 300
Floats = np.ndarray


def of_draw(said: Floats, right: Floats) -> tuple:
    return threshold_tests(said.tolist(), right.tolist(), risk=RISK, confidence=CONFIDENCE)


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
    said = np.r_[np.full(200, 0.9995), np.full(100, 0.96), np.full(60, 0.91)]
    right = np.r_[np.ones(300, dtype=bool), np.zeros(60, dtype=bool)]
    tests = of_draw(said, right)
    chosen = certified_threshold(tests)
    assert chosen is not None
    assert (chosen.threshold, chosen.accepted, chosen.wrong) == (0.92, 300, 0)
    assert chosen.bound <= RISK
    by_threshold = {test.threshold: test.shown for test in tests}
    assert by_threshold[0.9999] is Shown.TOO_FEW
    assert by_threshold[0.91] is Shown.NO
    assert by_threshold[0.5] is Shown.NOT_TESTED


def test_too_few_parts_say_how_many_are_missing() -> None:
    said, right = np.full(20, 0.97), np.ones(20, dtype=bool)
    tests = of_draw(said, right)
    assert certified_threshold(tests) is None
    # 45 accepted ones without a wrong one show 5 % at 90 %; of 40 parts half were accepted
    missing = parts_missing(tests, 40, risk=RISK, confidence=CONFIDENCE)
    assert missing == 50
    more = round(20 * (40 + missing) / 40)
    assert certified_threshold(of_draw(np.full(more, 0.97), np.ones(more, dtype=bool))) is not None


def test_no_number_of_parts_helps_a_reader_that_is_too_often_wrong() -> None:
    right = np.arange(100) % 10 > 0
    assert parts_missing(of_draw(np.full(100, 0.97), right), 100, risk=RISK, confidence=CONFIDENCE) is None
    assert parts_missing(of_draw(np.zeros(0), np.zeros(0)), 9, risk=RISK, confidence=CONFIDENCE) is None


def _steep(said: Floats) -> Floats:
    return np.clip(1.3 * (1.0 - said), 0.0, 1.0)


def _overconfident(said: Floats) -> Floats:
    return 0.01 + 0.6 * (1.0 - said)


def _just_too_risky(said: Floats) -> Floats:
    return np.full(said.shape, RISK * 1.02)


def _worst_where_surest(said: Floats) -> Floats:
    """What the guarantee takes for granted not to be: the surest are wrong more often."""
    return np.where(said > 0.995, 0.08, 0.04)


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
        said = drawn(PARTS)
        chosen = certified_threshold(of_draw(said, rng.random(PARTS) >= wrong_at(said)))
        if chosen is not None:
            accepted = int(np.searchsorted(-many, -chosen.threshold, side="right"))
            exceeded += true_risk[accepted - 1] > RISK
    # at most 1 - confidence of the runs, and what chance may add to that in so many: 1 in 1,000
    assert exceeded <= binom.ppf(0.999, RUNS, 1.0 - CONFIDENCE)


def test_thresholds_fall() -> None:
    assert list(THRESHOLDS) == sorted(set(THRESHOLDS), reverse=True)
    with pytest.raises(ValueError, match="must fall"):
        threshold_tests([0.9], [True], risk=0.1, confidence=0.9, thresholds=(0.5, 0.9))
    with pytest.raises(ValueError, match="1 confidences for 2"):
        threshold_tests([0.9], [True, True], risk=0.1, confidence=0.9)


def parts(n: int, seed: int, *, rough_um: float = 1.0) -> list[dict[Measure, float]]:
    rng = np.random.default_rng(seed)
    return [
        {
            Measure.CONFIDENCE: float(np.round(1.0 - 0.1 * rng.beta(1, 8), 6)),
            Measure.FINE: float(rough_um * rng.lognormal(0.0, 0.2)),
        }
        for _ in range(n)
    ]


def test_rougher_parts_are_unlike_and_it_says_in_what() -> None:
    kind = KindOfParts.of(parts(40, 1))
    (found,) = unlike(kind, parts(20, 2, rough_um=3.0))
    assert found.measure is Measure.FINE
    assert found.certified == pytest.approx(1.0, rel=0.15)
    assert found.now == pytest.approx(3.0, rel=0.2)
    assert "fine roughness" in str(found)


def test_too_few_parts_are_not_judged() -> None:
    kind = KindOfParts.of(parts(40, 1))
    assert not unlike(kind, parts(LEAST_PARTS - 1, 2, rough_um=9.0))
    assert not KindOfParts.of(parts(LEAST_PARTS - 1, 1)).values


def test_parts_of_the_same_kind_are_hardly_ever_called_unlike() -> None:
    # 300 tests at 1 in 10,000: one false alarm has a chance of 3 %, two of 0.04 %
    alarms = sum(bool(unlike(KindOfParts.of(parts(60, 2 * k)), parts(40, 2 * k + 1))) for k in range(300))
    assert alarms <= 1


def test_of_many_parts_quantiles_are_kept() -> None:
    kind = KindOfParts.of(parts(3000, 1), most_kept=200)
    assert {len(values) for values in kind.values.values()} == {200}
    assert not unlike(kind, parts(200, 2))
    assert unlike(kind, parts(200, 3, rough_um=1.3))


def test_values_that_are_no_summary_are_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        KindOfParts({Measure.FINE: (0.0, float("nan"))})
    with pytest.raises(ValueError, match="are not ascending"):
        KindOfParts({Measure.FINE: (1.0, 0.0)})


def test_roughness_is_that_of_the_land_and_not_of_the_marks() -> None:
    rng = np.random.default_rng(5)
    land = rng.normal(0.0, 2.0, (200, 300))
    tilted = land + np.arange(300) * 0.7
    tilted[80:120, ::30] -= 200.0
    # a median of 1e5 dependent values; grooves over 0.7 % of the samples add a little
    assert roughness(tilted, 2) == pytest.approx(2.0, rel=0.05)
    tilted[:, 250:] = np.nan
    assert roughness(tilted, 2) == pytest.approx(2.0, rel=0.05)
    assert np.isnan(roughness(np.zeros((2, 2)), 4))
