"""Limits and searches that a caller may set: those that cannot be are refused, the others count."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from recognition.marks.depth import DepthRules, SettleSearch
from recognition.marks.grade import GradeRules, grade_value
from recognition.marks.laid_strokes import PoseSearch, StrokeLimits
from recognition.marks.laid_text import FitSearch
from recognition.marks.strokes_felt import StrokeEvidence


@pytest.mark.parametrize(
    "make",
    [
        partial(PoseSearch, turns_deg=()),
        partial(PoseSearch, widths=(1.0, 0.0)),
        partial(PoseSearch, every=0),
        partial(StrokeLimits, land_steps=0),
        partial(StrokeLimits, calm_percent=101.0),
        partial(StrokeEvidence, falsely_felt=0.0),
        partial(StrokeEvidence, piece_heights=0.0),
        partial(SettleSearch, sizes=()),
        partial(SettleSearch, shift_steps=0),
        partial(DepthRules, shallow_percentile=-1.0),
        partial(DepthRules, burr_steps=0),
        partial(DepthRules, least_land=2),
        partial(FitSearch, size_step=1.0),
        partial(FitSearch, coarse_pixels=0),
        partial(GradeRules, contrast=(0.2, 0.4, 0.6, 0.8)),
        partial(GradeRules, contamination=(0.1, 0.2, 0.3)),
        partial(GradeRules, felt_share=1.5),
        partial(GradeRules, contrast_percentile=-1.0),
        partial(GradeRules, passing=5),
    ],
)
def test_limits_that_cannot_be_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=r"1 validation error|fall"):
        make()


def test_poses_and_their_costs_are_those_of_the_search() -> None:
    search = PoseSearch(
        turns_deg=(0.0, 90.0), widths=(1.0, 2.0), heights=(1.0,), turn_cost=0.01, width_cost=1.0
    )
    np.testing.assert_allclose(search.matrices[0], np.eye(2))
    np.testing.assert_allclose(search.matrices[3], [[0.0, 2.0], [-1.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(search.costs, [0.0, np.log(2.0), 0.9, 0.9 + np.log(2.0)])
    assert search.matrices is search.matrices  # made once


def test_grades_follow_the_rules_given() -> None:
    rules = GradeRules(contrast=(0.9, 0.8, 0.7, 0.6))
    assert [grade_value("contrast", value, rules=rules) for value in (0.95, 0.75, 0.5)] == [4, 2, 0]
    assert grade_value("contamination", 0.01, rules=rules) == 4
