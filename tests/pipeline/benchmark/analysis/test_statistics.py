"""The figures of a benchmark against formulas written out anew, counting out, and other programs."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rapidfuzz.distance import Levenshtein

from pipeline.benchmark.analysis.comparisons import compare
from pipeline.benchmark.analysis.confidence import reliability, risk_coverage
from pipeline.benchmark.analysis.estimates import Estimate, bootstrap_share, compare_characters, holm
from pipeline.benchmark.analysis.groups import (
    FATES,
    GroupKey,
    characters_right,
    confusion,
    group_of,
    mistakes,
)
from pipeline.benchmark.analysis.statistics import plain, statistics_of
from pipeline.benchmark.trials.journal import ReadCharacter, Trial
from pipeline.common.shares import share
from pipeline.common.texts import EXTRA, MISSING, align

SERIAL = st.text(alphabet="AB1", max_size=7)


def trial(truth: str, text: str, **more: object) -> Trial:
    given_: dict[str, object] = {
        "part": "p", "number": 0, "mode": "tactile",
        "decision": "accept", "confidence": 0.9,
        "characters": tuple(ReadCharacter(c, 0.9, 0.8) for c in text),
    }  # fmt: skip
    levels = {"severity": 0.3, "font": "gothic", "format": ""}
    levels |= {name: more.pop(name) for name in tuple(more) if name in levels}
    return Trial(truth=truth, text=text, levels=levels, **{**given_, **more})  # type: ignore[arg-type]


@settings(deadline=None)
@given(SERIAL, SERIAL)
def test_an_alignment_spells_both_serials_and_takes_the_fewest_edits(true: str, read: str) -> None:
    pairs = align(true, read)
    assert "".join(p.true for p in pairs if p.true != EXTRA) == true
    assert "".join(p.read for p in pairs if p.read != MISSING) == read
    assert [p.place for p in pairs if p.place is not None] == list(range(len(read)))
    edits = sum(not p.right for p in pairs)
    places = sum(a != b for a, b in zip(true, read, strict=False))
    assert edits == (places if len(true) == len(read) else Levenshtein.distance(true, read))


def test_a_serial_shifted_by_one_has_two_edits_and_all_places_wrong() -> None:
    shifted = trial("AB123456", "B1234560")
    assert characters_right(shifted) == 6
    group = group_of(GroupKey("tactile"), [shifted])
    assert (group.character_error_rate, group.place_error_rate) == (0.25, 1.0)
    assert characters_right(trial("AB123456", "AB12346")) == 7
    assert characters_right(trial("AB", "AB1111")) == 0


def test_confusion_has_a_class_of_its_own_for_missing_and_extra() -> None:
    counts = confusion([trial("A8", "A3"), trial("A8", "A"), trial("A8", "A8B")])
    assert (counts["A", "A"], counts["8", "8"]) == (3, 1)
    assert mistakes(counts) == [("8", "3", 1), ("8", MISSING, 1), (EXTRA, "B", 1)]


def test_a_share_of_nothing_knows_nothing_and_one_of_more_than_all_is_refused() -> None:
    assert (share(0, 0).value, share(0, 0).low, share(0, 0).high) == (0.0, 0.0, 1.0)
    with pytest.raises(ValueError, match="3 of 2"):
        share(3, 2)


def test_parts_drawn_again_give_the_spread_of_independent_parts() -> None:
    """The half-width against 1.96 standard errors of the mean over parts, which a few hundred parts obey."""
    rng = np.random.default_rng(4)
    right = rng.binomial(8, rng.beta(8, 2, size=300))
    estimate = bootstrap_share(right, np.full(300, 8))
    low, high = estimate.low, estimate.high
    assert estimate.value == right.sum() / 2400
    error = np.std(right / 8, ddof=1) / math.sqrt(300)
    assert (high - low) / 2 == pytest.approx(1.96 * error, rel=0.08)  # 2000 draws: quantiles to some 4 %
    assert low < right.sum() / 2400 < high
    assert high - low > 1.2 * (share(int(right.sum()), 2400).high - share(int(right.sum()), 2400).low)


def test_parts_all_alike_have_wilsons_interval_and_few_have_none() -> None:
    alike = bootstrap_share([8] * 20, [8] * 20)
    assert (alike.value, alike.high) == (1.0, 1.0)
    assert alike.low == pytest.approx(share(20, 20).low)
    equal = compare_characters([7] * 20, [7] * 20, [8] * 20).difference
    assert (-equal.low, equal.high) == pytest.approx((share(0, 20).high,) * 2)
    assert bootstrap_share([8] * 7, [8] * 7) == Estimate(1.0)
    assert bootstrap_share([], []) == Estimate(0.0)


def test_the_interval_is_the_bca_of_scipy() -> None:
    from scipy.stats import bootstrap

    rng = np.random.default_rng(6)
    right = rng.binomial(8, rng.beta(8, 1, size=60))
    estimate = bootstrap_share(right.tolist(), [8] * 60)
    again = bootstrap((right / 8,), np.mean, method="BCa", n_resamples=20000, random_state=rng)
    assert estimate.low == pytest.approx(again.confidence_interval.low, abs=0.004)
    assert estimate.high == pytest.approx(again.confidence_interval.high, abs=0.004)


def test_the_headline_is_the_mean_over_severities_and_relative_to_the_baseline_over_soils() -> None:
    def read(mode: str, texts: str) -> list[Trial]:
        """One part of ten characters at each soil and severity; its first `n` are wrong."""
        return [
            replace(
                trial("A" * 10, "B" * int(n) + "A" * (10 - int(n)), mode=mode, part=f"p{k}"),
                levels={"severity": severity, "soil": soil},
            )
            for k, (n, (soil, severity)) in enumerate(
                zip(texts, itertools.product(("rust", "mud"), (0.0, 0.3, 0.6)), strict=True)
            )
        ]

    ours, theirs = statistics_of([*read("tactile", "114012"), *read("rapidocr photo", "528136")]).headlines
    assert (ours.clean, ours.characters) == pytest.approx((0.95, 1.0 - 8 / 40))
    assert ours.relative_error == pytest.approx(0.5 * (5 / 10 + 3 / 9))
    assert theirs.relative_error == 1.0
    (alone,) = statistics_of(read("tactile", "114012")).headlines
    assert alone.relative_error is None


def test_p_values_are_corrected_by_holm() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


def test_reliability_agrees_with_scikit_learn() -> None:
    from sklearn.calibration import calibration_curve

    rng = np.random.default_rng(5)
    confidences = rng.uniform(size=3000)
    right = rng.uniform(size=3000) < confidences**1.5
    diagram = reliability(confidences, right)
    true, predicted = calibration_curve(right, confidences, n_bins=10)
    assert [b.right.value for b in diagram.bins] == pytest.approx(true.tolist())
    assert [b.confidence for b in diagram.bins] == pytest.approx(predicted.tolist())
    weights = np.histogram(confidences, bins=np.linspace(0, 1, 11))[0] / 3000
    assert diagram.error == pytest.approx(float(weights @ np.abs(true - predicted)))


def test_an_honest_confidence_has_no_calibration_error() -> None:
    diagram = reliability([0.75] * 4 + [1.0] * 5 + [0.0], [True, True, True, False] + [True] * 5 + [False])
    assert diagram.error == 0.0
    with pytest.raises(ValueError, match="between 0 and 1"):
        reliability([1.2], [True])


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from([0.1, 0.5, 0.5, 0.9]), st.booleans()), min_size=1, max_size=6))
def test_the_risk_is_the_mean_over_all_orders_that_the_confidence_allows(
    readings: list[tuple[float, bool]],
) -> None:
    orders = [
        order
        for order in itertools.permutations(readings)
        if all(a[0] >= b[0] for a, b in itertools.pairwise(order))
    ]
    wrong = np.array([[not right for _, right in order] for order in orders], dtype=float)
    risks = np.cumsum(wrong, axis=1) / np.arange(1, len(readings) + 1)
    curve = risk_coverage([c for c, _ in readings], [r for _, r in readings])
    np.testing.assert_allclose(curve.risk, risks.mean(axis=0), atol=1e-12)
    assert curve.area == pytest.approx(float(risks.mean()))
    assert curve.least_area <= curve.area + 1e-12


def test_coverage_without_risk_ends_at_the_first_mistake() -> None:
    curve = risk_coverage([0.9, 0.8, 0.7, 0.6], [True, True, False, True])
    assert curve.coverage_at(0.0) == 0.5
    assert curve.coverage_at(0.25) == 1.0
    assert risk_coverage([0.5, 0.5], [True, False]).coverage_at(0.0) == 0.0


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=7))
def test_the_permutation_test_counts_out_every_exchange(pairs: list[tuple[int, int]]) -> None:
    first, second = ([p[k] for p in pairs] for k in (0, 1))
    test = compare_characters(first, second, [4] * len(pairs))
    d = np.array(first) - np.array(second)
    sums = np.array([np.dot(signs, d) for signs in itertools.product((-1, 1), repeat=d.size)])
    assert test.difference.value == pytest.approx(d.sum() / (4 * d.size))
    assert test.p_differ == pytest.approx(np.mean(np.abs(sums) >= abs(d.sum())))
    assert test.difference.low is None  # fewer than eight parts


def test_what_became_of_the_parts() -> None:
    trials = [
        trial("A1", "A1"), trial("A1", "A7"), trial("A1", "A7", decision="review"),
        trial("A1", "A1", decision="reject"), trial("A1", "", decision="", error="it broke"),
    ]  # fmt: skip
    group = group_of(GroupKey("tactile"), trials)
    assert group.split == dict.fromkeys(FATES, 1)
    assert (group.serials.count, group.serials.total) == (2, 5)
    assert (group.characters.count, group.characters.total) == (6, 10)
    assert (group.accepted.count, group.wrong_of_accepted.count) == (2, 1)
    assert group.character_reliability.bins[-1].right.total == 8  # the error says nothing


def test_fused_is_compared_with_the_better_single_mode() -> None:
    def of(mode: str, texts: str) -> list[Trial]:
        return [trial("A", t, mode=mode, part=f"p{k}") for k, t in enumerate(texts)]

    statistics = statistics_of([*of("tactile", "AABB"), *of("vision", "AAAB"), *of("fused", "AAAA")])
    first = statistics.comparisons[0]
    assert (first.first.mode, first.second.mode) == ("fused", "vision")
    assert (first.serials.only_first, first.serials.only_second) == (1, 0)
    assert first.characters.difference.value == 0.25
    with pytest.raises(ValueError, match="same parts"):
        compare(GroupKey("fused"), of("fused", "AA"), GroupKey("tactile"), of("tactile", "A"))


def test_figures_are_plain_json_values() -> None:
    import json

    statistics = statistics_of([trial("A1", "A1"), trial("A1", "A7", part="q")])
    told = json.loads(json.dumps(plain(list(statistics.by_mode))))
    assert told[0]["serials"] == {"count": 1, "total": 2, "share": 0.5, "low": 0.094531, "high": 0.905469}
    assert told[0]["mistakes"] == [["1", "7", 1]]
    assert "compute_s" not in told[0]
