"""Depth of marks: against the stamped height map, on reliefs that touch felt and on reliefs made up."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face, default_die
from glyphs.stamping.stamp import StampedPart, stamp_line
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.maps import HeightMap
from recognition.glyph_match.felt_line import FeltLine
from recognition.marks.depth import MarkDepth, across, mark_depths
from recognition.marks.laid_text import LaidText
from recognition.see.levelling import level
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from tests.support.felt import felt, shallower, view_of
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.relief import Relief, Route, relief_from_edges
from whisker_array.whisker.touch import default_touch

TEXT = "KR804217"
FELT_BIAS = {
    # of the depth: floors three samples wide are averaged with their walls, whose moment is not linear in the slope
    Face.FLAT: (-0.01, 0.05),
    Face.ROUND: (-0.02, 0.03),
    # the ball stops 0.41 of its radius above a V, and the raster averages over a sample: never too deep
    Face.SHARP: (-0.22, -0.04),
}
FELT_SD, LEAST_TO_MEAN = {Face.FLAT: 0.02, Face.ROUND: 0.02, Face.SHARP: 0.04}, 0.08
"""Of the depth: its error between characters of one part, and how far the least of one depth falls below its mean.
Of a V slanting lines are averaged over more of its width than straight ones."""
SAMPLED_MM = 0.004
"""What bilinear samples, 40 to the height, lose of a relief of 0.2 mm that is known exactly."""


def stamped(
    text: str = TEXT,
    *,
    font: Font,
    height_mm: float = 5.0,
    face: Face = Face.FLAT,
    raised: bool = False,
    depth_fraction: float = 0.12,
    samples: int = 80,
    **of_die: float,
) -> StampedPart:
    """A part whose characters differ in depth and in nothing else, each of one depth all along."""
    die = replace(default_die(height_mm, font=font, face=face), **{"burr_height_mm": 0.0, **of_die})
    return stamp_line(
        text,
        font,
        die,
        height_mm=height_mm,
        pitch_mm=height_mm / samples,
        variation=replace(StampingVariation.none(), depth_fraction=depth_fraction),
        raised=raised,
        rng=np.random.default_rng(7),
    )


def true_depth_mm(part: StampedPart, *, raised: bool = False) -> np.ndarray:
    """Deepest of each character's box: its floor, or the bottom of its V."""
    z, pitch = part.height_map.z_mm, part.height_map.pitch_mm
    depths = []
    for x0, y0, x1, y1 in part.boxes_mm:
        inside = z[int(y0 / pitch) : int(y1 / pitch) + 2, int(x0 / pitch) : int(x1 / pitch) + 2]
        depths.append(inside.max() if raised else -inside.min())
    return np.array(depths)


def laid_in(
    relief: Relief,
    part: StampedPart,
    font: Font,
    *,
    face: Face = Face.FLAT,
    raised: bool = False,
    off_mm: float = 0.0,
    turn_deg: float = 0.0,
) -> LaidText:
    """The text laid from where it was read: every character in the middle of its box or beside it."""
    boxes, height_mm = np.array(part.boxes_mm), part.height_mm
    middles = 0.5 * (boxes[:, :2] + boxes[:, 2:]) + (off_mm, -off_mm)
    line = TextLine.straight(*middles[0], length_mm=50.0, height_mm=height_mm, turned_deg=turn_deg)
    along = np.linalg.norm(middles - middles[0], axis=1) / height_mm
    felt_there = FeltLine(view_of(relief), line, (along + MARGIN) * HEIGHT_ROWS - 0.5, raised)
    return LaidText(felt_there, tuple(part.text), font, face)


def depths_of(relief: Relief, part: StampedPart, font: Font, **options: Any) -> tuple[MarkDepth | None, ...]:
    return mark_depths(relief, laid_in(relief, part, font, **options))


