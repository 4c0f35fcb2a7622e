"""Views, their strips, and views on another grid: against plain interpolation, and against the part turned round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from recognition.see.resample import resample, turn_back, turn_view
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine
from recognition.see.view import (
    DIRECTIONS,
    EDGES,
    GREY,
    HEIGHTS,
    KNOWN,
    LAYERS,
    View,
    ViewKind,
    felt_view,
    heights_view,
    photo_view,
)
from whisker_array.estimation.relief import Relief, Route

# -------------------------------------------------------------------------------------------------------------- view

PIXEL_SHARE = 1.0 / 64.0
"""Of a pixel, by which a strip's samples may lie off: cv2.remap knows places to a 32nd."""
PITCH_MM = 0.1


def view_of(layers: NDArray[np.float32], *, origin_mm: tuple[float, float] = (0.0, 0.0)) -> View:
    return View(ViewKind.FELT, layers, PITCH_MM, origin_mm)


def random_view(seed: int) -> View:
    """Smooth noise in every layer, all of it known."""
    from scipy import ndimage

    rng = np.random.default_rng(seed)
    layers = ndimage.gaussian_filter(rng.normal(size=(LAYERS, 120, 150)), (0, 3, 3)).astype(np.float32)
    layers[KNOWN] = 1.0
    return view_of(layers)


def ramp(slope: tuple[float, float], *, origin_mm: tuple[float, float] = (0.0, 0.0)) -> View:
    """Brightness that rises evenly, 1 + slope . (x, y) of the frame."""
    layers = np.zeros((LAYERS, 160, 200), dtype=np.float32)
    y, x = np.mgrid[:160, :200] * PITCH_MM
    layers[GREY] = 1.0 + slope[0] * (x + origin_mm[0]) + slope[1] * (y + origin_mm[1])
    layers[KNOWN] = 1.0
    return view_of(layers, origin_mm=origin_mm)


# ------------------------------------------------------------------------------------------------- what a view is


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"layers": np.zeros((LAYERS - 1, 9, 9), np.float32)}, "layers of rows and columns"),
        ({"layers": np.zeros((LAYERS, 9), np.float32)}, "layers of rows and columns"),
        ({"layers": np.full((LAYERS, 9, 9), np.nan, np.float32)}, "finite"),
        ({"pitch_mm": 0.0}, "pitch_mm"),
        ({"pitch_mm": -0.1}, "pitch_mm"),
        ({"pitch_mm": np.inf}, "pitch_mm"),
    ],
)
def test_what_is_no_view_is_refused(changed: dict[str, object], message: str) -> None:
    given_ = {"kind": ViewKind.FELT, "layers": np.zeros((LAYERS, 9, 9), np.float32), "pitch_mm": 0.1}
    with pytest.raises(ValueError, match=message):
        View(**{**given_, **changed})  # type: ignore[arg-type]


def test_a_view_cannot_be_written_on() -> None:
    view = random_view(0)
    with pytest.raises(ValueError, match="read-only"):
        view.layers[0, 0, 0] = 1.0
    assert view.size_mm == pytest.approx((149 * PITCH_MM, 119 * PITCH_MM))


def test_a_height_map_is_heights_where_it_is_known() -> None:
    z = np.array([[0.0, -0.2, np.nan], [0.1, 0.0, 0.0]], dtype=np.float32)
    view = heights_view(HeightMap(z, PITCH_MM))
    np.testing.assert_array_equal(view.layers[KNOWN], np.isfinite(z))
    np.testing.assert_array_equal(view.layers[HEIGHTS], np.nan_to_num(z))
    assert not view.layers[GREY : EDGES + 4].any()
    assert (view.kind, view.pitch_mm, view.origin_mm) == (ViewKind.HEIGHTS, PITCH_MM, (0.0, 0.0))


def test_a_photograph_is_brightness_in_its_frame() -> None:
    pixels = np.arange(72, dtype=np.uint8).reshape(8, 9)
    view = photo_view(Photo(pixels, pitch_mm=PITCH_MM, centre_mm=(3.0, 2.0)))
    np.testing.assert_allclose(view.layers[GREY], pixels / 255.0, atol=1e-6)
    assert view.layers[KNOWN].all()
    assert view.origin_mm == pytest.approx((3.0 - 4.0 * PITCH_MM, 2.0 - 3.5 * PITCH_MM))
    # without a scale a millimetre is a pixel
    assert photo_view(Photo(pixels)).pitch_mm == 1.0


