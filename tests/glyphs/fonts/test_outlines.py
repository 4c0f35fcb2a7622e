"""Fonts and glyphs, and serials drawn by a mask."""

from __future__ import annotations

import itertools
import string
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as PlotPath
from scipy.spatial import cKDTree

from glyphs.fonts.glyph import Font, FontError, Glyph, signed_distance, with_stroke
from glyphs.fonts.outlines import BUILTIN_FONTS, SERIAL_CHARACTERS, load_font
from glyphs.fonts.serials import SIGNS, FormatError, allowed_characters, random_text

# ---------------------------------------------------------------------------------------------------------- outlines

DEJAVU = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
CFF_LIKE_STIX = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "STIXGeneral.ttf"


@pytest.mark.parametrize("name", BUILTIN_FONTS)
def test_built_in_fonts_have_all_serial_characters_one_cap_height_tall(name):
    font = load_font(name)
    assert set(SERIAL_CHARACTERS) <= set(font.glyphs)
    _, y0, _, y1 = font.glyph("H").ink_box
    assert (y0, y1) == pytest.approx((0.0, 1.0), abs=1e-9)
    for char in SERIAL_CHARACTERS:
        x0, y0, x1, y1 = font.glyph(char).ink_box
        assert -0.01 <= x0 < x1 <= font.glyph(char).advance + 0.01
        # Q and the serifed J reach below the baseline in Hershey's letters.
        assert y0 >= -0.36
        assert y1 == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("name", BUILTIN_FONTS)
def test_characters_of_a_font_are_pairwise_different(name):
    font = load_font(name)

    def centred(char):
        box = font.glyph(char).ink_box
        x = np.arange(-0.75, 0.75, 0.02) + (box[0] + box[2]) / 2
        y = np.arange(-0.4, 1.2, 0.02)
        return signed_distance(font.glyph(char), x[None, :], y[:, None], stroke=font.stroke_ratio) < 0

    ink = {char: centred(char) for char in SERIAL_CHARACTERS}
    overlap = {
        a + b: (ink[a] & ink[b]).sum() / (ink[a] | ink[b]).sum()
        for a, b in itertools.combinations(SERIAL_CHARACTERS, 2)
    }
    # Q is an O with a tail in every gothic; the tail alone must tell them apart.
    assert overlap.pop("OQ") < 0.93
    worst = max(overlap, key=overlap.get)
    assert overlap[worst] < 0.87, f"{worst} overlap by {overlap[worst]:.2f}"


@pytest.mark.parametrize("char", ["8", "R", "W"])
@pytest.mark.parametrize("source", ["gothic", "timesrb", DEJAVU])
def test_signed_distance_agrees_with_a_search_among_points_along_the_outline(source, char):
    font = load_font(source)
    glyph = font.glyph(char)
    apart = 0.0005
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-0.2, 1.6, 0.02), np.arange(-0.3, 1.3, 0.02)))
    ours = signed_distance(glyph, x, y, stroke=font.stroke_ratio)
    lines = glyph.strokes or [np.vstack([c, c[:1]]) for c in glyph.contours]
    theirs = cKDTree(np.concatenate([_points_along(line, apart) for line in lines])).query(
        np.column_stack([x, y])
    )[0]
    if glyph.contours:
        inside = np.zeros(x.size, bool)
        for contour in glyph.contours:  # these do not overlap, so even-odd is the same as non-zero
            inside ^= PlotPath(contour).contains_points(np.column_stack([x, y]))
        theirs = np.where(inside, -theirs, theirs)
    else:
        theirs = theirs - font.stroke_ratio / 2
    # The nearest point of a line is at most half the spacing away from the nearest sample of it.
    assert np.abs(ours - theirs).max() <= apart / 2 + 1e-6
    assert (ours < 0).any()
    assert (ours > 0).any()


def _points_along(line, apart):
    """Points along a polyline, no further apart than that."""
    parts = [
        np.linspace(p, q, int(np.ceil(np.hypot(*(q - p)) / apart)) + 1) for p, q in itertools.pairwise(line)
    ]
    return np.concatenate(parts)


def square(x0, y0, side):
    return np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) * side + (x0, y0)


def test_overlapping_contours_have_no_seam():
    glyph = Glyph("+", contours=(square(0, 0, 1.0), square(0.5, 0.25, 0.5), square(0.9, 0.25, 0.5)))
    # (0.9, 0.5) lies on the left edge of the third square, deep inside the union.
    assert float(signed_distance(glyph, 0.9, 0.5, stroke=0)) == pytest.approx(-np.hypot(0.1, 0.25), abs=1e-6)
    assert float(signed_distance(glyph, 1.5, 0.5, stroke=0)) == pytest.approx(0.1, abs=1e-6)


