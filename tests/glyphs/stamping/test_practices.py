"""Dies, plates, layouts and hands by name: each keeps to what every stamped part is, and has what it is named for."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from glyphs.part import stamp
from glyphs.stamping.blow import draw_stances
from glyphs.stamping.dies import DIES
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import default_depth_mm
from glyphs.stamping.forms import MAX_SAG_MM, PlateForm
from glyphs.stamping.layouts import LAYOUTS, Layout
from glyphs.stamping.plates import PLATES
from glyphs.stamping.stamp import StampedPart, stamp_line
from glyphs.stamping.textures import Grinding, Milling, Sand, Texture, Turning
from glyphs.stamping.variation import PlateVariation, StampingVariation

TEXT = "B8-K2"
NONE, PERFECT = StampingVariation.none(), PlateVariation.none()
PITCH_MM = 0.08


@cache
def made(text: str = TEXT, seed: int = 2, **options: str) -> StampedPart:
    return stamp(text, height_mm=5.0, pitch_mm=PITCH_MM, seed=seed, **options).stamped  # type: ignore[arg-type]


def bare(**options: object) -> StampedPart:
    """On a perfect plate, so that all that is not zero is the mark's."""
    smooth = replace(StampingVariation(), plate=PERFECT)
    given = {"text": TEXT, "height_mm": 5.0, "pitch_mm": PITCH_MM, "seed": 2, "variation": smooth, **options}
    return stamp(**given).stamped  # type: ignore[arg-type]


def outside_the_boxes(part: StampedPart, grow_mm: float) -> np.ndarray:
    left = np.ones(part.height_map.shape, dtype=bool)
    y, x = (np.arange(n) * part.height_map.pitch_mm for n in left.shape)
    for x0, y0, x1, y1 in part.inked_mm:
        columns, lines = (x > x0 - grow_mm) & (x < x1 + grow_mm), (y > y0 - grow_mm) & (y < y1 + grow_mm)
        left &= ~(columns[None, :] & lines[:, None])
    return left


@pytest.mark.parametrize("height_mm", [2.0, 5.0, 12.0])
@pytest.mark.parametrize("die", DIES)
def test_a_die_cuts_as_deep_as_is_said_and_within_its_boxes(die: str, height_mm: float) -> None:
    ideal = replace(DIES[die].applied(NONE), double_strike_probability=0.0)
    kind = DIES[die].die(height_mm, font=load_font("gothic"))
    part = stamp_line(
        TEXT, load_font("gothic"), kind, height_mm=height_mm, variation=ideal, rng=np.random.default_rng(1)
    )
    z = part.height_map.z_mm
    depth = default_depth_mm(height_mm)
    # narrow grooves of large letters and the fillet of a V end short of the depth; a lost wall takes no depth
    # from the other
    assert -1.001 * depth <= z.min() <= -0.9 * depth
    # the pile-up, 0.3 of a stroke wide, lies around the ink, and the rounding of the edge
    rim = kind.burr_width_mm + kind.edge_radius_mm + part.height_map.pitch_mm
    assert not z[outside_the_boxes(part, rim)].any()
    for x0, y0, x1, y1 in part.boxes_mm:
        rows, cols = ((np.arange(n) * part.height_map.pitch_mm) for n in z.shape)
        inside = z[(rows > y0) & (rows < y1)][:, (cols > x0) & (cols < x1)]
        assert inside.min() < -0.8 * depth


def test_a_blunt_v_has_a_flat_floor_and_walls_that_are_not_steeper() -> None:
    blunt, flat = (DIES[name].die(5.0, font=load_font("gothic")) for name in ("blunt-v", "flat"))
    floor = blunt.stroke_mm - 2 * blunt.depth_mm / math.tan(math.radians(blunt.bevel_deg))
    stroke = load_font("gothic").stroke_ratio * 5.0
    assert floor == pytest.approx(0.2 * stroke)
    assert blunt.stroke_mm < flat.stroke_mm
    assert blunt.bevel_deg == flat.bevel_deg


