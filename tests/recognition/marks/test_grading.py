"""Grades of marks: each parameter falls with what it measures, on made-up edges and on marks that were read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.fonts.glyph import Font
from glyphs.stamping.stamp import StampedPart
from recognition.glyph_match.felt_line import felt_line
from recognition.glyph_match.predicted import TemplateSet, predict_templates, template_key
from recognition.marks.grade import (
    Action,
    MarkGrade,
    edge_fit,
    edges_of,
    grade_character,
    grade_value,
    grades_of,
)
from recognition.marks.laid_text import LaidText, laid_text
from recognition.see.text_line import HEIGHT_ROWS
from recognition.see.view import EDGES, KNOWN, Layers, View
from tests.support.felt import stamped_line
from whisker_array.whisker.touch import Touch

# ------------------------------------------------------------------------------------------------------------- grade

ROWS, COLS = 46, 36


def edges_of_an_e() -> np.ndarray:
    """Edges of an E as touch feels them, a falling and a rising edge beside each stroke; (2, rows, cols)."""
    height = np.zeros((ROWS, COLS))
    height[5:41, 8:12] = -1.0
    for row in (5, 21, 37):
        height[row : row + 4, 8:28] = -1.0
    return np.stack([-np.diff(height, axis=1, prepend=0.0), -np.diff(height, axis=0, prepend=0.0)])


E = edges_of_an_e()
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


# ----------------------------------------------------------------------------------------------------------- grading

TEXT = "K71B"
Grades = Callable[[LaidText], list[MarkGrade]]
SPOILT = 1
MOST_WIDE = 0.7
"""Of a character and the land beside it, character heights."""


@pytest.fixture(scope="module")
def laid(calm_part: StampedPart, calm_view: View, gothic: Font) -> LaidText:
    """A faultless line in the templates."""
    laid_line = laid_text(felt_line(calm_view, *stamped_line(calm_part), TEXT, (gothic,)), TEXT, (gothic,))
    assert laid_line is not None
    return laid_line


@pytest.fixture(scope="module")
def templates(gothic: Font, touch: Touch) -> TemplateSet:
    return predict_templates(gothic, TEXT, template_key(gothic, touch, height_mm=5.0))


@pytest.fixture(scope="module")
def grades(templates: TemplateSet) -> Grades:
    def graded(laid: LaidText) -> list[MarkGrade]:
        graded = [grade for grade in grades_of(edges_of(laid, templates)) if grade is not None]
        assert len(graded) == len(laid.text)
        return graded

    return graded


def with_edges(laid: LaidText, edges: Layers) -> LaidText:
    """The same line, laid as it is, with other edges."""
    layers = laid.felt.view.layers.copy()
    layers[EDGES:KNOWN] = edges
    return replace(laid, felt=replace(laid.felt, view=replace(laid.felt.view, layers=layers)))


def map_of(laid: LaidText) -> Layers:
    return laid.felt.view.layers[EDGES:KNOWN]


def spoilt(laid: LaidText) -> tuple[Layers, Layers]:
    """The edges of the line, of its own, and the part of them about a character."""
    view, reach = laid.felt.view, np.array([0.5 * MOST_WIDE, 0.6])
    edges = map_of(laid).copy()
    corners = laid.points_mm(SPOILT, np.stack([-reach, reach]))
    (x0, y0), (x1, y1) = np.rint((corners - view.origin_mm) / view.pitch_mm).astype(int)
    return edges, edges[:, y0 : y1 + 1, x0 : x1 + 1]


def wiped(laid: LaidText, share: float) -> LaidText:
    """Without a share of the columns of a character."""
    edges, window = spoilt(laid)
    window[:, :, : round(share * window.shape[2])] = 0.0
    return with_edges(laid, edges)


def with_char(laid: LaidText, char: str) -> LaidText:
    """The line with another character at one place."""
    return replace(laid, text=(*laid.text[:SPOILT], char, *laid.text[SPOILT + 1 :]))


def value(grade: MarkGrade, name: str) -> float:
    graded = grade.value(name)
    assert graded is not None
    return graded


def test_clean_marks_have_the_best_grade(laid: LaidText, grades: Grades) -> None:
    for grade in grades(laid):
        assert (grade.letter, grade.action) == ("A", Action.NONE)
        # how deep a mark should be nobody has said
        assert grade.value("depth") is None
        assert value(grade, "completeness") > 0.95
        assert value(grade, "contamination") < 0.01


def test_the_more_is_wiped_the_less_complete(laid: LaidText, grades: Grades) -> None:
    graded = [grades(wiped(laid, share)) for share in (0.0, 0.45, 0.6)]
    told = [value(g[SPOILT], "completeness") for g in graded]
    assert (np.diff(told) < -0.05).all()
    worst = graded[-1][SPOILT]
    assert worst.grade < 3
    assert worst.limiting == "completeness"
    # nobody else is the worse for it
    for k in set(range(len(TEXT))) - {SPOILT}:
        assert graded[-1][k] == graded[0][k]


def test_a_faint_line_has_less_contrast(laid: LaidText, grades: Grades) -> None:
    shares = (0.18, 0.36)
    low, high = (grades(with_edges(laid, map_of(laid) * np.float32(s))) for s in shares)
    for one, other in zip(low, high, strict=True):
        # in proportion, as long as it is not cut off at 1; single precision
        assert value(other, "contrast") == pytest.approx(2.0 * value(one, "contrast"), rel=1e-3)
        # the best of a neighbourhood counts, more than what is predicted: bars felt crosswise by half and more
        assert 1.0 <= value(one, "contrast") / shares[0] < 1.8
        assert value(other, "completeness") > 0.95
        assert value(other, "contamination") < 0.01
        assert one.grade < other.grade < 4


def test_what_both_directions_feel_alike_is_no_edge(laid: LaidText, grades: Grades) -> None:
    assert [g.letter for g in grades(with_edges(laid, map_of(laid) + np.float32(0.5)))] == ["A"] * len(TEXT)


def test_directions_that_were_not_felt_are_not_missed(laid: LaidText, grades: Grades) -> None:
    edges = map_of(laid).copy()
    edges[1::2] = 0.0
    for grade in grades(with_edges(laid, edges)):
        assert value(grade, "completeness") > 0.95


def test_the_character_that_was_read_is_what_it_is_graded_against(laid: LaidText, grades: Grades) -> None:
    graded = grades(with_char(laid, "B"))
    # a 7 is no complete B
    assert value(graded[SPOILT], "completeness") < 0.8
    assert graded[0] == grades(laid)[0]


def test_a_character_without_a_template_is_not_graded(laid: LaidText, templates: TemplateSet) -> None:
    graded = grades_of(edges_of(with_char(laid, "Z"), templates))
    assert [one is None for one in graded] == [False, True, False, False]


def test_a_character_beyond_the_map_is_not_graded(laid: LaidText, templates: TemplateSet) -> None:
    columns = laid.felt.columns.copy()
    columns[-1] += 3.0 * HEIGHT_ROWS
    laid_line = grades_of(edges_of(replace(laid, felt=replace(laid.felt, columns=columns)), templates))
    assert [one is None for one in laid_line] == [False, False, False, True]


def test_edges_fit_those_of_their_own_characters(laid: LaidText, templates: TemplateSet) -> None:
    fits = [edge_fit(edges_of(one, templates)) for one in (laid, with_char(laid, "B"), with_char(laid, "Z"))]
    assert fits[0] > 0.9
    assert fits[0] > fits[1] + 0.1
    assert fits[2] == pytest.approx(0.75 * fits[0], abs=0.05)