@pytest.mark.parametrize("with_heights", [True, False])
def test_what_was_felt_lies_in_the_layers_of_its_directions(with_heights: bool) -> None:
    order = (TraceDirection.BACK_Y, TraceDirection.FORWARD_X)
    enhancement = np.stack([np.full((4, 5), 2.0), np.full((4, 5), -99.0)]).astype(np.float32)
    valid = np.ones((4, 5), dtype=np.bool_)
    valid[0] = False
    edges = EdgeMap(enhancement, order, valid, PITCH_MM, (1.0, 2.0))
    height = np.full((4, 5), -0.1, dtype=np.float32)
    height[1, 1] = np.nan
    relief = Relief(height, None, None, PITCH_MM, (1.0, 2.0), 0.2, None, Route.FLOORS)
    view = felt_view(edges, relief if with_heights else None)
    known = valid & np.isfinite(height) if with_heights else valid
    np.testing.assert_array_equal(view.layers[KNOWN], known)
    np.testing.assert_allclose(view.layers[EDGES + DIRECTIONS.index(TraceDirection.BACK_Y)], 2.0 * known)
    # a jammed whisker's moment knows no bounds, a view does
    forward = view.layers[EDGES + DIRECTIONS.index(TraceDirection.FORWARD_X)]
    assert -10.0 < forward.min() < -5.0
    for missing in (TraceDirection.FORWARD_Y, TraceDirection.BACK_X):
        assert not view.layers[EDGES + DIRECTIONS.index(missing)].any()
    np.testing.assert_allclose(view.layers[HEIGHTS], -0.1 * known if with_heights else 0.0, atol=1e-7)
    assert view.origin_mm == (1.0, 2.0)


# --------------------------------------------------------------------------------------------------------- strips


@settings(deadline=None, max_examples=40)
@given(
    x=st.floats(6.0, 8.0), y=st.floats(6.0, 9.0), turned_deg=st.floats(-180.0, 180.0), height=st.floats(1.0, 3.0),
    slope=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
    origin=st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
)  # fmt: skip
def test_a_strip_of_a_straight_line_is_plain_resampling(
    x: float,
    y: float,
    turned_deg: float,
    height: float,
    slope: tuple[float, float],
    origin: tuple[float, float],
) -> None:
    view = ramp(slope, origin_mm=origin)
    start = (x + origin[0], y + origin[1])
    line = TextLine.straight(*start, length_mm=3.0, height_mm=height, turned_deg=turned_deg)
    strip = view.strip(line)
    step = height / HEIGHT_ROWS
    assert strip.shape == (LAYERS, ROWS, line.columns())
    v, u = np.mgrid[: strip.shape[1], : strip.shape[2]] + 0.5
    along, down = u * step - MARGIN * height, (v - ROWS / 2) * step
    cos, sin = np.cos(np.radians(turned_deg)), np.sin(np.radians(turned_deg))
    expected = (
        1.0
        + slope[0] * (start[0] + along * cos - down * sin)
        + slope[1] * (start[1] + along * sin + down * cos)
    )
    inside = strip[KNOWN] > 0.0
    off = PIXEL_SHARE * PITCH_MM * (abs(slope[0]) + abs(slope[1])) + 1e-5
    np.testing.assert_allclose(strip[GREY][inside], expected[inside], atol=off)
    assert inside.mean() > 0.5


def test_heights_of_a_strip_are_in_character_heights() -> None:
    layers = np.zeros((LAYERS, 100, 100), dtype=np.float32)
    layers[HEIGHTS], layers[EDGES], layers[KNOWN] = -0.2, 0.7, 1.0
    strip = view_of(layers).strip(TextLine.straight(3.0, 5.0, length_mm=4.0, height_mm=2.0))
    np.testing.assert_allclose(strip[HEIGHTS], -0.1, rtol=1e-6)
    np.testing.assert_allclose(strip[EDGES], 0.7, rtol=1e-6)


def test_a_strip_shows_rows_margin_and_zoom_as_asked() -> None:
    view, line = random_view(1), TextLine.straight(3.0, 6.0, length_mm=8.0, height_mm=2.0)
    tall = view.strip(line, rows=64, margin=0.8)
    assert tall.shape[1:] == (64, line.columns(margin=0.8))
    # the usual strip lies in the middle of the taller one
    cut = round((0.8 - MARGIN) * HEIGHT_ROWS)
    usual = view.strip(line)
    inner = tall[:, 12:-12, cut:][:, :, : usual.shape[2]]
    # margins are no whole number of columns: a fifth of one
    assert np.abs(inner[GREY] - usual[GREY]).max() < 0.25 * np.abs(np.diff(usual[GREY], axis=1)).max()
    assert view.strip(line, zoom=2.0).shape[1:] == (2 * ROWS, 2 * line.columns())