def test_counter_of_opposite_winding_is_a_hole_and_of_like_winding_is_not():
    ring = Glyph("O", contours=(square(0, 0, 1.0), square(0.25, 0.25, 0.5)[::-1]))
    assert float(signed_distance(ring, 0.5, 0.5, stroke=0)) == pytest.approx(0.25)
    solid = Glyph("O", contours=(square(0, 0, 1.0), square(0.25, 0.25, 0.5)))
    assert float(signed_distance(solid, 0.5, 0.5, stroke=0)) == pytest.approx(-0.5)


def test_with_stroke_keeps_the_ink_height():
    glyph = load_font("gothic").glyph("H")
    for stroke in (0.02, 0.1, 0.3):
        assert with_stroke(glyph, stroke).ink_box[1::2] == pytest.approx((0.0, 1.0))
    with pytest.raises(FontError, match="narrower"):
        with_stroke(glyph, 1.0)


@pytest.mark.parametrize("path", [DEJAVU, CFF_LIKE_STIX, DEJAVU.with_name("cmr10.ttf")])
def test_truetype_fonts_are_scaled_to_the_cap_height(path):
    font = load_font(path)
    assert font.stroke_ratio == 0.0
    assert set(SERIAL_CHARACTERS) <= set(font.glyphs)
    assert font.glyph("H").ink_box[3] == pytest.approx(1.0, abs=1e-6)
    assert load_font(str(path)) is font


def test_curves_are_flattened_finely_enough():
    from fontTools.pens.areaPen import AreaPen
    from fontTools.ttLib import TTFont

    with TTFont(DEJAVU) as file:
        glyph_set = file.getGlyphSet()
        pen = AreaPen(glyph_set)
        glyph_set["O"].draw(pen)
        cap = load_font(DEJAVU).glyph("H")
        assert cap.ink_box[3] == pytest.approx(1.0)
        unit = file["OS/2"].sCapHeight if file["OS/2"].version >= 2 else 1493
        exact = abs(pen.value) / unit**2
    polygons = load_font(DEJAVU).glyph("O").contours
    area = abs(sum(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) for x, y in (p.T for p in polygons)))
    # Two rings, each about 3 cap heights round, may each lie 0.002 off at worst.
    assert area == pytest.approx(exact, abs=2 * 3 * 0.002)


def test_unknown_name_lists_the_built_ins():
    with pytest.raises(FontError, match=r"unknown font 'helvetica'.*gothic"):
        load_font("helvetica")


