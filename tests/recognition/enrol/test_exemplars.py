import numpy as np
import pytest

from recognition.enrol.exemplars import ExemplarError, cut_height_map
from recognition.enrol.learned_font import align_relief, likeness


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
