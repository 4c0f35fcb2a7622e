"""A text laid in a font's templates: where it was stamped, by the die that struck it."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import Face
from glyphs.stamping.layouts import Layout
from glyphs.stamping.stamp import StampedPart
from recognition.glyph_match.template_cache import TemplateCache
from recognition.marks.laid_text import OWN_FIT, STRUCK_FIT, LaidText, laid_text, suited_fonts
from recognition.views.curves import arc_through
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import felt_view
from tests.support.felt import felt
from whisker_array.estimation.edges import edge_map
from whisker_array.whisker.touch import Touch

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
def lay(gothic: Font, touch: Touch, stamped_line: Callable) -> Lay:
    """Texts laid on parts, from where they were stamped unless another line is given."""
    cache = TemplateCache()

    def laid(
        part: StampedPart,
        *,
        line: tuple[TextLine, NDArray[np.float64]] | None = None,
        text: str = "",
        off_heights: tuple[float, ...] = (),
        raised: bool | None = False,
        chars: str = CHARS,
        fonts: tuple[Font, ...] = (gothic,),
    ) -> LaidText | None:
        along, columns = line or stamped_line(part)
        columns = columns + HEIGHT_ROWS * np.array(off_heights or [0.0] * len(columns))
        view = felt_view(edge_map(felt(part.height_map, touch=touch)), None, touch)
        return laid_text(
            view, touch, along, columns, text or part.text, fonts, cache=cache, chars=chars, raised=raised
        )

    return laid


@pytest.mark.parametrize("calm", [True, False])
@pytest.mark.parametrize("turned_deg", [0.0, 4.0])
def test_a_text_is_laid_where_it_was_stamped(
    calm: bool, turned_deg: float, make_part: Make, lay: Lay
) -> None:
    part = make_part(CHARS, calm=calm, line_rotation_deg=turned_deg)
    # it was read a little beside its place
    laid = lay(part, off_heights=(0.1, -0.1, 0.05, 0.0, -0.08))
    assert laid is not None
    off = (laid.places_mm() - middles_of(part)) / part.height_mm
    assert np.abs(off).max() < TOLERANCE_HEIGHTS
    assert laid.fit > OWN_FIT
    assert laid.rotation_deg == pytest.approx(turned_deg, abs=1.0)
    # no other character of the font suits a place as well
    best = [laid.glyphs.chars[int(each.argmax())] for each in laid.correlations()]
    assert "".join(best) == part.text


@pytest.mark.parametrize("share", [0.9, 1.16])
def test_a_line_found_too_high_or_too_low_is_sized(
    share: float, make_part: Make, lay: Lay, stamped_line: Callable
) -> None:
    part = make_part(CHARS, calm=True)
    line, columns = stamped_line(part)
    found = TextLine(line.centre_mm, share * part.height_mm)
    along = ((columns + 0.5) / HEIGHT_ROWS - MARGIN) / share
    laid = lay(part, line=(found, (along + MARGIN) * HEIGHT_ROWS - 0.5))
    assert laid is not None
    assert laid.line.height_mm == pytest.approx(part.height_mm, rel=0.03)
    np.testing.assert_allclose(laid.places_mm(), middles_of(part), atol=TOLERANCE_HEIGHTS * part.height_mm)


@pytest.mark.parametrize("raised", [True, False])
def test_whether_marks_stand_out_is_found(raised: bool, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True, raised=raised)
    laid, other = lay(part, raised=None), lay(part, raised=not raised)
    assert laid is not None
    assert laid.raised is raised
    assert other is not None
    assert laid.fit > other.fit + 0.1


@pytest.mark.parametrize("face", [Face.FLAT, Face.DOTTED])
def test_the_kind_of_die_is_found(face: Face, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True, face=face)
    laid = lay(part)
    assert laid is not None
    assert laid.face is face
    assert laid.fit > STRUCK_FIT
    np.testing.assert_allclose(laid.places_mm(), middles_of(part), atol=TOLERANCE_HEIGHTS * part.height_mm)


def test_the_font_that_suits_is_taken(gothic: Font, make_part: Make, lay: Lay) -> None:
    other = load_font("timesr")
    for fonts in ((gothic, other), (other, gothic)):
        laid = lay(make_part(CHARS, calm=True), fonts=fonts)
        assert laid is not None
        assert laid.font is gothic


@pytest.mark.parametrize("radius_mm", [25.0, -25.0])
def test_characters_on_an_arc_are_turned_with_it(radius_mm: float, make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True, layout=Layout(radius_mm=radius_mm))
    middles, half = middles_of(part), 0.5 * part.height_mm
    curve = arc_through(middles, height=part.height_mm, before=half, after=half)
    assert curve is not None
    apart = np.linalg.norm(curve[:, None] - middles, axis=2).argmin(axis=0)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))][apart]
    columns = (along / part.height_mm + MARGIN) * HEIGHT_ROWS - 0.5
    laid = lay(part, line=(TextLine(curve, part.height_mm), columns))
    assert laid is not None
    np.testing.assert_allclose(laid.places_mm(), middles, atol=TOLERANCE_HEIGHTS * part.height_mm)
    # about the middle of the circle; its text is half a height further out or in than its baseline
    from_middle = middles[:, 0] - middles[:, 0].mean()
    far = radius_mm + half
    turns = np.degrees(np.arcsin(from_middle / far))
    np.testing.assert_allclose(laid.turns_deg() - laid.turns_deg().mean(), turns - turns.mean(), atol=2.0)
    assert np.ptp(turns) > 20.0


def test_of_what_the_font_has_not_got_nothing_is_laid(make_part: Make, lay: Lay) -> None:
    part = make_part(CHARS, calm=True)
    laid, whole = lay(part, chars="NHIX"), lay(part)
    assert laid is not None
    assert whole is not None
    assert laid.glyphs.chars == tuple("NHIX")
    assert laid.fits[2] == 0.0
    np.testing.assert_allclose(np.delete(laid.fits, 2), np.delete(whole.fits, 2))
    # it stays where it was read
    np.testing.assert_allclose(laid.places_mm()[2], middles_of(part)[2], atol=0.05 * part.height_mm)
    assert lay(part, chars="K7B") is None


def test_of_the_fonts_that_stand_in_the_one_is_laid_whose_strokes_suit_most_places(gothic: Font) -> None:
    fonts = (gothic, load_font("futural"))
    votes = [SimpleNamespace(font=name) for name in ("futural", "gothic", "futural", "")]
    assert suited_fonts(fonts, votes) == fonts[1:]  # type: ignore[arg-type]
    assert suited_fonts(fonts, votes[3:]) == fonts  # type: ignore[arg-type]
