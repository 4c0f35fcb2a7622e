"""Strokes that were felt, filled, or hidden: what they say of a character and of its rivals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.stamp import StampedPart
from recognition.decide.decision import Finding, ReadingFlag, flags_of
from recognition.decide.judges.strokes import HIDDEN_MARGIN, LEFT, missing_strokes, undecided_strokes
from recognition.decide.measures import is_dirt
from recognition.decide.reading import CharacterReading
from recognition.glyph_match.felt_line import FeltLine, felt_line
from recognition.language.confusions import CharacterState, PlaceState
from recognition.language.lattice import Lattice
from recognition.marks.grade import Action, MarkGrade, Parameter
from recognition.marks.laid_text import LaidText, laid_text
from recognition.marks.strokes import LIVE, MOST_ABSENT, PlaceStrokes, RivalStrokes, strokes_of
from recognition.see.text_line import ROWS
from tests.support.evidence import judged, text_of
from tests.support.felt import stamped_line, view_of
from whisker_array.estimation.relief import Relief, Route

TEXT = "RJ3E8"
CHARS = tuple("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789")
DEEP_MM = 0.1
"""What fills or covers a stroke in these tests; the marks are 0.19 mm deep."""
Make = Callable[..., StampedPart]


@pytest.fixture(scope="module")
def part(make_part: Make) -> StampedPart:
    return make_part(TEXT, calm=True)


def relief_of(part: StampedPart) -> Relief:
    """The surface itself for what was felt of it."""
    z = part.height_map.z_mm[::2, ::2]
    return Relief(z, None, None, 2 * part.height_map.pitch_mm, (0.0, 0.0), 0.2, None, next(iter(Route)))


def felt(part: StampedPart, relief: Relief, *, raised: bool = False) -> FeltLine:
    """The line where it was stamped."""
    return FeltLine(view_of(relief), *stamped_line(part), raised)


def strokes(
    part: StampedPart,
    relief: Relief,
    text: str,
    lattice: Lattice,
    *,
    fonts: tuple[Font, ...] = (),
    raised: bool = False,
    slope: float = 1.0,
) -> tuple[PlaceStrokes, ...]:
    laid = laid_text(felt(part, relief, raised=raised), text, fonts or (load_font("gothic"),))
    assert laid is not None
    return strokes_of(laid, lattice, slope=slope)


def lattice(text: str, **rivals: float) -> Lattice:
    """Sure of a text but for rivals, by place: p0=("P", 0.03)."""
    log = np.full((len(text), len(CHARS)), -40.0)
    for k, char in enumerate(text):
        log[k, CHARS.index(char)] = np.log(0.9)
    for place, (char, belief) in rivals.items():  # type: ignore[misc]
        log[int(place[1:]), CHARS.index(char)] = np.log(belief)
    return Lattice(CHARS, log)


def filled(
    relief: Relief, part: StampedPart, which: int, *, window: tuple[float, ...], up_mm: float = 0.0
) -> Relief:
    """A share of a character's box (left, top, right, bottom) at the level of the land, or above it."""
    x0, y0, x1, y1 = part.boxes_mm[which]
    left, top, right, bottom = window
    z = relief.height_mm.copy()
    rows = slice(
        round((y0 + top * (y1 - y0)) / relief.pitch_mm), round((y0 + bottom * (y1 - y0)) / relief.pitch_mm)
    )
    cols = slice(
        round((x0 + left * (x1 - x0)) / relief.pitch_mm), round((x0 + right * (x1 - x0)) / relief.pitch_mm)
    )
    z[rows, cols] = up_mm
    return replace(relief, height_mm=z)


def rival(places: tuple[PlaceStrokes, ...], place: int, char: str) -> RivalStrokes:
    return next(r for r in places[place].rivals if r.char == char)


def test_a_stroke_that_was_felt_excludes_who_lacks_it(part: StampedPart) -> None:
    places = strokes(part, relief_of(part), TEXT, lattice(TEXT, p0=("P", 0.05), p3=("F", 0.05)))
    for place, char in ((0, "P"), (3, "F")):
        assert rival(places, place, char).margin > HIDDEN_MARGIN
    assert all(place.felt is not None and place.felt > 0.95 for place in places)


def test_the_wrong_claim_is_refuted_by_the_stroke_that_it_lacks(part: StampedPart) -> None:
    places = strokes(part, relief_of(part), "PJ3F8", lattice("PJ3F8", p0=("R", 0.05), p3=("E", 0.05)))
    assert rival(places, 0, "R").margin < -HIDDEN_MARGIN
    assert rival(places, 3, "E").margin < -HIDDEN_MARGIN


