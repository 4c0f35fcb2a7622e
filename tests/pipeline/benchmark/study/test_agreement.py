"""Attribute agreement and gauge studies against published examples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import betaincinv

from pipeline.benchmark.study.agreement import Kind, agreements, fleiss_kappa, mean_cohen_kappa
from pipeline.benchmark.study.gauge import gauge_rr

RATINGS = {
    "A": {"p1": ("K4", "K4"), "p2": ("R7", "B7"), "p3": ("X1", "X1"), "p4": ("", "")},
    "B": {"p1": ("K4", "K4"), "p2": ("R7", "R7"), "p3": ("X2", "X2")},
    "C": {"p1": ("K4",), "p2": ("R7",), "p3": ("X1",)},
}
TRUTH = {"p1": "K4", "p2": "R7", "p3": "X1"}


def test_every_comparison_is_made_on_the_parts_it_can_be_made_on() -> None:
    comparisons = [
        (a.kind, a.who, a.parts.count, a.parts.total, a.disagreed) for a in agreements(RATINGS, TRUTH)
    ]
    assert comparisons == [
        (Kind.WITHIN, "A", 3, 4, ("p2",)),
        (Kind.WITHIN, "B", 3, 3, ()),
        (Kind.BETWEEN, "A, B, C", 1, 3, ("p2", "p3")),
        (Kind.PAIR, "A, B", 1, 3, ("p2", "p3")),
        (Kind.PAIR, "A, C", 2, 3, ("p2",)),
        (Kind.PAIR, "B, C", 2, 3, ("p3",)),
        (Kind.TRUTH, "A", 2, 3, ("p2",)),
        (Kind.TRUTH, "B", 2, 3, ("p3",)),
        (Kind.TRUTH, "C", 3, 3, ()),
        (Kind.ALL_TRUTH, "A, B, C", 1, 3, ("p2", "p3")),
    ]


def test_intervals_are_exact_and_kappas_fit() -> None:
    by_kind = {(a.kind, a.who): a for a in agreements(RATINGS, TRUTH)}
    within = by_kind[Kind.WITHIN, "A"].parts
    assert within.low == pytest.approx(betaincinv(3, 2, 0.025))  # Clopper and Pearson, two-sided
    assert within.high == pytest.approx(betaincinv(4, 1, 0.975))
    all_right = by_kind[Kind.TRUTH, "C"].kappa
    assert all_right is not None
    assert all_right.value == pytest.approx(1.0)
    # A's first trial is all right, kappa 1; of the second 2 of 3 agree, by chance 2/9: kappa 4/7
    a = by_kind[Kind.TRUTH, "A"].kappa
    assert a is not None
    assert a.value == pytest.approx(0.5 * (1.0 + (2 / 3 - 2 / 9) / (1.0 - 2 / 9)))


def test_one_appraiser_once_is_no_study_and_uneven_trials_are_refused() -> None:
    assert agreements({"C": RATINGS["C"]}) == []
    with pytest.raises(ValueError, match="equally often"):
        agreements({"A": {"p1": ("K4", "K4"), "p2": ("R7",)}})


PSYCHIATRISTS = [
    (0, 0, 0, 0, 14), (0, 2, 6, 4, 2), (0, 0, 3, 5, 6), (0, 3, 9, 2, 0), (2, 2, 8, 1, 1),
    (7, 7, 0, 0, 0), (3, 2, 6, 3, 0), (2, 5, 3, 2, 2), (6, 5, 2, 1, 0), (0, 2, 2, 3, 7),
]  # fmt: skip
"""Ten parts rated by fourteen into five classes, how many into each: the worked example of Wikipedia's "Fleiss'
kappa", 0.210 there."""


def test_fleiss_of_the_worked_example() -> None:
    ratings = [[str(k) for k, n in enumerate(row) for _ in range(n)] for row in PSYCHIATRISTS]
    kappa = fleiss_kappa(ratings)
    assert kappa is not None
    assert kappa.value == pytest.approx(0.210, abs=5e-4)
    assert kappa.low < kappa.value < kappa.high


@pytest.mark.parametrize("seed", range(5))
def test_cohen_agrees_with_scikit_learn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = rng.choice(list("ABCD"), size=60)
    second = np.where(rng.random(60) < 0.6, first, rng.choice(list("ABCD"), size=60))
    from sklearn.metrics import cohen_kappa_score

    kappa, back = (mean_cohen_kappa([(list(a), list(b))]) for a, b in ((first, second), (second, first)))
    assert kappa is not None
    assert back is not None
    assert kappa.value == pytest.approx(cohen_kappa_score(first, second))
    assert mean_cohen_kappa([(list(first), list(second)), (list(second), list(first))]) == kappa