def test_missing_damaged_and_letterless_files(tmp_path):
    with pytest.raises(FontError, match="missing"):
        load_font(tmp_path / "nothing.ttf")
    data = DEJAVU.read_bytes()
    for name, content in {
        "empty": b"",
        "noise": b"\x00\x01\x00\x00" + b"x" * 999,
        "half": data[: len(data) // 2],
    }.items():
        path = tmp_path / f"{name}.ttf"
        path.write_bytes(content)
        with pytest.raises(FontError, match="cannot be read"):
            load_font(path)
    with pytest.raises(FontError, match="none of the characters A-Z"):
        load_font(_font_with_only_an_exclamation_mark(tmp_path / "bare.ttf"))


@pytest.mark.parametrize("of", ["H", "A"])
def test_a_glyph_made_of_glyphs_made_of_glyphs_has_an_end(tmp_path, of):
    # 13 levels of two each are 8,192 triangles; fontTools writes no more, but a file may say what it likes
    levels = {f"level{k}": 2 * [f"level{k + 1}" if k < 12 else "exclam"] for k in range(13)}
    path = _font_of(tmp_path / "deep.ttf", {of: "level0"}, levels)
    with pytest.raises(FontError, match="made of more than 256 others"):
        load_font(path)


def _font_with_only_an_exclamation_mark(path):
    return _font_of(path, {"!": "exclam"}, {})


def _font_of(path, characters, composites):
    """A font of triangles, and of glyphs that are made of others by name."""
    from fontTools.fontBuilder import FontBuilder
    from fontTools.pens.ttGlyphPen import TTGlyphPen

    pen = TTGlyphPen(None)
    pen.moveTo((0, 0))
    pen.lineTo((100, 700))
    pen.lineTo((200, 0))
    pen.closePath()
    glyphs = {".notdef": TTGlyphPen(None).glyph(), "exclam": pen.glyph()}
    for name, parts in composites.items():
        made = TTGlyphPen(None, handleOverflowingTransforms=False)
        made.glyphSet = dict.fromkeys([*composites, "exclam"])
        for part in parts:
            made.addComponent(part, (1, 0, 0, 1, 0, 0))
        glyphs[name] = made.glyph()
    builder = FontBuilder(1000, isTTF=True)
    builder.setupGlyphOrder(list(glyphs))
    builder.setupCharacterMap({ord(char): name for char, name in characters.items()})
    builder.setupGlyf(glyphs, calcGlyphBounds=False)
    builder.setupHorizontalMetrics(dict.fromkeys(glyphs, (300, 0)))
    builder.setupHorizontalHeader(ascent=800, descent=-200)
    builder.setupNameTable({"familyName": "Bare", "styleName": "Regular"})
    builder.setupOS2(sCapHeight=700)
    builder.setupPost()
    builder.save(path)
    return path


LINE = np.array([[0.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Glyph("AB", strokes=(LINE,)), "one character"),
        (lambda: Glyph("A", strokes=(LINE,), contours=(square(0, 0, 1),)), "one of them"),
        (lambda: Glyph("A", strokes=(np.zeros((2, 3)),)), "shape"),
        (lambda: Glyph("A", contours=(LINE,)), "shape"),
        (lambda: Glyph("A", strokes=(LINE * np.nan,)), "finite"),
        (lambda: Glyph("A", strokes=(LINE,), advance=-1.0), "advance"),
        (lambda: Glyph("A", strokes=(LINE,), stroke=1.0), "stroke"),
        (lambda: Font("f", {}, 0.1, "here"), "no glyphs"),
        (lambda: Font("", {"A": Glyph("A")}, 0.1, "here"), "name"),
        (lambda: Font("f", {"B": Glyph("A")}, 0.1, "here"), "differ from the characters"),
        (lambda: Font("f", {"A": Glyph("A")}, 1.5, "here"), "stroke_ratio"),
        (lambda: load_font("gothic").glyph("é"), "no character 'é'"),
    ],
)
def test_glyphs_and_fonts_refuse(make, message):
    with pytest.raises(FontError, match=message):
        make()


@pytest.mark.parametrize("name", BUILTIN_FONTS)
def test_built_in_fonts_have_small_letters_and_signs_of_their_proper_heights(name):
    font = load_font(name)
    assert set(string.ascii_letters + string.digits + SIGNS + " ") <= set(font.glyphs)
    for char in "osvwxz":  # which differ from their capitals in height alone
        tops = [max(float(s[:, 1].max()) for s in font.glyph(c).strokes) for c in (char, char.upper())]
        assert 0.5 < tops[0] / tops[1] < 0.8


def test_a_changed_font_file_is_read_again(tmp_path):
    path = tmp_path / "font.ttf"
    path.write_bytes(DEJAVU.read_bytes())
    first = load_font(path)
    path.write_bytes(CFF_LIKE_STIX.read_bytes())
    assert load_font(path).name != first.name


# ----------------------------------------------------------------------------------------------------------- serials

formats = st.text("A9*BZ-./0", min_size=1, max_size=12)


def test_mask_letters():
    letters, figures = string.ascii_uppercase, string.digits
    assert allowed_characters("A9*-") == (letters, figures, letters + figures, "-")
    assert allowed_characters(r"a-\a\A\\") == (string.ascii_lowercase, "-", "a", "A", "\\")
    assert allowed_characters("B0") == ("B", "0")
    assert "O" not in allowed_characters("A", exclude="IOQ")[0]
    assert allowed_characters("O", exclude="IOQ") == ("O",)


@given(format=formats, seed=st.integers(0, 2**32 - 1))
def test_random_text_obeys_its_mask_and_its_seed(format, seed):
    text = random_text(format, rng=np.random.default_rng(seed), exclude="IOQ")
    assert len(text) == len(format)
    assert all(
        c in allowed for c, allowed in zip(text, allowed_characters(format, exclude="IOQ"), strict=True)
    )
    assert text == random_text(format, rng=np.random.default_rng(seed), exclude="IOQ")


@pytest.mark.parametrize(
    ("format", "exclude", "message"),
    [("", "", "empty"), ("A\n", "", "printed"), ("A9", string.digits, "position 2"), ("A\\", "", "follows")],
)
def test_masks_refused(format, exclude, message):
    with pytest.raises(FormatError, match=message):
        allowed_characters(format, exclude=exclude)