def test_absence_says_less_the_more_is_missing_and_never_all(part: StampedPart) -> None:
    leg = filled(relief_of(part), part, 0, window=(0.3, 0.52, 1.1, 1.1))
    beliefs = lattice("PJ3E8", p0=("R", 0.05))
    clean = rival(strokes(part, leg, "PJ3E8", beliefs), 0, "R")
    worn = leg
    for which in (1, 2, 3, 4):
        worn = filled(worn, part, which, window=(-0.1, 0.5, 1.1, 1.1))
    dirty = rival(strokes(part, worn, "PJ3E8", beliefs), 0, "R")
    assert 0.0 < dirty.margin < 0.7 * clean.margin
    assert clean.margin <= MOST_ABSENT
    assert dirty.hidden == clean.hidden == 0.0


def test_what_is_covered_excludes_nobody_whatever_is_believed(part: StampedPart) -> None:
    heap = filled(relief_of(part), part, 0, window=(0.3, 0.5, 1.1, 1.1), up_mm=2 * DEEP_MM)
    unknown = filled(relief_of(part), part, 0, window=(0.3, 0.5, 1.1, 1.1), up_mm=np.nan)
    for surface in (heap, unknown):
        places = rival(strokes(part, surface, "PJ3E8", lattice("PJ3E8")), 0, "R")
        assert places.belief < LIVE  # declared to be taken for P
        assert places.hidden > 0.5
        assert places.margin < HIDDEN_MARGIN


def test_a_character_filled_to_the_land_was_not_felt(part: StampedPart) -> None:
    surface = filled(relief_of(part), part, 1, window=(-0.2, -0.2, 1.2, 1.2))
    places = strokes(part, surface, "RI3E8", lattice("RI3E8", p1=("J", 0.01)))
    assert places[1].felt < 0.1
    (finding,) = judged(text_of("RI3E8", strokes=places), missing_strokes)
    assert finding.flag is ReadingFlag.STROKES_MISSING
    assert "I at place 2" in finding.text


def test_raised_marks_are_sunk_ones_upside_down(part: StampedPart) -> None:
    relief = relief_of(part)
    beliefs = lattice(TEXT, p0=("P", 0.05))
    sunk = strokes(part, relief, TEXT, beliefs)
    raised = strokes(part, replace(relief, height_mm=-relief.height_mm), TEXT, beliefs, raised=True)
    assert sunk == raised


def test_a_font_that_nobody_named_tells_the_same_rivals_apart(part: StampedPart) -> None:
    others = (load_font("futuram"), load_font("timesr"))
    places = strokes(part, relief_of(part), "PJ3E8", lattice("PJ3E8", p0=("R", 0.05)), fonts=others)
    assert rival(places, 0, "R").margin < 0.0


def test_of_what_no_font_has_nothing_is_said(part: StampedPart) -> None:
    gothic = load_font("gothic")
    font = replace(gothic, glyphs={c: g for c, g in gothic.glyphs.items() if c != "R"})
    places = strokes(part, relief_of(part), TEXT, lattice(TEXT), fonts=(font,))
    assert places[0] == PlaceStrokes(None)
    assert places[1].felt is not None
    assert strokes(part, relief_of(part), TEXT, lattice(TEXT[:-1])) == ()


def stands(**changed: float) -> RivalStrokes:
    """A live rival that strokes do not exclude."""
    return replace(
        RivalStrokes("J", belief=0.01, margin=1.0, apart_heights=0.5, more_heights=0.4, hidden=0.0), **changed
    )


@pytest.mark.parametrize(
    ("one", "why"),
    [
        (stands(hidden=0.8, belief=0.0), "covered"),
        (stands(), "may be filled"),
        (stands(margin=-2.0), "fit both"),
        (stands(belief=0.5 * LIVE), ""),
        (stands(margin=np.log(0.01 / LEFT) + 0.1), ""),
        (stands(margin=np.log(0.01 / LEFT) - 0.1), "may be filled"),
        (stands(apart_heights=0.1, margin=0.0), ""),
        (stands(apart_heights=0.1, belief=0.05), "hardly"),
        (stands(hidden=1.0, more_heights=0.05, belief=0.0), ""),
    ],
)
def test_two_characters_stay_undecided_where_strokes_do_not_tell(one: RivalStrokes, why: str) -> None:
    findings = judged(text_of("I", strokes=(PlaceStrokes(1.0, 0.9, (one,)),)), undecided_strokes)
    assert len(findings) == bool(why)
    for finding in findings:
        assert finding.flag is ReadingFlag.STROKES_UNDECIDED
        assert finding.text.startswith("I or J at place 1: ")
        assert why in finding.text


def test_what_is_accepted_has_no_undecided_strokes() -> None:
    sure = text_of("I", strokes=(PlaceStrokes(1.0, 0.9, (stands(),)),), score=0.99)
    assert judged(sure, undecided_strokes) == ()


