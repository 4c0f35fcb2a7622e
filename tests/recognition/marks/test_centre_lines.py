"""Centre lines of strokes, dots and outlines."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest

from glyphs.fonts.glyph import Font, FontError, Glyph, signed_distance
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.stamping.die import die_glyph
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import Face, default_die
from recognition.marks.centre_lines import CentreLine, centre_line

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
