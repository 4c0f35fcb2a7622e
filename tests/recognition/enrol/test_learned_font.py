"""Exemplars cut out of parts, and fonts that are learned from them."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from recognition.enrol.exemplars import ExemplarError, cut_height_map
from recognition.enrol.learned_font import align_relief, learn_font, likeness
from recognition.glyph_match.predicted import predict_templates, template_key
from tests.support.felt import blow, drawn

# --------------------------------------------------------------------------------------------------------- exemplars


def cut(part, text):
    return cut_height_map(part.height_map, text, height_mm=part.height_mm)


def ink_box(relief):
    """(u0, v0, u1, v1) of what is sunk by half of the depth, pixels from the middle."""
    ink = np.nan_to_num(relief) < 0.5 * np.nanmin(relief)
    rows, cols = np.flatnonzero(ink.sum(axis=1) > 1), np.flatnonzero(ink.sum(axis=0) > 1)
    middle = np.array(relief.shape) // 2
    return cols[0] - middle[1], rows[0] - middle[0], cols[-1] - middle[1], rows[-1] - middle[0]


@pytest.fixture(scope="module")
def cuts(calm_part):
    return cut(calm_part, "K7 1B")  # blanks do not count


def test_every_character_comes_out_in_the_middle_and_at_one_size(cuts, calm_part):
    assert [c.char for c in cuts] == list("K71B")
    for c in cuts:
        # a pixel is a fortieth of the height: 0.1 mm at 5 mm less what half the depth takes off a wall
        assert c.height_mm == pytest.approx(calm_part.height_mm, rel=0.03)
        x0, y0, x1, y1 = ink_box(c.relief)
        assert abs(x0 + x1) <= 2
        assert abs(y0 + y1) <= 2
        # at half the depth of 0.2 mm, walls of 45 degrees; a box of n pixels is n - 1 from first to last
        assert y1 - y0 == pytest.approx(40 - 40 * 0.2 / 5.0 - 1, abs=2)


def test_what_is_cut_out_is_what_was_stamped(cuts, calm_part):
    """Depth from the part's own table, width from its boxes."""
    for c, (x0, _, x1, _) in zip(cuts, calm_part.boxes_mm, strict=True):
        depth = -np.nanpercentile(c.relief, 3.0) * c.height_mm
        assert depth == pytest.approx(0.2, abs=0.03)
        left, _, right, _ = ink_box(c.relief)
        assert (right - left + 1) / 40 * c.height_mm == pytest.approx(x1 - x0 - 0.2, abs=0.15)


def test_a_neighbour_is_left_out(cuts):
    """Beyond the gap nothing is known, so a K holds no piece of the 7."""
    k = cuts[0].relief
    assert np.isnan(k[:, -1]).all()


@pytest.mark.parametrize("options", [{"line_rotation_deg": 5.0}, {"raised": True}])
def test_turned_and_raised_lines_give_the_same_shapes(cuts, make_part, options):
    other = cut(make_part("K71B", calm=True, **options), "K71B")
    assert [c.raised for c in other] == [bool(options.get("raised"))] * 4
    for one, two in zip(cuts, other, strict=True):
        score, _ = align_relief(np.nan_to_num(two.relief), np.nan_to_num(one.relief))
        # a raised mark's outer corners are felt round by the ball, and a turned line's cells are cut aslant
        assert score > 0.93


def test_nothing_is_enrolled_of_no_text(calm_part):
    with pytest.raises(ExemplarError, match="text is empty"):
        cut(calm_part, "  ")
    with pytest.raises(ExemplarError, match="does not fit the marks"):
        cut(calm_part, "K7ßB")


def test_another_text_does_not_fit_the_marks(calm_part):
    with pytest.raises(ExemplarError, match=r"does not fit|no line of marks"):
        cut(calm_part, "MWMWMWMWMWMWMW")


def test_laying_over_finds_shift_and_turn():
    from scipy import ndimage

    rng = np.random.default_rng(0)
    blob = ndimage.gaussian_filter(rng.normal(size=(53, 65)), 3.0).astype(np.float32)
    moved = ndimage.shift(ndimage.rotate(blob, 3.0, reshape=False, order=1), (2, -3), order=1)
    assert likeness(moved, blob) < 0.7
    score, back = align_relief(moved, blob)
    assert score > 0.97
    # what came in over the rim is land
    assert likeness(back[8:-8, 8:-8], blob[8:-8, 8:-8]) > 0.97


