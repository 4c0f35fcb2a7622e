"""Parametric faces: every character of any style can be stamped and told from the others."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.fonts.glyph import Font, FontError, signed_distance
from glyphs.fonts.outlines import SERIAL_CHARACTERS
from recognition.learning.parametric_face import FaceStyle, draw_face, draw_style

GRID = 24
"""Samples per cap height of the ink that is compared."""


def ink(font: Font, char: str) -> np.ndarray:
    """Ink of a character on a grid over its own box."""
    glyph = font.glyph(char)
    x0, _, x1, _ = glyph.ink_box
    x = np.linspace(x0, x1, GRID)
    return signed_distance(glyph, x[None, :], np.linspace(0, 1, GRID)[:, None], stroke=0.1) < 0


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_any_style_draws_all_serial_characters_about_one_cap_height_tall(seed: int) -> None:
    font = draw_face(draw_style(np.random.default_rng(seed)))
    for char in SERIAL_CHARACTERS:
        _, low, _, high = font.glyph(char).ink_box
        # segments and bent tips end a little inside, the tail of a Q below the line
        assert 0.8 < high < 1.03
        assert -0.03 < low < 0.2 or char == "Q"
        assert font.glyph(char).advance > 0.0


@pytest.mark.parametrize("seed", range(8))
def test_characters_of_a_face_differ(seed: int) -> None:
    font = draw_face(draw_style(np.random.default_rng(seed)))
    inks = {char: ink(font, char) for char in SERIAL_CHARACTERS}
    alike = [
        pair for pair in combinations(SERIAL_CHARACTERS, 2) if np.array_equal(inks[pair[0]], inks[pair[1]])
    ]
    # many dies have one shape for O and 0, and square ones one for S and 5 or Z and 2
    assert set(alike) <= {("O", "0"), ("S", "5"), ("Z", "2")}


def test_a_style_draws_the_same_face_again() -> None:
    style = draw_style(np.random.default_rng(7))
    first, second = draw_face(style), draw_face(style)
    for char in SERIAL_CHARACTERS:
        for one, other in zip(first.glyph(char).contours, second.glyph(char).contours, strict=True):
            np.testing.assert_array_equal(one, other)


def test_corners_go_from_square_over_round_to_a_chamfer() -> None:
    def share_of_box(**style: float) -> float:
        return float(ink(draw_face(replace(FaceStyle(stroke=0.1), **style)), "O")[0, 0:4].mean())

    square, octagon = share_of_box(corner=0.0), share_of_box(corner=1.0, power=1.0)
    assert square > 0.7
    assert octagon < 0.1


def test_a_stencil_encloses_nothing() -> None:
    face = FaceStyle(stencil=0.1)
    assert len(draw_face(replace(face, stencil=0.0)).glyph("O").contours) == 2
    # two halves, neither with a hole
    halves = draw_face(face).glyph("O").contours
    assert len(halves) == 2
    assert max(half[:, 0].max() for half in halves) > min(half[:, 0].max() for half in halves) + 0.2


def test_letters_without_room_are_refused() -> None:
    with pytest.raises(FontError, match="no room"):
        draw_face(FaceStyle(width=0.4, stroke=0.3))