def test_all_alike_have_no_kappa_and_serials_of_their_own_have_the_share() -> None:
    assert fleiss_kappa([["A", "A"], ["A", "A"]]) is None
    assert mean_cohen_kappa([(["A", "A"], ["A", "A"])]) is None
    assert mean_cohen_kappa([([], [])]) is None
    serials = [[f"S{k}", f"S{k}"] for k in range(40)]
    assert fleiss_kappa(serials).value == pytest.approx(1.0)  # type: ignore[union-attr]
    serials[:4] = [[f"S{k}", f"T{k}"] for k in range(4)]
    # 36 of 40 agree; by chance about 1 in 40 does
    assert fleiss_kappa(serials).value == pytest.approx(0.9, abs=0.005)  # type: ignore[union-attr]


def test_ratings_that_do_not_match_are_refused() -> None:
    with pytest.raises(ValueError, match="same number of ratings"):
        fleiss_kappa([["A", "A"], ["A"]])


AIAG = np.array(
    [
        [[0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
         [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
         [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31]],
        [[0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
         [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
         [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50]],
        [[0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
         [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
         [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16]],
    ]
).transpose(2, 0, 1)  # fmt: skip
"""Three appraisers, three trials, ten parts: AIAG, Measurement Systems Analysis, 4th edition, figure III-B 6."""


def test_the_manuals_example() -> None:
    """Table III-B 7 and the ones after it."""
    study = gauge_rr(AIAG)
    rows = {row.source: row for row in study.table}
    assert rows["parts"].squares == pytest.approx(88.3619, abs=1e-4)
    assert rows["appraisers"].squares == pytest.approx(3.1673, abs=1e-4)
    assert rows["parts x appraisers"].squares == pytest.approx(0.3590, abs=1e-4)
    assert rows["repeatability"].squares == pytest.approx(2.7589, abs=1e-4)
    assert rows["total"].squares == pytest.approx(94.6471, abs=1e-4)
    assert [rows[s].freedom for s in ("parts", "appraisers", "parts x appraisers", "repeatability", "total")] == [
        9, 2, 18, 60, 89,
    ]  # fmt: skip
    assert rows["parts x appraisers"].f == pytest.approx(0.434, abs=1e-3)
    assert study.pooled
    assert study.repeatability_mm == pytest.approx(0.199933, abs=1e-6)
    assert study.reproducibility_mm == pytest.approx(0.226838, abs=1e-6)
    assert study.gauge_mm == pytest.approx(0.302373, abs=2e-6)  # rounded in between there
    assert study.part_mm == pytest.approx(1.042327, abs=1e-6)
    assert study.share == pytest.approx(0.279, abs=5e-4)
    assert study.categories == 4
    assert study.verdict == "marginal"


@pytest.mark.parametrize("appraisers", [1, 20])
def test_what_was_put_in_comes_out(appraisers: int) -> None:
    """200 parts, 3 trials: the deviations come out within 10 %; of 20 appraisers within four standard errors."""
    rng = np.random.default_rng(5)
    x = 0.2 + 0.02 * rng.standard_normal((200, 1, 1)) + 0.003 * rng.standard_normal((200, appraisers, 3))
    x = x + 0.005 * rng.standard_normal((1, appraisers, 1)) * (appraisers > 1)
    x = x + 0.004 * rng.standard_normal((200, appraisers, 1)) * (appraisers > 1)
    study = gauge_rr(x)
    assert study.part_mm == pytest.approx(0.02, rel=0.15)
    assert study.repeatability_mm == pytest.approx(0.003, rel=0.1)
    if appraisers == 1:
        assert study.reproducibility_mm is None
    else:
        assert not study.pooled
        # of 20 appraisers the standard error is 0.005 / sqrt(40)
        assert study.reproducibility_mm == pytest.approx(np.hypot(0.005, 0.004), abs=4 * 0.005 / 40**0.5)


def test_a_gauge_that_never_varies() -> None:
    study = gauge_rr(np.repeat([0.125, 0.25, 0.5], 4).reshape(3, 2, 2))
    assert (study.gauge_mm, study.share, study.categories, study.verdict) == (0.0, 0.0, None, "good")
    alike = gauge_rr(np.full((3, 1, 2), 0.25))
    assert (alike.total_mm, alike.share) == (0.0, 0.0)


@pytest.mark.parametrize("shape", [(1, 2, 2), (2, 2, 1), (4, 4)])
def test_too_few_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="shape"):
        gauge_rr(np.zeros(shape))


def test_an_unknown_depth_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        gauge_rr(np.full((2, 2, 2), np.nan))
