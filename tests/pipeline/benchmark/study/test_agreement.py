"""Agreement counted by hand."""

from __future__ import annotations

import pytest
from scipy.stats import beta

from pipeline.benchmark.study.agreement import Kind, agreements

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