def test_pile_up_is_higher_on_the_side_to_which_a_blow_leans() -> None:
    even, lopsided = (
        bare(text="IIII", variation=replace(NONE, burr_fraction=0.3, pile_up_lean=lean))
        for lean in (0.0, 0.9)
    )
    ratios = []
    for part in (even, lopsided):
        z = part.height_map.z_mm
        for x0, _, x1, _ in part.boxes_mm:
            middle = z[z.shape[0] // 2]
            x = np.arange(middle.size) * PITCH_MM
            left, right = (
                middle[(x > x0 - 0.4) & (x < x0 + 0.1)].max(),
                middle[(x < x1 + 0.4) & (x > x1 - 0.1)].max(),
            )
            ratios.append(min(left, right) / max(left, right))
    assert min(ratios[:4]) > 0.8  # of a crest that the samples may miss by half a pitch
    assert min(ratios[4:]) < 0.6
    # what rises on one side is missing on the other
    z = even.height_map.z_mm
    assert lopsided.height_map.z_mm.max() > 1.5 * z.max()
    np.testing.assert_array_equal(np.minimum(lopsided.height_map.z_mm, 0.0), np.minimum(z, 0.0))


def test_one_wall_is_missing() -> None:
    whole, part = (bare(text="O", variation=replace(NONE, flank_loss=loss)) for loss in (0.0, 1.0))
    z, full = part.height_map.z_mm, whole.height_map.z_mm
    assert (z >= full - 1e-6).all()
    assert z.min() == pytest.approx(full.min(), rel=0.01)
    # across the stem of an I, whose stamp leans to the right (or left): that half has lost its wall, the other none
    how = replace(NONE, flank_loss=1.0)
    for seed in (2, 3, 5):
        ((lean_deg, _),) = draw_stances(how, 1, rng=np.random.default_rng((seed,)))
        lean = math.cos(math.radians(lean_deg))
        before, after = (bare(text="I", seed=seed, variation=v).height_map.z_mm for v in (NONE, how))
        sunk = np.flatnonzero(before[before.shape[0] // 2] < 0.0)
        kept = (after / np.minimum(before, -1e-9))[before.shape[0] // 2, sunk]
        halves = kept[: sunk.size // 2], kept[-(sunk.size // 2) :]
        lost, whole_half = (halves[1], halves[0]) if lean > 0.0 else halves
        np.testing.assert_allclose(whole_half, 1.0, atol=1e-3)
        # at the wall 1 - |cos lean| is left of the depth; the outermost sample lies up to a pitch inside
        stroke = sunk.size * PITCH_MM
        assert lost.min() == pytest.approx(1.0 - abs(lean), abs=2 * PITCH_MM / stroke + 0.02)


def test_double_strikes_come_as_often_and_as_far_apart_as_asked() -> None:
    once, twice = (
        bare(text="I" * 12, variation=replace(NONE, double_strike_probability=p, double_strike_fraction=0.1))
        for p in (0.0, 0.5)
    )
    more = [
        (b[2] - b[0]) + (b[3] - b[1]) - (a[2] - a[0]) - (a[3] - a[1])
        for a, b in zip(once.boxes_mm, twice.boxes_mm, strict=True)
    ]
    struck = np.array([m for m in more if m > 1e-9])
    assert 2 <= struck.size <= 10  # of 12 at one in two: beyond it lie 0.6 %
    # |cos| + |sin| of the way to the second blow lies between 1 and 1.41; its length scatters by 30 %, clipped at 2.5
    assert (struck > 0.1 * 5.0 * 0.25).all()
    assert (struck < 0.1 * 5.0 * 1.75 * 1.42).all()


@pytest.mark.parametrize("height_mm", [2.0, 12.0])
@pytest.mark.parametrize("text", ["K7", "1M8GDM9AXKP042788"])
@pytest.mark.parametrize("plate", PLATES)
def test_a_plate_of_any_size_can_be_made(plate: str, text: str, height_mm: float) -> None:
    for layout in LAYOUTS:
        part = stamp(text, height_mm=height_mm, pitch_mm=height_mm / 15, plate=plate, layout=layout, seed=1)
        width, height = part.height_map.size_mm
        assert np.isfinite(part.height_map.z_mm).all()
        assert np.ptp(part.height_map.z_mm) < 2 * MAX_SAG_MM + 1.0
        for x0, y0, x1, y1 in part.stamped.inked_mm:
            assert 0.0 <= x0 < x1 <= width
            assert 0.0 <= y0 < y1 <= height


def test_a_form_is_what_is_said_and_marks_keep_their_measures_along_the_skin() -> None:
    form = PlateForm(radius_x_mm=60.0)
    flat, bent = (
        bare(text="HHHHHH", variation=replace(NONE, plate=replace(PERFECT, form=f)))
        for f in (PlateForm(), form)
    )
    z = bent.height_map.z_mm
    x = (np.arange(z.shape[1]) - (z.shape[1] - 1) / 2) * PITCH_MM
    # far from the marks the plate is the arc: the line's margin is 0.8 of the height
    np.testing.assert_allclose(z[5], np.sqrt(3600.0 - x**2) - 60.0, atol=1e-5)
    middle = (z.shape[1] - 1) / 2 * PITCH_MM
    for (a0, _, a1, _), (b0, _, b1, _) in zip(flat.boxes_mm, bent.boxes_mm, strict=True):
        skin = 60.0 * (math.asin((b1 - middle) / 60.0) - math.asin((b0 - middle) / 60.0))
        assert skin == pytest.approx(a1 - a0, abs=1e-3)
    ends = [b[2] - b[0] for b in bent.boxes_mm]
    assert ends[0] < ends[2] - 0.03
    land = z - (np.sqrt(3600.0 - x**2) - 60.0)[None, :]
    assert np.abs(land[outside_the_boxes(bent, 0.2)]).max() < 1e-5
    assert land.min() == pytest.approx(flat.height_map.z_mm.min(), rel=0.02)


@pytest.mark.parametrize(
    ("texture", "ra_um"),
    [
        (Milling(), 4.0),
        (Turning(), 3.6),
        (Turning(ring_radius_mm=25.0), 3.6),
        (Grinding(), 3.0),
        (Sand(), 9.0),
    ],
)
def test_a_texture_is_as_rough_as_is_said(texture: Texture, ra_um: float) -> None:
    x, y = np.arange(500) * 0.05, np.arange(240) * 0.05
    z = texture(x, y, rng=np.random.default_rng(4))
    assert z.dtype == np.float32
    assert z.shape == (240, 500)
    np.testing.assert_array_equal(z, texture(x, y, rng=np.random.default_rng(4)))
    # the Ra of round grooves 2 t^2 - 1 is 0.257 of their depth; chatter and unevenness average out
    assert np.abs(z - z.mean()).mean() * 1e3 == pytest.approx(ra_um, rel=0.15)
    assert abs(z.mean()) < 1e-3


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_boxes_hold_all_the_ink_of_every_layout(layout: str, seed: int) -> None:
    part = bare(layout=layout, seed=seed, variation=NONE)
    z = part.height_map.z_mm
    assert not z[outside_the_boxes(part, 0.1)].any()
    for x0, y0, x1, y1 in part.inked_mm:
        rows, cols = (np.arange(n) * PITCH_MM for n in z.shape)
        assert z[(rows > y0) & (rows < y1)][:, (cols > x0) & (cols < x1)].min() < -0.15
    assert part.text == TEXT


@pytest.mark.parametrize("radius_mm", [30.0, -30.0])
def test_characters_of_an_arc_stand_on_its_circle(radius_mm: float) -> None:
    part = bare(text="IIIIIII", layout=Layout(radius_mm=radius_mm), variation=NONE)
    middles = np.array([((b[0] + b[2]) / 2, (b[1] + b[3]) / 2) for b in part.boxes_mm])
    # the baseline follows the arc, half a height below the middles
    system = np.column_stack([2 * middles, np.ones(len(middles))])
    (cx, cy, c), *_ = np.linalg.lstsq(system, (middles**2).sum(axis=1), rcond=None)
    assert math.sqrt(c + cx**2 + cy**2) == pytest.approx(abs(radius_mm + 2.5), rel=1e-6)
    assert (cy > middles[:, 1].max()) == (radius_mm > 0.0)
    # an upright I is as wide as its stroke; one that is turned is wider
    widths = [b[2] - b[0] for b in part.boxes_mm]
    assert min(widths) == widths[3]
    assert widths[0] > 2 * widths[3]
    with pytest.raises(StampError, match="does not fit an arc"):
        bare(text="I" * 30, layout=Layout(radius_mm=10.0))


def test_of_two_lines_the_one_asked_for_is_the_text() -> None:
    above = {made(seed=seed, layout="two-lines").other_boxes_mm[0][1] for seed in range(6)}
    assert len(above) > 1
    part = bare(layout=Layout(other_text="42X", other_above=False, gap=0.5), variation=NONE)
    alone = bare(variation=NONE)
    assert part.text == alone.text
    assert part.other_text == "42X"
    assert part.boxes_mm == pytest.approx(np.array(alone.boxes_mm))
    low, high = max(b[3] for b in part.boxes_mm), min(b[1] for b in part.other_boxes_mm)
    assert high - low == pytest.approx(2.5, abs=1e-6)
    assert part.height_map.size_mm[1] - alone.height_map.size_mm[1] == pytest.approx(7.5, abs=PITCH_MM)


def test_a_hand_strays_more_than_a_press() -> None:
    def spread(practice: str) -> tuple[float, float]:
        parts = [made("H" * 10, seed=seed, practice=practice) for seed in range(3)]
        middles = [np.array([(b[1] + b[3]) / 2 for b in part.boxes_mm]) for part in parts]
        gaps = [np.diff([b[0] for b in part.boxes_mm]) for part in parts]
        return float(np.std(np.diff(middles))), float(np.std(gaps))

    press, hand = spread("press"), spread("hand")
    assert hand[0] > 1.5 * press[0]
    assert hand[1] > 1.4 * press[1]
    assert spread("ideal") == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"practice": "robot"}, "no practice 'robot'; use one of press, hand, ideal"),
        ({"die": "oval"}, "no die 'oval'; use one of flat, sharp, blunt-v"),
        ({"plate": "moon"}, "no plate 'moon'; use one of machined, cylinder"),
        ({"layout": "spiral"}, "no layout 'spiral'; use one of straight, turned, arc"),
        ({"die": "round", "face": "sharp"}, "its own face"),
        ({"practice": "hand", "variation": NONE}, "or a practice"),
        ({"plate": PlateVariation(form=PlateForm(radius_x_mm=8.0))}, "larger radius"),
    ],
)
def test_what_cannot_be_is_refused(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(StampError, match=message):
        bare(**{"variation": None, **wrong})