# ------------------------------------------------------------------------------------------------------ learned font

GOTHIC = load_font("gothic")


def learned(text, *, known=(GOTHIC,), more=()):
    chars, reliefs = list(text), [blow(c, k, GOTHIC) for k, c in enumerate(text)]
    for char, relief in more:
        chars.append(char)
        reliefs.append(relief)
    return learn_font("press", chars, reliefs, known=known)


def test_a_font_is_recovered_from_its_own_blows(gothic, touch):
    """Templates of what was learned are those of the font that was stamped."""
    learned_font = learned("K7B2" * 4)
    assert learned_font.set_aside == ()
    key = template_key(gothic, touch, height_mm=5.0)
    truth = predict_templates(gothic, "K7B2", key)
    felt = predict_templates(learned_font.font, "K7B2", template_key(learned_font.font, touch, height_mm=5.0))
    assert felt.half_width == pytest.approx(truth.half_width, abs=0.03)
    rows, cols = (
        min(a, b) // 2 for a, b in zip(truth.patches.shape[2:], felt.patches.shape[2:], strict=True)
    )
    for one, two in zip(truth.patches, felt.patches, strict=True):
        middles = [np.array(p.shape[1:]) // 2 for p in (one, two)]
        same = [
            p[:, m[0] - rows : m[0] + rows + 1, m[1] - cols : m[1] + cols + 1]
            for p, m in zip((one, two), middles, strict=True)
        ]
        # the grid of a fortieth of the height blunts edges a little
        assert likeness(*same) > 0.9


def test_characters_never_felt_come_from_the_nearest_font():
    learned_font = learned("K7B2", known=(load_font("timesr"), GOTHIC))
    assert learned_font.hand.font is GOTHIC
    assert learned_font.hand.is_own
    assert "Q" in learned_font.never_felt
    assert "K" not in learned_font.never_felt
    assert likeness(learned_font.font.glyphs["Q"].relief, drawn("Q", GOTHIC)) > 0.9
    # blows of the font itself: its other characters are no guesses
    assert not any(g.guessed for g in learned_font.font.glyphs.values())


def test_after_a_font_that_is_only_like_it_they_are_guesses():
    learned_font = learned("K7B2", known=(load_font("timesr"),))
    assert not learned_font.hand.is_own
    assert [c for c in "K7B2Q" if learned_font.font.glyphs[c].guessed] == ["Q"]


@pytest.mark.parametrize("place", [0, 2, 4])
def test_one_wrong_exemplar_among_siblings_is_set_aside(place):
    """Whichever came first: a 3 enrolled as an 8 by a slip of the reviewer changes nothing."""
    chars = ["8"] * 5 + ["3"] * 3
    reliefs = [blow(c, k, GOTHIC) for k, c in enumerate(chars)]
    right = learn_font("press", chars, reliefs, known=(GOTHIC,))
    chars.insert(place, "8")
    reliefs.insert(place, blow("L", 77, GOTHIC))
    slipped = learn_font("press", chars, reliefs, known=(GOTHIC,))
    assert slipped.set_aside == (place,)
    assert likeness(slipped.font.glyphs["8"].relief, right.font.glyphs["8"].relief) > 0.999


def test_of_two_that_disagree_the_nearest_font_tells_which():
    learned_font = learned("888KK7722", more=[("B", blow("K", 1, GOTHIC)), ("B", blow("B", 2, GOTHIC))])
    assert learned_font.set_aside == (9,)
    assert likeness(learned_font.font.glyphs["B"].relief, drawn("B", GOTHIC)) > 0.85


def test_a_single_exemplar_of_another_character_teaches_nothing():
    learned_font = learned("888KK7722", more=[("B", blow("7", 1, GOTHIC))])
    assert learned_font.set_aside == (9,)
    assert "B" in learned_font.never_felt
    assert likeness(learned_font.font.glyphs["B"].relief, drawn("B", GOTHIC)) > 0.9


def test_what_cannot_be_learned_is_told():
    with pytest.raises(ExemplarError, match="no known font"):
        learn_font("press", ["K"], [drawn("K", GOTHIC)], known=())
    with pytest.raises(ExemplarError, match="differ in size"):
        learn_font("press", ["K", "K"], [drawn("K", GOTHIC), drawn("K", GOTHIC)[1:]], known=(GOTHIC,))
