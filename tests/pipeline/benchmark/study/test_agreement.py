"""Agreement counted by hand; kappas against published examples and scikit-learn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta
from sklearn.metrics import cohen_kappa_score

from pipeline.benchmark.study.agreement import Kind, agreements, fleiss_kappa, mean_cohen_kappa

RATINGS = {
    "A": {"p1": ("K4", "K4"), "p2": ("R7", "B7"), "p3": ("X1", "X1"), "p4": ("", "")},
    "B": {"p1": ("K4", "K4"), "p2": ("R7", "R7"), "p3": ("X2", "X2")},
    "C": {"p1": ("K4",), "p2": ("R7",), "p3": ("X1",)},
}
TRUTH = {"p1": "K4", "p2": "R7", "p3": "X1"}


def test_every_comparison_is_made_on_the_parts_it_can_be_made_on() -> None:
    found = [(a.kind, a.who, a.parts.count, a.parts.total, a.disagreed) for a in agreements(RATINGS, TRUTH)]
    assert found == [
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
    assert within.low == pytest.approx(beta.ppf(0.025, 3, 2))  # Clopper and Pearson, two-sided
    assert within.high == pytest.approx(beta.ppf(0.975, 4, 1))
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
    kappa, back = (mean_cohen_kappa([(list(a), list(b))]) for a, b in ((first, second), (second, first)))
    assert kappa is not None
    assert back is not None
    assert kappa.value == pytest.approx(cohen_kappa_score(first, second))
    assert mean_cohen_kappa([(list(first), list(second)), (list(second), list(first))]) == kappa


def test_all_alike_have_no_kappa_and_serials_of_their_own_have_the_share() -> None:
    assert fleiss_kappa([["A", "A"], ["A", "A"]]) is None
    assert mean_cohen_kappa([(["A", "A"], ["A", "A"])]) is None
    assert mean_cohen_kappa([([], [])]) is None
    own = [[f"S{k}", f"S{k}"] for k in range(40)]
    assert fleiss_kappa(own).value == pytest.approx(1.0)  # type: ignore[union-attr]
    own[:4] = [[f"S{k}", f"T{k}"] for k in range(4)]
    # 36 of 40 agree; by chance about 1 in 40 does
    assert fleiss_kappa(own).value == pytest.approx(0.9, abs=0.005)  # type: ignore[union-attr]


def test_ratings_that_do_not_match_are_refused() -> None:
    with pytest.raises(ValueError, match="same number of ratings"):
        fleiss_kappa([["A", "A"], ["A"]])