def known(depths: tuple[MarkDepth | None, ...]) -> np.ndarray:
    """(n, 3) least, mean and greatest."""
    return np.array([(d.min_mm, d.mean_mm, d.max_mm) for d in depths if d is not None])


def relief_felt(height_map: HeightMap, height_mm: float = 5.0) -> Relief:
    return relief_from_edges(edge_map(felt(height_map, height_mm)), default_touch(height_mm))


def exact(height_map: HeightMap, height_mm: float) -> Relief:
    """The relief itself, 40 samples to the height, as an ideal touch would give it."""
    pitch = height_mm / 40
    rows, cols = (int(size / pitch) for size in height_map.size_mm[::-1])
    y, x = np.mgrid[0:rows, 0:cols] * (pitch / height_map.pitch_mm)
    z = ndimage.map_coordinates(height_map.z_mm, [y, x], order=1).astype(np.float32)
    return Relief(z, None, None, pitch, (0.0, 0.0), 0.2, None, Route.FLOORS)


@pytest.fixture(scope="module")
def flat(gothic: Font) -> tuple[StampedPart, Relief]:
    part = stamped(font=gothic)
    return part, exact(part.height_map, 5.0)


# ------------------------------------------------------------------------------------------------------- felt


@pytest.mark.parametrize("height_mm", [3.2, 12.7])
@pytest.mark.parametrize("face", [Face.FLAT, Face.ROUND, Face.SHARP])
def test_the_depth_felt_is_that_of_the_height_map(face: Face, height_mm: float, gothic: Font) -> None:
    part = stamped("K804217", font=gothic, face=face, height_mm=height_mm)
    depths = known(depths_of(relief_felt(part.height_map, height_mm), part, gothic, face=face))
    truth = true_depth_mm(part)
    error = (depths - truth[:, None]) / truth[:, None]
    low, high = FELT_BIAS[face]
    assert low < error[:, 1].mean() < high
    assert error[:, 1].std() < FELT_SD[face]
    # all of a stroke is as deep here, so the least is not far from the mean
    assert np.all(depths[:, 0] <= depths[:, 1])
    assert np.abs(error[:, 0] - error[:, 1]).max() < LEAST_TO_MEAN


def test_a_tilt_of_the_part_is_no_depth(gothic: Font) -> None:
    part = stamped("K7B1", font=gothic)
    rows, cols = part.height_map.shape
    y, x = np.mgrid[0:rows, 0:cols] * part.height_map.pitch_mm
    slope = np.tan(np.radians(0.5))
    plane = slope * (x - x.mean()) - slope * (y - y.mean())
    tilted = HeightMap(part.height_map.z_mm + plane, part.height_map.pitch_mm)
    straight = known(depths_of(relief_felt(level(part.height_map)), part, gothic))[:, :2]
    # mounted level, as a height map is before it is felt; the plane is 44 micrometres over one character
    mounted = known(depths_of(relief_felt(level(tilted)), part, gothic))[:, :2]
    np.testing.assert_allclose(mounted, straight, atol=0.003)
    # felt as it lies: moments count against the land's, so depths grow as the lift of the land d0 + h_land does
    lift = 1.0 + np.abs(plane).max() / default_touch(5.0).preload_mm
    lying = known(depths_of(relief_felt(tilted), part, gothic))[:, :2]
    assert np.all(np.abs(lying - straight) < (lift - 1.0) * straight + 0.003)


def test_raised_marks_have_a_height(gothic: Font) -> None:
    part = stamped("K7B1", font=gothic, raised=True)
    depths = known(depths_of(relief_felt(part.height_map), part, gothic, raised=True))
    truth = true_depth_mm(part, raised=True)
    np.testing.assert_allclose(depths[:, 1], truth, rtol=0.06)


# ---------------------------------------------------------------------------------------------------- made up


