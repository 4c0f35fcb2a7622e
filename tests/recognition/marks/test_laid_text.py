"""A text laid along centre lines in a font's templates: where it was stamped, by the die that struck it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, FontError, Glyph, signed_distance
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.stamping.die import die_glyph
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import Face, default_die
from glyphs.stamping.layouts import Layout
from glyphs.stamping.stamp import StampedPart
from recognition.glyph_match.felt_line import felt_line
from recognition.marks.centre_lines import CentreLine, centre_line
from recognition.marks.laid_text import STRUCK_FIT, LaidText, laid_text
from recognition.see.curves import arc_through
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import felt_view, relief_of
from tests.support.felt import felt, stamped_line
from whisker_array.estimation.edges import edge_map
from whisker_array.whisker.touch import Touch

# ------------------------------------------------------------------------------------------------------ centre lines

DEJAVU = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"


def distance(font: Font, char: str, line: CentreLine, *, shift: float = 0.0) -> np.ndarray:
    """Signed distance of the points, moved along their normals, from the ink they should be the middle of."""
    shape = die_glyph(font.glyph(char), default_die(5.0, font=font), height_mm=5.0)
    x0, _, x1, _ = shape.ink_box
    points = line.points + shift * line.normals
    return signed_distance(shape, points[:, 0] + 0.5 * (x0 + x1), 0.5 - points[:, 1], stroke=shape.stroke)


@pytest.mark.parametrize("name", BUILTIN_FONTS)
def test_points_of_strokes_are_as_deep_in_the_ink_as_any(name: str) -> None:
    font = load_font(name)
    for char in "AB7180S":
        line = centre_line(font, char)
        assert len(line.points) > 10
        np.testing.assert_allclose(distance(font, char, line), -line.half_width, atol=1e-6)
        np.testing.assert_allclose(np.hypot(*line.normals.T), 1.0)


def test_normals_lead_out_of_the_ink() -> None:
    font = load_font("gothic")
    line = centre_line(font, "I")
    for way in (1.0, -1.0):
        np.testing.assert_allclose(distance(font, "I", line, shift=way * line.half_width), 0.0, atol=1e-6)


def test_the_ends_of_a_stroke_are_left_out() -> None:
    font = load_font("gothic")
    line = centre_line(font, "1")
    low, high = line.points[:, 1].min(), line.points[:, 1].max()
    # ink from -1/2 to 1/2, half a stroke of round end and half a stroke of centre line less
    assert high == pytest.approx(0.5 - 2.0 * line.half_width, abs=1e-6)
    assert low >= -0.5 + line.half_width - 1e-6


def test_an_outline_has_its_ridge_for_a_centre_line() -> None:
    bar = Glyph("I", contours=(np.array([[0.1, 0.0], [0.3, 0.0], [0.3, 1.0], [0.1, 1.0]]),), advance=0.4)
    line = centre_line(Font("bar", {"I": bar}, 0.0, "test"), "I")
    np.testing.assert_allclose(line.points[:, 0], 0.0, atol=0.011)
    assert np.ptp(line.points[:, 1]) == pytest.approx(0.8, abs=0.1)
    np.testing.assert_allclose(np.abs(line.normals[:, 0]), 1.0, atol=1e-6)
    assert line.half_width == pytest.approx(0.1, abs=0.011)


def test_an_outlined_font_is_followed_along_its_limbs() -> None:
    font = load_font(DEJAVU)
    for char in "HE7O":
        line = centre_line(font, char)
        inside = -distance(font, char, line)
        assert len(line.points) > 30
        assert inside.min() > 0.65 * line.half_width
        out = np.maximum(
            *(distance(font, char, line, shift=way * 1.5 * line.half_width) for way in (1.0, -1.0))
        )
        # across the limb one leaves the ink; not where limbs meet
        assert np.mean(out > 0.0) > 0.7


def test_dots_have_a_point_each() -> None:
    font = load_font("gothic")
    dotted, plain = centre_line(font, "8", face=Face.DOTTED), centre_line(font, "8")
    assert 5 < len(dotted.points) < 0.5 * len(plain.points)
    with pytest.raises(StampError, match="dots"):
        centre_line(load_font(DEJAVU), "8", face=Face.DOTTED)


def test_no_ink_no_line() -> None:
    blank = Font("blank", {" ": Glyph(" ", advance=0.5)}, 0.1, "test")
    assert len(centre_line(blank, " ").points) == 0
    with pytest.raises(FontError, match="no character 'Q'"):
        centre_line(blank, "Q")


# --------------------------------------------------------------------------------------------------------- laid text

CHARS = "NHOIX"
"""Turned or not, their ink has its middle in that of their boxes."""
TOLERANCE_HEIGHTS = 0.03
Make = Callable[..., StampedPart]
Lay = Callable[..., LaidText | None]


def middles_of(part: StampedPart) -> NDArray[np.float64]:
    """(characters, 2) middles of their boxes."""
    boxes = np.array(part.boxes_mm)
    return 0.5 * (boxes[:, :2] + boxes[:, 2:])


@pytest.fixture(scope="module")
def lay(gothic: Font, touch: Touch) -> Lay:
    """Texts laid on parts, from where they were stamped unless another line is given."""

    def laid(
        part: StampedPart,
        *,
        line: tuple[TextLine, NDArray[np.float64]] | None = None,
        text: str = "",
        off_heights: tuple[float, ...] = (),
        fonts: tuple[Font, ...] = (gothic,),
        stand_ins: tuple[Font, ...] = (),
    ) -> LaidText | None:
        along, columns = line or stamped_line(part)
        columns = columns + HEIGHT_ROWS * np.array(off_heights or [0.0] * len(columns))
        scan = felt(part.height_map, touch=touch)
        edges = edge_map(scan)
        view, text = felt_view(edges, relief_of(scan, edges), touch), text or part.text
        one = felt_line(view, along, columns, text, (*fonts, *stand_ins))
        return laid_text(one, text, fonts, stand_ins=stand_ins)

    return laid


def middles_laid(laid: LaidText) -> NDArray[np.float64]:
    """(characters, 2) where their reference points lie."""
    return np.concatenate([laid.points_mm(k, np.zeros((1, 2))) for k in range(len(laid.text))])


@pytest.mark.parametrize("calm", [True, False])
@pytest.mark.parametrize("turned_deg", [0.0, 4.0])
def test_a_text_is_laid_where_it_was_stamped(
    calm: bool, turned_deg: float, make_part: Make, lay: Lay
) -> None:
    part = make_part(CHARS, calm=calm, line_rotation_deg=turned_deg)
    # it was read a little beside its place
    laid = lay(part, off_heights=(0.1, -0.1, 0.05, 0.0, -0.08))
    off = (middles_laid(laid) - middles_of(part)) / part.height_mm
    assert np.abs(off).max() < TOLERANCE_HEIGHTS
    assert laid.fit > 0.9
    assert laid.rotation_deg == pytest.approx(turned_deg, abs=1.0)


@pytest.mark.parametrize("share", [0.9, 1.16])
def test_a_line_found_too_high_or_too_low_is_sized(share: float, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True)
    line, columns = stamped_line(part)
    moved = TextLine(line.centre_mm, share * part.height_mm)
    along = ((columns + 0.5) / HEIGHT_ROWS - MARGIN) / share
    laid = lay(part, line=(moved, (along + MARGIN) * HEIGHT_ROWS - 0.5))
    assert laid.height_mm == pytest.approx(part.height_mm, rel=0.04)
    np.testing.assert_allclose(middles_laid(laid), middles_of(part), atol=TOLERANCE_HEIGHTS * part.height_mm)


@pytest.mark.parametrize("raised", [True, False])
def test_whether_marks_stand_out_is_found(raised: bool, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True, raised=raised)
    laid = lay(part)
    assert laid.felt.raised is raised
    assert laid.fit > 0.9


@pytest.mark.parametrize("face", [Face.FLAT, Face.SHARP, Face.DOTTED])
def test_the_kind_of_die_is_found(face: Face, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True, face=face)
    laid = lay(part)
    assert laid.face is face
    assert laid.fit > STRUCK_FIT
    np.testing.assert_allclose(middles_laid(laid), middles_of(part), atol=TOLERANCE_HEIGHTS * part.height_mm)


def test_the_font_that_suits_is_taken(gothic: Font, make_part: Make, lay: Lay) -> None:
    other = load_font("timesr")
    for options in (
        {"fonts": (gothic, other)},
        {"fonts": (other, gothic)},
        {"fonts": (other,), "stand_ins": (gothic,)},
    ):
        laid = lay(make_part(CHARS, calm=True), **options)
        assert laid.font is gothic
    # of one that is nearly the same the one that was named is taken
    alike = replace(gothic, name="alike")
    laid = lay(make_part(CHARS, calm=True), fonts=(alike,), stand_ins=(gothic,))
    assert laid.font is alike


@pytest.mark.parametrize("radius_mm", [25.0, -25.0])
def test_characters_on_an_arc_are_turned_with_it(radius_mm: float, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True, layout=Layout(radius_mm=radius_mm))
    middles, half = middles_of(part), 0.5 * part.height_mm
    curve = arc_through(middles, height=part.height_mm, before=half, after=half)
    apart = np.linalg.norm(curve[:, None] - middles, axis=2).argmin(axis=0)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))][apart]
    columns = (along / part.height_mm + MARGIN) * HEIGHT_ROWS - 0.5
    laid = lay(part, line=(TextLine(curve, part.height_mm), columns))
    np.testing.assert_allclose(middles_laid(laid), middles, atol=TOLERANCE_HEIGHTS * part.height_mm)
    # about the middle of the circle; its text is half a height further out or in than its baseline
    from_middle = middles[:, 0] - middles[:, 0].mean()
    far = radius_mm + half
    turns = np.degrees(np.arcsin(from_middle / far))
    ahead = np.concatenate(
        [laid.points_mm(k, np.array([[0.2, 0.0]])) for k in range(len(CHARS))]
    ) - middles_laid(laid)
    moved = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
    np.testing.assert_allclose(moved - moved.mean(), turns - turns.mean(), atol=2.0)
    assert np.ptp(turns) > 20.0


def test_of_what_the_font_has_not_got_nothing_is_laid(gothic: Font, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True)
    whole = lay(part)
    lacking = replace(gothic, name="lacking", glyphs={c: gothic.glyph(c) for c in "NHIX"})
    laid = lay(part, fonts=(lacking,))
    assert [one is None for one in laid.laid] == [False, False, True, False, False]
    fits = [(one.fit, other.fit) for one, other in zip(laid.laid, whole.laid, strict=True) if one and other]
    np.testing.assert_allclose(*zip(*fits, strict=True))
    assert laid.fit == pytest.approx(sum(one for one, _ in fits) / len(CHARS))
    assert lay(part, fonts=(replace(lacking, glyphs={"K": gothic.glyph("K")}),)) is None
    assert laid_text(whole.felt, "NH", (gothic,)) is None
