"""Grades of marks that were read: clean ones are good, wiped and littered ones are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.stamping.stamp import StampedPart
from recognition.glyph_match.correlation import Image
from recognition.glyph_match.predicted import PIXELS
from recognition.glyph_match.template_cache import TemplateCache
from recognition.marks.grade import Action, MarkGrade, grades_of, is_of_the_part
from recognition.marks.laid_text import LaidText, laid_text
from recognition.views.view import View
from whisker_array.whisker.touch import Touch

TEXT = "K71B"
SPOILT = 1
MOST_WIDE = 0.7
"""Of a character and the land beside it, character heights."""


@pytest.fixture(scope="module")
def laid(
    calm_part: StampedPart, calm_view: View, gothic: Font, touch: Touch, stamped_line: Callable
) -> LaidText:
    """A faultless line in the templates."""
    line, columns = stamped_line(calm_part)
    made = laid_text(
        calm_view, touch, line, columns, TEXT, (gothic,), cache=TemplateCache(), chars=TEXT, raised=False
    )
    assert made is not None
    return made


def grades(laid: LaidText) -> list[MarkGrade]:
    found = [grade for grade in grades_of(laid) if grade is not None]
    assert len(found) == len(laid.text)
    return found


def spoilt(laid: LaidText) -> tuple[LaidText, Image]:
    """The same line with an image of its own, and the part of it about a character."""
    image = laid.image.copy()
    row, column = int(laid.rows[SPOILT]), int(laid.columns[SPOILT])
    tall, wide = round(0.6 * PIXELS), round(0.5 * MOST_WIDE * PIXELS)
    return replace(laid, image=image), image[row - tall : row + tall + 1, column - wide : column + wide + 1]


def wiped(laid: LaidText, share: float) -> LaidText:
    """Without a share of the columns of a character."""
    made, window = spoilt(laid)
    window[:, : round(share * window.shape[1])] = 0.0
    return made


def littered(laid: LaidText, count: int) -> LaidText:
    """Grains with steep sides where the character has no stroke: left and below of a 7's."""
    made, window = spoilt(laid)
    rows, cols = window.shape[0], round(0.4 * window.shape[1])
    strongest = float(np.abs(window).max())
    rng = np.random.default_rng(3)
    for _ in range(count):
        r, c = int(rng.integers(rows // 2, rows - 4)), int(rng.integers(0, cols - 3))
        window[r : r + 3, c : c + 3] = strongest * np.array([1.0, 1.0, -1.0, -1.0])
    return made


def with_char(laid: LaidText, char: str) -> LaidText:
    """The line with another character at one place."""
    return replace(laid, text=(*laid.text[:SPOILT], char, *laid.text[SPOILT + 1 :]))


def value(grade: MarkGrade, name: str) -> float:
    found = grade.value(name)
    assert found is not None
    return found


def test_clean_marks_have_the_best_grade(laid: LaidText) -> None:
    for grade in grades(laid):
        assert (grade.letter, grade.action) == ("A", Action.NONE)
        # how deep a mark should be nobody has said
        assert grade.value("depth") is None
        assert value(grade, "completeness") > 0.95
        assert value(grade, "contamination") < 0.01


def test_the_more_is_wiped_the_less_complete(laid: LaidText) -> None:
    found = [grades(wiped(laid, share)) for share in (0.0, 0.45, 0.6)]
    told = [value(g[SPOILT], "completeness") for g in found]
    assert (np.diff(told) < -0.05).all()
    worst = found[-1][SPOILT]
    assert worst.grade < 3
    assert worst.limiting == "completeness"
    # nobody else is the worse for it
    for k in set(range(len(TEXT))) - {SPOILT}:
        assert found[-1][k] == found[0][k]


def test_a_mark_that_is_gone_is_no_mark(laid: LaidText) -> None:
    gone = grades(wiped(laid, 1.0))[SPOILT]
    assert gone.letter == "F"
    assert gone.action is not Action.NONE


def test_litter_is_told_from_strokes(laid: LaidText) -> None:
    found = [grades(littered(laid, count))[SPOILT] for count in (0, 3, 30)]
    assert (np.diff([value(g, "contamination") for g in found]) > 0.0).all()
    worst = found[-1]
    assert worst.grade < 3
    assert worst.limiting == "contamination"
    # what is felt of the strokes stays
    assert value(worst, "completeness") == pytest.approx(value(found[0], "completeness"), abs=0.05)


def test_a_faint_line_has_less_contrast(laid: LaidText) -> None:
    shares = (0.2, 0.4)
    low, high = (grades(replace(laid, image=laid.image * np.float32(s))) for s in shares)
    for one, other in zip(low, high, strict=True):
        # in proportion, as long as it is not cut off at 1; single precision
        assert value(other, "contrast") == pytest.approx(2.0 * value(one, "contrast"), rel=1e-3)
        # the best of a neighbourhood counts, more than what is predicted: bars felt crosswise by half and more
        assert 1.0 <= value(one, "contrast") / shares[0] < 1.8
        assert value(other, "completeness") > 0.95
        assert value(other, "contamination") < 0.01
        assert one.grade < other.grade < 4


def test_what_both_directions_feel_alike_is_no_edge(laid: LaidText) -> None:
    assert [g.letter for g in grades(replace(laid, image=laid.image + np.float32(0.5)))] == ["A"] * len(TEXT)


def test_directions_that_were_not_felt_are_not_missed(laid: LaidText) -> None:
    image = laid.image.copy()
    image[..., 1::2] = 0.0
    for grade in grades(replace(laid, image=image)):
        assert value(grade, "completeness") > 0.95


def test_the_character_that_was_read_is_what_it_is_graded_against(laid: LaidText) -> None:
    found = grades(with_char(laid, "B"))
    # a 7 is no complete B
    assert value(found[SPOILT], "completeness") < 0.8
    assert found[0] == grades(laid)[0]
    assert not is_of_the_part(found[SPOILT])
    assert is_of_the_part(found[0])


def test_a_character_without_a_template_is_not_graded(laid: LaidText) -> None:
    assert [grade is None for grade in grades_of(with_char(laid, "Z"))] == [False, True, False, False]


def test_a_character_beyond_the_map_is_not_graded(laid: LaidText) -> None:
    columns = laid.columns.copy()
    columns[-1] = laid.image.shape[1] + 2 * PIXELS
    made = grades_of(replace(laid, columns=columns))
    assert [grade is None for grade in made] == [False, False, False, True]
