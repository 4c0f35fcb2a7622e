import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.fonts.glyph import FontError
from glyphs.fonts.outlines import SERIAL_CHARACTERS, load_font
from glyphs.stamping.die import die_glyph, shape_relief_mm, to_plate
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import Face, default_die
from glyphs.stamping.plate import plate_texture
from glyphs.stamping.stamp import stamp_line
from glyphs.stamping.variation import PlateVariation, StampingVariation

GOTHIC = load_font("gothic")
DIE = default_die(5.0, font=GOTHIC)
NONE = StampingVariation.none()
CALM = replace(StampingVariation(), plate=PlateVariation.none(), burr_fraction=0.0)


def rng(seed=1):
    return np.random.default_rng(seed)


def part(text="AB12", **options):
    given_ = {"height_mm": 5.0, "pitch_mm": 0.1, "rng": rng(), **options}
    return stamp_line(text, given_.pop("font", GOTHIC), given_.pop("die", DIE), **given_)


def test_same_seed_same_part_and_other_seed_another():
    first, again, other = part(rng=rng(7)), part(rng=rng(7)), part(rng=rng(8))
    assert np.array_equal(first.height_map.z_mm, again.height_map.z_mm)
    assert first.boxes_mm == again.boxes_mm
    assert not np.array_equal(first.height_map.z_mm, other.height_map.z_mm)


@pytest.mark.parametrize(
    ("angle", "face"), [(0.0, Face.FLAT), (-90.0, Face.FLAT), *((12.0, face) for face in Face)]
)
def test_without_variation_every_character_is_the_ideal_one(angle, face):
    die = default_die(5.0, font=GOTHIC, face=face)
    stamped = part("R8-Q", die=die, variation=NONE, line_rotation_deg=angle)
    z = stamped.height_map.z_mm
    expected = np.zeros_like(z)
    y, x = np.mgrid[: z.shape[0], : z.shape[1]] * 0.1
    for char, centre in zip("R8-Q", _centres(stamped, die, angle), strict=True):
        u, v = to_plate(x - centre[0], y - centre[1], rotation_deg=angle)
        shape = _fitted(char, die)
        middle = (shape.ink_box[0] + shape.ink_box[2]) / 2 * 5.0
        expected = np.minimum(
            expected,
            shape_relief_mm(
                die_glyph(GOTHIC.glyph(char), die, height_mm=5.0), die, u + middle, v + 2.5, height_mm=5.0
            ),
        )
    assert z == pytest.approx(expected, abs=2e-5)


def _fitted(char, die):
    from glyphs.fonts.glyph import with_stroke

    return with_stroke(GOTHIC.glyph(char), die.stroke_mm / 5.0)


def _centres(stamped, die, angle):
    """Reference points from the advances alone, anchored at the first character's box."""
    text = stamped.text
    along, origin = [], 0.0
    for char in text:
        shape = _fitted(char, die)
        along.append((origin + (shape.ink_box[0] + shape.ink_box[2]) / 2) * 5.0)
        origin += shape.advance
    # R is not symmetric about its reference point: its rotated strokes tell where its box lies.
    from glyphs.stamping.die import die_glyph

    shape = die_glyph(GOTHIC.glyph(text[0]), die, height_mm=5.0)
    points = np.concatenate(shape.strokes) * 5.0 - ((shape.ink_box[0] + shape.ink_box[2]) / 2 * 5.0, 2.5)
    px, py = to_plate(points[:, 0], points[:, 1], rotation_deg=angle)
    x0 = stamped.boxes_mm[0][0] + die.stroke_mm / 2 - px.min()
    y0 = stamped.boxes_mm[0][1] + die.stroke_mm / 2 - py.min()
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return [(x0 + c * (a - along[0]), y0 + s * (a - along[0])) for a in along]


@settings(max_examples=25, deadline=None)
@given(
    text=st.text(SERIAL_CHARACTERS + "-./ ", min_size=1, max_size=4),
    angle=st.floats(-40.0, 40.0),
    seed=st.integers(0, 2**32 - 1),
    raised=st.booleans(),
)
def test_boxes_lie_on_the_plate_and_hold_all_the_ink(text, angle, seed, raised):
    stamped = part(text, line_rotation_deg=angle, rng=rng(seed), variation=CALM, raised=raised)
    width, height = stamped.height_map.size_mm
    left = np.abs(stamped.height_map.z_mm) > 1e-3
    rows, cols = left.shape
    for x0, y0, x1, y1 in stamped.boxes_mm:
        assert 0 <= x0 < x1 <= width + 1e-9
        assert 0 <= y0 < y1 <= height + 1e-9
        # The rounding of the edge reaches a little beyond the ink, a worn die's 0.2 mm.
        x, y = np.arange(cols) * 0.1, np.arange(rows) * 0.1
        left &= ~(((x > x0 - 0.25) & (x < x1 + 0.25))[None, :] & ((y > y0 - 0.25) & (y < y1 + 0.25))[:, None])
    assert not left.any()


def depths(variation, n=60):
    stamped = part("I" * n, variation=variation, die=replace(DIE, edge_radius_mm=0.0))
    z = stamped.height_map.z_mm
    return np.array([z[:, int(b[0] / 0.1) : int(b[2] / 0.1) + 2].min() for b in stamped.boxes_mm])


def test_depth_varies_by_what_was_asked():
    # 60 blows: the standard error of a standard deviation is 9 %, four of those are allowed.
    assert np.std(depths(replace(NONE, depth_fraction=0.1))) == pytest.approx(0.1 * DIE.depth_mm, rel=0.37)
    assert np.std(depths(NONE)) == 0.0


def test_tilt_makes_one_side_deeper():
    stamped = part("H", variation=replace(NONE, tilt_fraction=0.3), rng=rng(5))
    z, box = stamped.height_map.z_mm, stamped.boxes_mm[0]
    row = z[int((box[1] + box[3]) / 2 / 0.1) + 10]
    left, right = row[: row.size // 2].min(), row[row.size // 2 :].min()
    assert abs(left - right) > 0.01


def test_worn_characters_are_shallower_and_faint_on_one_side():
    worn = depths(replace(NONE, worn_probability=1.0), 8)
    assert (worn > -0.9 * DIE.depth_mm).all()
    z = part("H", variation=replace(NONE, worn_probability=1.0)).height_map.z_mm
    sunk = z < -0.02
    assert sunk.any()
    assert z[sunk].max() / z[sunk].min() < 0.5


def test_roughness_has_the_ra_and_correlation_length_asked_for():
    x = y = np.arange(400) * 0.02
    only = replace(PlateVariation.none(), roughness_ra_um=1.5, roughness_length_mm=0.1)
    z = plate_texture(x, y, only, rng=rng()).astype(float)
    assert np.abs(z - z.mean()).mean() == pytest.approx(1.5e-3, rel=0.02)
    shifted = np.mean(z[:, :-5] * z[:, 5:]) / np.mean(z * z)
    # 1/e at the correlation length; some 5000 independent patches leave a few per cent of scatter.
    assert shifted == pytest.approx(math.exp(-1), abs=0.06)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [({"text": ""}, StampError, "no text"), ({"text": "AéB"}, FontError, "no character 'é'")],
)
def test_stamp_refuses(options, error, message):
    with pytest.raises(error, match=message):
        part(**options)