@pytest.mark.parametrize("noise_mm", [0.0, 0.001, 0.004])
def test_the_uneven_land_says_how_uncertain_a_depth_is(
    noise_mm: float, flat: tuple[StampedPart, Relief], gothic: Font
) -> None:
    part, relief = flat
    noise = np.random.default_rng(1).normal(0.0, noise_mm, relief.height_mm.shape).astype(np.float32)
    rough = replace(relief, height_mm=relief.height_mm + noise)
    depths = [d.sd_mm for d in depths_of(rough, part, gothic) if d is not None]
    assert np.array(depths) == pytest.approx(np.hypot(0.001, 9.0 * noise_mm), rel=0.25)


@pytest.mark.parametrize(
    ("off_mm", "turn_deg"), [(0.0, 0.0), (0.2, 0.0), (-0.2, 0.0), (0.1, 1.5), (0.0, -2.0)]
)
def test_a_character_read_a_little_beside_its_place(
    off_mm: float, turn_deg: float, flat: tuple[StampedPart, Relief], gothic: Font
) -> None:
    part, relief = flat
    depths = known(depths_of(relief, part, gothic, off_mm=off_mm, turn_deg=turn_deg))
    np.testing.assert_allclose(depths[:, 1], true_depth_mm(part), atol=SAMPLED_MM)
    np.testing.assert_allclose(depths[:, 0], true_depth_mm(part), atol=2.0 * SAMPLED_MM)


def test_a_burr_is_no_land(gothic: Font) -> None:
    part = stamped("K7B1", font=gothic, burr_height_mm=0.04)
    depths = known(depths_of(exact(part.height_map, 5.0), part, gothic))
    np.testing.assert_allclose(depths[:, 1], true_depth_mm(part), atol=SAMPLED_MM)


BURR_FELT = {0.225: (0.3, 0.5), 0.4: (0.55, 0.75), 0.8: (0.7, 0.9)}
"""Of the die's burr: a rim as narrow as two samples is felt less than half as high, a broad one nearly as it is."""


@pytest.mark.parametrize("width_mm", BURR_FELT)
def test_a_burr_is_measured_beside_the_strokes(width_mm: float, gothic: Font) -> None:
    burr_mm = 0.06
    part = stamped("K804217", font=gothic, samples=160, burr_height_mm=burr_mm, burr_width_mm=width_mm)
    depths = [d.burr_mm for d in depths_of(relief_felt(part.height_map), part, gothic) if d is not None]
    low, high = BURR_FELT[width_mm]
    assert low * burr_mm < np.mean([b for b in depths if b is not None]) < high * burr_mm


def test_without_a_burr_there_is_none(flat: tuple[StampedPart, Relief], gothic: Font) -> None:
    part, relief = flat
    assert all(
        d is not None and d.burr_mm == pytest.approx(0.0, abs=1e-6) for d in depths_of(relief, part, gothic)
    )


def test_a_filled_stroke_has_no_depth_and_never_a_negative_one(
    flat: tuple[StampedPart, Relief], gothic: Font
) -> None:
    part, relief = flat
    z = relief.height_mm.copy()
    x0, y0, x1, y1 = (round(edge / relief.pitch_mm) for edge in part.boxes_mm[2])
    z[y0 - 3 : y1 + 4, x0 - 3 : x1 + 4] = 0.05  # heaped over
    depths = depths_of(replace(relief, height_mm=z), part, gothic)[2]
    assert (depths.min_mm, depths.mean_mm, depths.max_mm) == (0.0, 0.0, 0.0)


def test_one_shallow_character_among_deep_ones(gothic: Font) -> None:
    part = stamped(font=gothic)
    depths = known(depths_of(relief_felt(shallower(part, 2, floor_mm=0.05)), part, gothic))
    assert depths[2, 1] == pytest.approx(0.05, abs=0.008)
    assert depths[2, 0] == pytest.approx(0.05, abs=0.012)
    assert np.delete(depths, 2, axis=0)[:, 0].min() > 0.12


