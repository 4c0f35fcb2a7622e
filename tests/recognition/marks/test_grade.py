"""Grades of marks: each parameter falls with what it measures, and only with that."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.marks.grade import Action, MarkGrade, grade_character, grade_value

ROWS, COLS = 46, 36


def template() -> np.ndarray:
    """Edges of an E as touch feels them, a falling and a rising edge beside each stroke; (2, rows, cols)."""
    height = np.zeros((ROWS, COLS))
    height[5:41, 8:12] = -1.0
    for row in (5, 21, 37):
        height[row : row + 4, 8:28] = -1.0
    return np.stack([-np.diff(height, axis=1, prepend=0.0), -np.diff(height, axis=0, prepend=0.0)])


E = template()
NOISE = 0.05 * np.random.default_rng(1).normal(size=E.shape)


def grade(felt: np.ndarray, *, tolerance_px: int = 1) -> MarkGrade:
    graded = grade_character(felt, E, tolerance_px=tolerance_px)
    assert graded is not None
    return graded


def test_a_good_mark_is_an_a() -> None:
    good = grade(E + NOISE)
    assert (good.letter, good.grade, good.action, good.limiting) == ("A", 4, Action.NONE, "")
    assert [p.name for p in good.parameters] == ["contrast", "completeness", "contamination"]
    assert all(p.grade == 4 for p in good.parameters)


def test_a_small_shift_costs_nothing() -> None:
    assert grade(np.roll(E, (1, 1), axis=(1, 2))).letter == "A"


def test_a_shallow_mark_is_to_be_struck_again() -> None:
    shallow = grade(0.2 * E)
    assert shallow.action is Action.RE_STRIKE
    assert shallow.letter == "F"
    assert shallow.value("completeness") == 1.0
    assert shallow.value("contamination") == 0.0
    assert "too shallow" in shallow.action.message
    assert shallow.limiting == "contrast"


def test_a_filled_mark_is_to_be_cleaned_first() -> None:
    filled = E.copy()
    filled[:, 18:] = 0.0
    graded = grade(filled + NOISE)
    assert graded.action is Action.CLEAN_FIRST
    assert graded.limiting == "completeness"
    assert graded.value("contrast") > 0.9
    assert graded.value("completeness") == pytest.approx(
        1.0 - np.abs(E[:, 18:]).sum() / np.abs(E).sum(), abs=0.05
    )


def test_swarf_beside_the_strokes_is_to_be_cleaned() -> None:
    dirty = E.copy()
    dirty[0, 2:44, 31:36] += 1.5
    graded = grade(dirty)
    assert graded.action is Action.CLEAN
    assert graded.limiting == "contamination"
    assert graded.value("contamination") == pytest.approx(42 * 5 / (ROWS * COLS), abs=0.01)


@given(
    st.sampled_from(["contrast", "completeness", "contamination"]), st.floats(0.0, 1.0), st.floats(0.0, 1.0)
)
def test_grades_follow_values(name: str, one: float, other: float) -> None:
    low, high = sorted((one, other))
    worse, better = (high, low) if name == "contamination" else (low, high)
    assert 0 <= grade_value(name, worse) <= grade_value(name, better) <= 4


def test_the_opposite_polarity_is_not_the_mark() -> None:
    """A raised character in place of a sunk one answers nowhere: what is felt counts against it."""
    assert grade(-E, tolerance_px=0).letter == "F"


def test_a_template_without_edges_grades_nothing() -> None:
    assert grade_character(E, 0.0 * E) is None