@pytest.mark.parametrize("wrong", [0.9, 1.0, 1.52, 1.7])
def test_a_height_that_was_mistaken_is_settled_by_the_strokes(part: StampedPart, wrong: float) -> None:
    right, gothic = felt(part, relief_of(part)), load_font("gothic")
    mistaken = right.at_height(wrong * part.height_mm)
    places = felt_line(right.view, mistaken.line, mistaken.columns, TEXT, (gothic,))
    # heights are tried in steps of 15 %
    assert places.line.height_mm == pytest.approx(part.height_mm, rel=0.16)
    middle = 0.5 * (ROWS - 1)
    at = (one.line.places_mm(one.columns, middle) for one in (places, right))
    np.testing.assert_allclose(*at)
    assert LaidText(places, tuple(TEXT), gothic).height_mm == pytest.approx(part.height_mm, rel=0.04)


def test_a_height_stays_where_strokes_say_nothing(part: StampedPart) -> None:
    relief = relief_of(part)
    line = felt(part, replace(relief, height_mm=np.zeros_like(relief.height_mm)))
    assert felt_line(line.view, line.line, line.columns, TEXT, (load_font("gothic"),)).line is line.line


def test_a_line_of_which_hardly_anything_was_felt_is_no_text() -> None:
    unread = PlaceState(CharacterState.NOT_READ, "K", 0.1)
    bare = tuple(PlaceStrokes(0.1, 0.1) for _ in range(4))
    junk = text_of("K7B2", strokes=bare)
    first, *others = (replace(c, state=unread) for c in junk.characters)
    assert is_dirt(replace(junk, characters=(first, *others)))
    # hardly felt, and yet some of it can be read: fill leaves traces
    partly = replace(first, state=PlaceState(CharacterState.READ, "K", 0.9))
    assert not is_dirt(replace(junk, characters=(partly, *others)))
    # felt, and yet not read: a person may
    felt = text_of((first, *others), strokes=tuple(replace(p, felt=0.8) for p in bare))
    assert not is_dirt(felt)


def test_strokes_of_another_font_are_not_missing() -> None:
    worn = MarkGrade((Parameter("completeness", 0.3, 0),), Action.CLEAN_FIRST)
    graded = tuple(replace(c, grade=worn) for c in text_of("K7").characters)
    there = (PlaceStrokes(0.9, 0.8),) * 2

    def missing(
        characters: tuple[CharacterReading, ...], laid_in: str, *felt: PlaceStrokes
    ) -> tuple[Finding, ...]:
        return judged(text_of(characters, strokes=felt, laid_in=laid_in, font="gothic"), missing_strokes)

    (finding,) = missing(graded, "timesr", *there)
    assert finding.flag is ReadingFlag.FOREIGN_SHAPES
    assert finding.text == (
        "another font than gothic explains the marks better: K at place 1, 7 at place 2 (name the right font)"
    )
    # the one that was named explains them as well as any
    assert missing(graded, "gothic", *there) == ()
    # half filled, it is missing all the same
    assert flags_of(missing(graded, "gothic", *(PlaceStrokes(0.5, 0.5),) * 2)) == ReadingFlag.STROKES_MISSING
    # one alone is a blow, or dots that fell otherwise: it is there
    assert missing((graded[0], replace(graded[1], grade=None)), "timesr", *there) == ()


def test_the_font_of_a_line_suits_it_best(part: StampedPart) -> None:
    line = felt(part, relief_of(part))
    scores = {name: line.mean_correlation(TEXT, load_font(name)) for name in ("timesr", "gothic", "futural")}
    assert max(scores, key=scores.__getitem__) == part.font_name == "gothic"
    assert scores["gothic"] > 0.85


def test_strokes_are_there_by_their_edges_too() -> None:
    """Between dots nothing is deep, and the edges of the font that was named are felt all the same."""
    dotted = text_of("K", strokes=(PlaceStrokes(0.3, 0.3),))
    for share, flags in ((0.65, ReadingFlag.NONE), (0.55, ReadingFlag.STROKES_MISSING)):
        grade = MarkGrade((Parameter("completeness", share, 1),), Action.CLEAN_FIRST)
        graded = replace(dotted, characters=(replace(dotted.characters[0], grade=grade),))
        assert flags_of(judged(graded, missing_strokes)) == flags


def test_beliefs_in_rivals_are_what_a_calibration_says_that_they_are_worth(part: StampedPart) -> None:
    believed = lattice(TEXT, p0=("P", 0.09))

    def belief(slope: float) -> float:
        return rival(strokes(part, relief_of(part), TEXT, believed, slope=slope), 0, "P").belief

    assert belief(1.0) == pytest.approx(0.09)
    assert belief(0.5) > 0.09 > belief(1.5)
    # odds of 10 to 1 are odds of 100 to 1 where the slope is 2; 0.01 is no character at all
    assert belief(2.0) == pytest.approx(0.99 / 101.0)
