"""Parts, strips, views and faces to learn from: the same from the same seed, written as read."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.fonts.glyph import Font, FontError, signed_distance
from glyphs.fonts.outlines import SERIAL_CHARACTERS, load_font
from recognition.learning.parametric_face import FaceStyle, draw_face, draw_style
from recognition.learning.training_fonts import family, kept_out
from recognition.learning.training_parts import SOILS_LEARNED, TrainingPart, draw_part, draw_text
from recognition.learning.training_samples import (
    TALL_ROWS,
    VIEW_ROWS,
    WIDE_MARGIN,
    TrainingStrip,
    TrainingView,
    lines_of,
    read_samples,
    strips_of,
    training_views,
    write_samples,
)
from recognition.recogniser.recogniser import CHARACTERS
from recognition.see.view import KNOWN, LAYERS

# ----------------------------------------------------------------------------------------------------- training data

FONTS = ("gothic", "futuram")
SEED = 11


def drawn(seed: int) -> TrainingPart:
    return draw_part([Path(name) for name in FONTS], np.random.default_rng(seed))


@pytest.fixture(scope="module")
def made() -> TrainingPart:
    return drawn(SEED)


def test_a_part_is_drawn_again_from_its_seed(made: TrainingPart) -> None:
    again = drawn(SEED)
    assert (again.part.text, again.part.height_mm) == (made.part.text, made.part.height_mm)
    np.testing.assert_array_equal(again.part.height_map.z_mm, made.part.height_map.z_mm)
    for one, other in zip(again.scan.sweeps, made.scan.sweeps, strict=True):
        np.testing.assert_array_equal(one.moment_n_mm, other.moment_n_mm)


def test_soils_are_those_learned_from(made: TrainingPart) -> None:
    assert {"mud", "weld"}.isdisjoint(SOILS_LEARNED)
    assert set(made.part.soiling.soils) <= set(SOILS_LEARNED)


@pytest.mark.parametrize("font", FONTS)
def test_texts_are_of_what_the_font_has(font: str) -> None:
    loaded, rng = load_font(font), np.random.default_rng(0)
    texts = [draw_text(loaded, rng) for _ in range(200)]
    assert {c for text in texts for c in text} <= set(CHARACTERS) & ({*loaded.glyphs, " "})
    assert all(1 <= len(text.replace(" ", "")) <= 15 for text in texts)
    assert all(text == " ".join(text.split()) for text in texts)
    assert len(set(texts)) > 190


def test_strips_are_tall_cut_about_their_line_and_kept(made: TrainingPart, tmp_path: Path) -> None:
    strips = strips_of(made)
    texts = [text for _, text, _ in lines_of(made)]
    for strip in strips:
        assert strip.text in texts
        assert strip.layers.shape[:2] == (LAYERS, TALL_ROWS)
        known = strip.layers[KNOWN].astype(np.float32)
        np.testing.assert_allclose(known, known.round(), atol=2e-3)  # rounded to sixteen bits
    line, text, places = lines_of(made)[0]
    assert strips[0].layers.shape[2] == line.columns(margin=WIDE_MARGIN)
    # a character's place is on the strip, in the order of reading
    assert len(places) == len(text)
    assert all(0.0 < first <= last < strips[0].layers.shape[2] for first, last in places)
    assert sorted(places) == list(places)
    write_samples(tmp_path / "a.npz", strips)
    write_samples(tmp_path / "b.npz", strips[:1])
    back = read_samples(TrainingStrip, [tmp_path / "a.npz", tmp_path / "b.npz"])
    assert len(back) == len(strips) + 1
    for one, other in zip(back, [*strips, strips[0]], strict=True):
        np.testing.assert_array_equal(one.layers, other.layers)
        for name in ("text", "source", "severity", "places"):
            assert getattr(one, name) == getattr(other, name)


def test_lines_lie_on_the_boxes_of_their_characters(made: TrainingPart) -> None:
    line, text, _ = lines_of(made)[0]
    boxes = np.array([b for b, c in zip(made.part.stamped.boxes_mm, text, strict=True) if c != " "])
    middles = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    dense = np.concatenate(
        [
            a + np.linspace(0, 1, 50)[:, None] * (b - a)
            for a, b in zip(line.centre_mm, line.centre_mm[1:], strict=False)
        ]
    )
    away = np.linalg.norm(middles[:, None] - dense[None], axis=2).min(axis=1)
    # small letters and signs have their middles lower, by up to a third of the height
    assert away.max() < 0.4 * line.height_mm
    assert line.height_mm == made.part.height_mm


def test_views_are_at_one_scale_with_their_lines_and_kept(made: TrainingPart, tmp_path: Path) -> None:
    views = training_views(made)
    line = lines_of(made)[0][0]
    for view in views:
        assert view.layers.shape[0] == LAYERS
        assert len(view.lines) == len(lines_of(made))
        long = np.linalg.norm(np.diff(view.lines[0], axis=0), axis=1).sum()
        # in pixels, VIEW_ROWS to a height; single precision
        assert long == pytest.approx(line.length_mm / made.part.height_mm * VIEW_ROWS, rel=1e-3)
    write_samples(tmp_path / "v.npz", views)
    for one, other in zip(read_samples(TrainingView, [tmp_path / "v.npz"]), views, strict=True):
        np.testing.assert_array_equal(one.layers, other.layers)
        assert one.lines == other.lines


@pytest.mark.parametrize(
    ("name", "out"),
    [
        ("Manrope-Bold.ttf", True),
        ("SourceSerif4-It.otf", True),
        ("lmroman10.otf", True),
        ("Lato-Black.ttf", False),
        ("share-tech-mono-latin-400-normal.woff", True),
        ("RussoOne-Regular.ttf", True),
        ("saira-condensed-latin-400-normal.woff", True),
        ("overpass-mono-latin-400-normal.woff", False),
        ("saira-stencil-one-latin-400-normal.woff", True),
    ],
)
def test_families_of_the_exams_and_of_the_fit_of_the_score_are_not_learned_from(name: str, out: bool) -> None:
    assert kept_out(Path(name)) is out


def test_a_family_is_its_name_without_style() -> None:
    assert family(Path("Lato-Black.ttf")) == family(Path("Lato_Light.otf")) == "lato"
    assert (
        family(Path("b612-mono-latin-700-normal.woff")) == family(Path("B612Mono-Regular.ttf")) == "b612mono"
    )


# --------------------------------------------------------------------------------------------------- parametric face

GRID = 24
"""Samples per cap height of the ink that is compared."""


def ink(font: Font, char: str) -> np.ndarray:
    """Ink of a character on a grid over its own box."""
    glyph = font.glyph(char)
    x0, _, x1, _ = glyph.ink_box
    x = np.linspace(x0, x1, GRID)
    return signed_distance(glyph, x[None, :], np.linspace(0, 1, GRID)[:, None], stroke=0.1) < 0


@settings(deadline=None, max_examples=15)
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