def test_a_finely_sampled_line_is_averaged_where_it_lies() -> None:
    rng = np.random.default_rng(5)
    layers = np.zeros((LAYERS, 400, 900), dtype=np.float32)
    layers[GREY, :, 300:] = 0.5
    layers[KNOWN] = 1.0
    grain = layers.copy()
    grain[GREY] += rng.normal(0.0, 0.1, size=grain.shape[1:])
    grain[KNOWN, :, :100] = 0.0
    # characters 224 pixels high: 8 to a pixel of the strip
    line = TextLine.straight(15.0, 20.0, length_mm=60.0, height_mm=22.4)
    plain, seen = view_of(layers).strip(line), view_of(grain).strip(line)
    edge = int(np.argmax(plain[GREY, 20] > 0.25))
    assert edge == pytest.approx((30.0 - 15.0) / 22.4 * HEIGHT_ROWS + MARGIN * HEIGHT_ROWS, abs=1.0)
    assert np.argmax(seen[GREY].mean(axis=0) > 0.25) == edge
    assert seen[GREY, :, edge + 4 : -20].std() < 0.04
    first = int(np.argmax(seen[KNOWN, 20]))
    assert first == pytest.approx((10.0 - 15.0) / 22.4 * HEIGHT_ROWS + MARGIN * HEIGHT_ROWS, abs=2.0)


def test_next_to_the_unknown_nothing_is_known() -> None:
    view = random_view(2)
    layers = view.layers.copy()
    layers[:, :, 60:64] = 0.0
    line = TextLine.straight(3.0, 6.0, length_mm=8.0, height_mm=2.0)
    strip = replace(view, layers=layers).strip(line)
    gone = strip[KNOWN] == 0.0
    assert 0 < gone.any(axis=0).sum() < 0.2 * strip.shape[2]
    assert not strip[:, gone].any()
    # what is left is as without the gap: nothing is blended with it
    whole = view.strip(line)
    np.testing.assert_array_equal(strip[:, ~gone], whole[:, ~gone])
    # beyond the view nothing is known either
    beyond = view.strip(TextLine.straight(10.0, 6.0, length_mm=12.0, height_mm=2.0))
    assert not beyond[KNOWN][:, -HEIGHT_ROWS:].any()


def quarter_turned(view: View, quarters: int) -> View:
    """The view of the part turned quarters against the clock: what was dragged to the right is dragged up."""
    layers = np.rot90(view.layers, quarters, axes=(1, 2)).copy()
    layers[EDGES:KNOWN] = np.roll(layers[EDGES:KNOWN], -quarters, axis=0)
    return replace(view, layers=layers)


def quarter_turned_line(line: TextLine, view: View, quarters: int) -> TextLine:
    points = line.centre_mm
    width, height = view.size_mm
    for _ in range(quarters):
        points = np.stack([points[:, 1], width - points[:, 0]], axis=1)
        width, height = height, width
    return TextLine(points, line.height_mm)


@pytest.mark.parametrize("quarters", [1, 2, 3])
@pytest.mark.parametrize("turned_deg", [0.0, 11.0, -30.0])
def test_a_strip_does_not_know_how_the_part_lay(quarters: int, turned_deg: float) -> None:
    view = random_view(3)
    line = TextLine.straight(4.0, 6.0, length_mm=6.0, height_mm=1.5, turned_deg=turned_deg)
    there = quarter_turned(view, quarters).strip(quarter_turned_line(line, view, quarters))
    steepest = max(np.abs(np.diff(view.layers, axis=axis)).max() for axis in (1, 2))
    np.testing.assert_allclose(there, view.strip(line), atol=2 * PIXEL_SHARE * steepest + 1e-6)