def test_a_shallow_leg_counts(gothic: Font) -> None:
    part = stamped("K74", font=gothic, depth_fraction=0.0)
    relief = exact(shallower(part, 1, floor_mm=0.06, below=0.6), 5.0)
    leg = known(depths_of(relief, part, gothic))[1]
    full = float(true_depth_mm(part)[1])
    assert leg[0] == pytest.approx(0.06, abs=2.0 * SAMPLED_MM)
    assert leg[2] == pytest.approx(full, abs=SAMPLED_MM)
    assert 0.06 < leg[1] < full


def test_a_neighbour_does_not_count(flat: tuple[StampedPart, Relief], gothic: Font) -> None:
    part, relief = flat
    alone = replace(relief, height_mm=relief.height_mm.copy())
    x0, _, x1, _ = part.boxes_mm[6]  # the 1, between 2 and 7
    x = relief.pitch_mm * np.arange(relief.height_mm.shape[1])
    alone.height_mm[:, (x < x0 - 0.1) | (x > x1 + 0.1)] = 0.0
    both = known(depths_of(relief, part, gothic))[6], depths_of(alone, part, gothic)[6]
    assert both[0][1] == pytest.approx(both[1].mean_mm, abs=1e-3)


def test_bad_samples_do_not_decide(flat: tuple[StampedPart, Relief], gothic: Font) -> None:
    part, relief = flat
    z = relief.height_mm.copy()
    bad = np.random.default_rng(3).random(z.shape) < 0.01
    z[bad] = np.nan
    holed = known(depths_of(replace(relief, height_mm=z), part, gothic))
    np.testing.assert_allclose(holed, known(depths_of(relief, part, gothic)), atol=0.003)


@pytest.mark.parametrize("kept", ["no strokes", "no land"])
def test_what_was_not_felt_is_not_known(kept: str, flat: tuple[StampedPart, Relief], gothic: Font) -> None:
    part, relief = flat
    z = relief.height_mm.copy()
    cols = z.shape[1] // 2
    if kept == "no strokes":
        z[:, :cols][z[:, :cols] < -0.02] = np.nan
    else:
        z[:, :cols][z[:, :cols] > -0.02] = np.nan
    depths = depths_of(replace(relief, height_mm=z), part, gothic)
    assert depths[0] is None
    assert depths[1] is None
    assert depths[-1] is not None


@pytest.fixture(scope="module")
def two(gothic: Font) -> StampedPart:
    return stamped("K7", font=gothic)


@given(
    offset=st.floats(-0.5, 0.5), gain=st.floats(0.2, 3.0), slope=st.floats(-0.02, 0.02), raised=st.booleans()
)
@settings(max_examples=15, deadline=None)
def test_depth_is_linear_in_height_and_free_of_level_and_slope(
    offset: float, gain: float, slope: float, raised: bool, two: StampedPart, gothic: Font
) -> None:
    plain = exact(two.height_map, 5.0)
    x = np.arange(plain.height_mm.shape[1]) * plain.pitch_mm
    z = (gain * plain.height_mm + offset + slope * x[None, :]) * (-1.0 if raised else 1.0)
    depths = known(depths_of(replace(plain, height_mm=z.astype(np.float32)), two, gothic, raised=raised))
    # where the middle of a stroke is looked for the slope of the plate may choose another place of the same floor
    np.testing.assert_allclose(depths, gain * known(depths_of(plain, two, gothic)), atol=2e-3 * gain + 5e-4)


def test_places_off_the_map_are_moved_onto_its_rim() -> None:
    depth = np.arange(20.0).reshape(4, 5)
    depth[1, 1] = np.nan
    points = np.array([(-3.0, 2.0), (9.0, 9.0), (0.5, 0.5)])
    below = across(depth, points, np.zeros((3, 2)), np.zeros(1), np.zeros(3))
    np.testing.assert_allclose(below, [[2.0, 19.0, np.nan]])
