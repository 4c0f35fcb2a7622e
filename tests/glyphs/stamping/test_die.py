import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.fonts.outlines import SERIAL_CHARACTERS, load_font
from glyphs.stamping.die import die_glyph, ideal_relief
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import Die, Face, default_depth_mm, default_die, relief_mm
from glyphs.surface.maps import MapError

GOTHIC = load_font("gothic")
DIE = Die(Face.FLAT, bevel_deg=45.0, depth_mm=0.2, stroke_mm=0.8)

faces = st.sampled_from(Face)
bevels = st.floats(20.0, 70.0)


@st.composite
def dies(draw):
    depth = draw(st.floats(0.05, 0.5))
    return Die(
        draw(faces),
        bevel_deg=draw(bevels),
        depth_mm=depth,
        stroke_mm=draw(st.floats(0.1, 2.0)),
        root_radius_mm=draw(st.floats(0.0, 1.0)) * depth,
        edge_radius_mm=draw(st.floats(0.0, 1.0)) * depth,
    )


def test_depth_table_is_met_and_prolonged_in_proportion():
    assert default_depth_mm(9.5) == pytest.approx(0.41)
    assert default_depth_mm(4.0) == pytest.approx(0.175)
    assert default_depth_mm(1.6) == pytest.approx(0.075)
    assert default_depth_mm(25.4) == pytest.approx(0.86)


def test_floor_is_the_depth_and_wall_the_bevel():
    for bevel in (30.0, 45.0, 60.0):
        die = replace(DIE, bevel_deg=bevel)
        d = np.linspace(-0.4, 0.1, 5001)
        z = relief_mm(d, die)
        assert z.min() == pytest.approx(-0.2, abs=1e-6)
        assert (z[d >= 0] == 0).all()
        wall = (z < -0.01) & (z > -0.19)
        assert np.gradient(z, d)[wall] == pytest.approx(math.tan(math.radians(bevel)), rel=0.01)


def test_sharp_is_a_v_to_the_medial_axis_but_never_below_the_depth():
    sharp = replace(DIE, face=Face.SHARP)
    assert relief_mm([-0.1, -0.15, -0.3], sharp) == pytest.approx([-0.1, -0.15, -0.2])
    narrow = replace(sharp, stroke_mm=0.3, root_radius_mm=0.02)
    tip = relief_mm(-0.15, narrow, half_width_mm=0.15)
    # A root fillet of radius r takes r (1/cos bevel - 1) off the V's tip.
    assert float(tip) == pytest.approx(-(0.15 - 0.02 * (math.sqrt(2) - 1)), abs=1e-6)


def test_round_floor_is_an_arc_tangent_to_the_walls():
    die = replace(DIE, face=Face.ROUND, stroke_mm=0.6)
    half = 0.3
    x = np.linspace(-half, half, 6001)
    z = relief_mm(np.abs(x) - half, die, half_width_mm=half).astype(float)
    assert z.min() == pytest.approx(-0.2, abs=1e-5)
    assert x[np.argmin(z)] == pytest.approx(0.0, abs=0.02)
    radius = (half - 0.2) / math.tan(math.radians(22.5))
    floor = np.abs(x) < 0.9 * radius * math.sin(math.radians(45))
    assert z[floor] == pytest.approx(-0.2 + radius - np.sqrt(radius**2 - x[floor] ** 2), abs=2e-5)


@settings(max_examples=25, deadline=None)
@given(die=dies(), stroke_known=st.booleans())
def test_profile_is_continuous_monotonic_and_bounded(die, stroke_known):
    half = die.stroke_mm / 2
    d = np.linspace(-half, 0.5, 4001)
    z = relief_mm(d, die, half_width_mm=half if stroke_known else None).astype(float)
    slope = math.tan(math.radians(die.bevel_deg))
    assert z.min() >= -die.depth_mm - 1e-6
    assert z.max() <= 1e-6
    assert np.diff(z).min() >= -2e-6
    # Nowhere steeper than the wall: float32 noise on a step of the grid aside.
    assert np.diff(z).max() <= slope * (d[1] - d[0]) * 1.02 + 2e-6
    assert z[-1] == 0.0


def test_burr_stands_outside_and_adds_metal():
    die = replace(DIE, burr_height_mm=0.03, burr_width_mm=0.2)
    d = np.linspace(-0.4, 0.4, 1601)
    with_burr, without = relief_mm(d, die), relief_mm(d, DIE)
    rim = with_burr - without
    assert rim[d <= 0].max() == 0.0
    assert rim[d > 0.2].max() == 0.0
    assert rim.max() == pytest.approx(0.03, rel=1e-3)
    assert rim.sum() > 0