@pytest.mark.parametrize(("turned_deg", "quarters"), [(0.0, 0), (90.0, 1), (180.0, 2), (-90.0, 3), (40.0, 0)])
@pytest.mark.parametrize("direction", range(4))
def test_edges_go_with_the_line(direction: int, turned_deg: float, quarters: int) -> None:
    """Dragged down along a line that runs down is dragged along it; askew, each direction has its share."""
    layers = np.zeros((LAYERS, 100, 100), dtype=np.float32)
    layers[EDGES + direction], layers[KNOWN] = 0.5, 1.0
    line = TextLine.straight(5.0, 5.0, length_mm=2.0, height_mm=1.0, turned_deg=turned_deg)
    strip = view_of(layers).strip(line)
    middle = strip[EDGES:KNOWN, ROWS // 2, strip.shape[2] // 2]
    rest = np.radians(turned_deg - 90.0 * quarters if turned_deg > 0.0 else 0.0)
    expected = np.zeros(4)
    expected[(direction - quarters) % 4] = 0.5 * np.cos(rest)
    expected[(direction - quarters - 1) % 4] += 0.5 * np.sin(rest)
    np.testing.assert_allclose(middle, expected, atol=1e-6)


# ---------------------------------------------------------------------------------------------------------- resample

WARP_SHARE = 1.0 / 32.0
"""Of a pixel: places are known to a 32nd to cv2.warpAffine."""


def bright_ramp() -> View:
    layers = np.zeros((LAYERS, 60, 90), dtype=np.float32)
    y, x = np.mgrid[:60, :90] * PITCH_MM
    layers[GREY], layers[KNOWN] = 0.2 + 0.03 * x - 0.02 * y, 1.0
    return View(ViewKind.PHOTO, layers, PITCH_MM)


@pytest.mark.parametrize("pitch_mm", [0.04, 0.1, 0.17, 0.5])
def test_an_even_slope_stays_where_it_was(pitch_mm: float) -> None:
    view = bright_ramp()
    made = resample(view, pitch_mm)
    rows, columns = made.shape[1:]
    assert (rows - 1) * pitch_mm <= view.size_mm[1] + 1e-9 < rows * pitch_mm + 1e-9
    assert (columns - 1) * pitch_mm <= view.size_mm[0] + 1e-9 < columns * pitch_mm + 1e-9
    y, x = np.mgrid[:rows, :columns] * pitch_mm
    expected = 0.2 + 0.03 * x - 0.02 * y
    # beside the rim the blur, of 0.4 of a new pixel, sees only one side
    inner = (slice(2, -2), slice(2, -2))
    off = 0.05 * PITCH_MM * WARP_SHARE + 2e-4
    np.testing.assert_allclose(made[GREY][inner], expected[inner], atol=off)
    assert made[KNOWN].all()


def test_averages_leave_out_what_is_not_known() -> None:
    view = bright_ramp()
    layers = view.layers.copy()
    layers[:, :, 40:50] = 0.0
    made = resample(View(ViewKind.PHOTO, layers, PITCH_MM), 0.3)
    known = made[KNOWN] > 0.0
    assert set(np.unique(made[KNOWN])) == {0.0, 1.0}
    assert not made[GREY][~known].any()
    x = np.arange(made.shape[2]) * 0.3
    np.testing.assert_array_equal(known.all(axis=0), (x < 3.95) | (x > 4.95))
    # beside the gap it is no darker: a new pixel's slope, not the gap's nothing
    whole = resample(view, 0.3)
    np.testing.assert_allclose(made[GREY][known], whole[GREY][known], atol=0.03 * 0.3)


def test_a_view_smaller_than_a_few_pixels_is_still_one() -> None:
    assert resample(bright_ramp(), 5.0).shape == (LAYERS, 8, 8)


@given(turned_deg=st.floats(-180.0, 180.0), u=st.integers(20, 39), v=st.integers(20, 29))
def test_what_is_turned_lies_where_it_is_turned_back_to(turned_deg: float, u: int, v: int) -> None:
    layers = np.zeros((LAYERS, 50, 60), dtype=np.float32)
    layers[KNOWN], layers[HEIGHTS, v, u] = 1.0, 1.0
    view = View(ViewKind.HEIGHTS, layers, 0.5, (3.0, -2.0))
    made = turn_view(view, turned_deg)
    heights = made.layers[HEIGHTS]
    at = np.argwhere(heights > 0.0)
    middle = (heights[heights > 0.0][:, None] * at).sum(axis=0) / heights.sum()
    there_mm = np.array(made.origin_mm) + 0.5 * middle[::-1]
    # bilinear weights keep the middle of a spot to a share of a pixel
    off_mm = turn_back(there_mm[None], view, turned_deg)[0] - (3.0 + 0.5 * u, -2.0 + 0.5 * v)
    assert np.abs(off_mm).max() < 0.25


def test_beyond_a_turned_picture_nothing_is_known_and_it_is_as_bright() -> None:
    layers = np.zeros((LAYERS, 50, 60), dtype=np.float32)
    layers[KNOWN], layers[GREY] = 1.0, 0.4
    made = turn_view(View(ViewKind.PHOTO, layers, 1.0), 30.0)
    assert not made.layers[KNOWN, 0, 0]
    assert made.layers[KNOWN].sum() == pytest.approx(50 * 60, rel=0.1)  # less its rim
    np.testing.assert_allclose(made.layers[GREY], 0.4, atol=1e-6)