def test_a_deeper_blow_is_the_same_die_sunk_further():
    d = np.linspace(-0.4, 0.2, 601)
    deeper = relief_mm(d, DIE, extra_depth_mm=0.05)
    assert deeper.min() == pytest.approx(-0.25, abs=1e-6)
    # Away from the land the whole face has gone down by the same amount.
    inside = d < 0
    assert deeper[inside] == pytest.approx(relief_mm(d, DIE)[inside] - 0.05, abs=1e-6)
    assert relief_mm(d, DIE, extra_depth_mm=-0.3) == pytest.approx(np.zeros(601), abs=1e-4)
    assert relief_mm(d, DIE, extra_depth_mm=np.zeros(601)) == pytest.approx(relief_mm(d, DIE), abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(char=st.sampled_from(SERIAL_CHARACTERS), face=faces, height=st.floats(2.0, 13.0))
def test_a_mark_is_as_tall_as_it_says_and_no_deeper_than_the_die(char, face, height):
    die = default_die(height, font=GOTHIC, face=face)
    ideal = ideal_relief(
        GOTHIC.glyph(char),
        replace(die, edge_radius_mm=0.0),
        height_mm=height,
        pitch_mm=height / 50,
        margin_mm=0.1,
    )
    z = ideal.height_map.z_mm
    rows = np.flatnonzero((z < 0).any(axis=1)) * ideal.height_map.pitch_mm
    # First and last inked rows are each a pitch inside the edge at most; a dot's top may fall between two.
    assert height - 2.5 * height / 50 <= rows[-1] - rows[0] <= height
    assert -die.depth_mm - 1e-6 <= z.min() < -0.3 * die.depth_mm


def relief_of(char="R", **options):
    settings_ = {"height_mm": 5.0, "pitch_mm": 0.1, "margin_mm": 1.0, **options}
    return ideal_relief(GOTHIC.glyph(char), default_die(5.0, font=GOTHIC), **settings_)


def test_raised_is_sunk_turned_over():
    assert np.array_equal(relief_of(raised=True).height_map.z_mm, -relief_of().height_map.z_mm)
    burred = replace(default_die(5.0, font=GOTHIC), burr_height_mm=0.05)
    raised = ideal_relief(
        GOTHIC.glyph("R"), burred, height_mm=5.0, pitch_mm=0.1, margin_mm=1.0, raised=True
    ).height_map.z_mm
    assert raised.min() == 0.0


def test_dots_stand_about_a_pitch_apart_and_hold_the_ends():
    die = default_die(5.0, font=GOTHIC, face=Face.DOTTED)
    dots = np.concatenate(die_glyph(GOTHIC.glyph("I"), die, height_mm=5.0).strokes) * 5.0
    gaps = np.diff(np.sort(dots[:, 1]))
    assert gaps == pytest.approx(gaps[0])
    assert gaps[0] == pytest.approx(die.dot_pitch_mm, rel=0.1)
    assert dots[:, 1].max() - dots[:, 1].min() == pytest.approx(5.0 - die.stroke_mm)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"face": "blunt"}, "unknown face"),
        ({"bevel_deg": 4.9}, "bevel_deg"),
        ({"bevel_deg": 90.0}, "bevel_deg"),
        ({"bevel_deg": math.nan}, "bevel_deg"),
        ({"depth_mm": 0.0}, "depth_mm"),
        ({"stroke_mm": -1.0}, "stroke_mm"),
        ({"root_radius_mm": -0.1}, "root_radius_mm"),
        ({"edge_radius_mm": math.inf}, "edge_radius_mm"),
        ({"burr_height_mm": -0.1}, "burr_height_mm"),
        ({"burr_width_mm": 0.0}, "burr_width_mm"),
        ({"dot_pitch_mm": 0.0}, "dot_pitch_mm"),
    ],
)
def test_die_refuses(change, message):
    with pytest.raises(StampError, match=message):
        replace(DIE, **change)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"height_mm": 0.0}, StampError, "height_mm"),
        ({"height_mm": 0.5}, StampError, "finer die"),
        ({"margin_mm": -1.0}, StampError, "margin_mm"),
        ({"pitch_mm": 0.0}, StampError, "pitch_mm"),
        ({"pitch_mm": 1e-4}, MapError, "limit"),
    ],
)
def test_ideal_relief_refuses(options, error, message):
    with pytest.raises(error, match=message):
        relief_of(**options)
