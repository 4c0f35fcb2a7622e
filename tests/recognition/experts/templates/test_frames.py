"""Channels keep what was felt; the line frame turns, averages and pads it where it says."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage

from glyphs.surface.maps import EdgeMap, TraceDirection
from recognition.experts.templates.frames import (
    LineImage,
    channels,
    is_edge_channel,
    line_image,
    padded,
    resampled,
    turned,
)
from whisker_array.whisker.array import ALL_DIRECTIONS

FX, FY, BX, BY = ALL_DIRECTIONS
SUBSETS = [c for n in (1, 2, 3, 4) for c in combinations(ALL_DIRECTIONS, n)]
FLOAT32 = 1e-5
"""Relative, and absolute for values of about 1: a few roundings of float32."""

layer_values = st.floats(-2.0, 2.0, width=32)


def stacks(n: int) -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(np.float32, (n, 3, 4), elements=layer_values)


def image_of(values: np.ndarray, *, pitch: tuple[float, float] = (0.1, 0.1)) -> LineImage:
    layers = np.atleast_3d(values.astype(np.float32)).reshape(-1, *values.shape[-2:])
    return LineImage(layers, *pitch, (-1.0, -0.5), 0.0, (2.0, 1.0))


@given(stacks(4))
def test_channels_of_four_layers_keep_the_sum_of_squares(layers: np.ndarray) -> None:
    felt = dict(zip(ALL_DIRECTIONS, layers.astype(np.float64), strict=True))
    made = channels(layers, ALL_DIRECTIONS).astype(np.float64)
    assert made.shape == (3, 3, 4)
    # all but what the two pairs say differently of the one profile
    quarrel = 0.5 * (felt[FX] + felt[BX]) - 0.5 * (felt[FY] + felt[BY])
    np.testing.assert_allclose(
        (made**2).sum(axis=0) + quarrel**2, (layers.astype(np.float64) ** 2).sum(axis=0), atol=16 * FLOAT32
    )


@given(stacks(2), st.sampled_from([(FX, BX), (BX, FX), (FY, BY)]))
def test_one_pair_keeps_the_sum_of_squares(
    layers: np.ndarray, directions: tuple[TraceDirection, ...]
) -> None:
    made = channels(layers, directions).astype(np.float64)
    np.testing.assert_allclose(
        (made**2).sum(axis=0), (layers.astype(np.float64) ** 2).sum(axis=0), atol=8 * FLOAT32
    )


def test_profile_and_edges_part_company() -> None:
    profile, edge_x, edge_y = np.random.default_rng(0).normal(size=(3, 5, 6)).astype(np.float32)
    layers = np.stack([profile + edge_x, profile + edge_y, profile - edge_x, profile - edge_y])
    made = channels(layers, ALL_DIRECTIONS)
    np.testing.assert_allclose(made[0], 2.0 * profile, atol=10 * FLOAT32)
    np.testing.assert_allclose(made[1], math.sqrt(2.0) * edge_x, atol=10 * FLOAT32)
    np.testing.assert_allclose(made[2], math.sqrt(2.0) * edge_y, atol=10 * FLOAT32)
    assert is_edge_channel(ALL_DIRECTIONS).tolist() == [False, True, True]


@pytest.mark.parametrize("directions", [(FX,), (BY,), (FX, FY), (BX, FY), (FX, BY)])
def test_single_directions_stand_for_themselves(directions: tuple[TraceDirection, ...]) -> None:
    layers = np.random.default_rng(1).normal(size=(len(directions), 3, 4)).astype(np.float32)
    assert np.array_equal(channels(layers, directions), layers)
    # nothing answers edges alone: then all is activity
    assert is_edge_channel(directions).all()


@pytest.mark.parametrize("directions", SUBSETS)
def test_every_channel_knows_whether_it_is_an_edge(directions: tuple[TraceDirection, ...]) -> None:
    # a pure profile is felt alike both ways: it must vanish in an edge channel, and there only
    made = channels(np.ones((len(directions), 2, 2), dtype=np.float32), directions)
    silent = np.abs(made).max(axis=(1, 2)) < FLOAT32
    keep = is_edge_channel(directions)
    assert keep.shape == (made.shape[0],)
    assert keep.any()
    if silent.any():
        assert keep.tolist() == silent.tolist()


@pytest.mark.parametrize("order", [(BY, FX, FY, BX), (BX, BY, FX, FY)])
def test_channels_do_not_depend_on_the_order_of_sweeps(order: tuple[TraceDirection, ...]) -> None:
    layers = dict(zip(ALL_DIRECTIONS, np.random.default_rng(2).normal(size=(4, 3, 3)), strict=True))
    expected = channels(np.stack(list(layers.values())).astype(np.float32), ALL_DIRECTIONS)
    got = channels(np.stack([layers[d] for d in order]).astype(np.float32), order)
    np.testing.assert_allclose(got, expected, atol=FLOAT32 * 10)


def test_channels_along_another_axis_are_the_same() -> None:
    layers = np.random.default_rng(3).normal(size=(2, 4, 3, 5)).astype(np.float32)
    both = channels(layers, ALL_DIRECTIONS, axis=1)
    for i in range(2):
        np.testing.assert_allclose(both[i], channels(layers[i], ALL_DIRECTIONS), atol=FLOAT32)


def blob_map(x_mm: float, y_mm: float) -> EdgeMap:
    """A smooth blob, ten pixels wide, at a plate position."""
    pitch, origin = 0.1, (3.0, -2.0)
    x = origin[0] + pitch * np.arange(120)
    y = origin[1] + pitch * np.arange(80)
    blob = np.exp(-((x[None, :] - x_mm) ** 2 + (y[:, None] - y_mm) ** 2) / (2 * 0.5**2))
    return EdgeMap(blob[None].astype(np.float32), (FX,), np.ones(blob.shape, dtype=bool), pitch, origin)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(-30.0, 30.0),
    st.floats(6.0, 12.0),
    st.floats(-0.5, 4.0),
)
def test_a_blob_appears_where_the_line_frame_says(angle: float, x: float, y: float) -> None:
    image = line_image(blob_map(x, y), rotation_deg=angle)
    weight = image.channels[0].astype(np.float64)
    rows, cols = np.indices(weight.shape)
    u = image.origin_mm[0] + image.pitch_u_mm * (weight * cols).sum() / weight.sum()
    v = image.origin_mm[1] + image.pitch_v_mm * (weight * rows).sum() / weight.sum()
    # a tenth of a pixel: bilinear interpolation of a blob that the rim hardly cuts
    assert image.plate_from_line(u, v) == pytest.approx((x, y), abs=0.01)


def test_positive_rotation_turns_from_x_towards_y() -> None:
    image = line_image(blob_map(8.0, 1.0), rotation_deg=10.0)
    ahead, here = image.plate_from_line(1.0, 0.0), image.plate_from_line(0.0, 0.0)
    assert ahead[0] - here[0] == pytest.approx(math.cos(math.radians(10.0)))
    assert ahead[1] - here[1] == pytest.approx(math.sin(math.radians(10.0)))


def test_an_unturned_image_is_the_map() -> None:
    edges = blob_map(8.0, 1.0)
    image = line_image(edges, rotation_deg=0.0)
    assert np.array_equal(image.channels, edges.enhancement)
    assert image.plate_from_line(*image.origin_mm) == pytest.approx(edges.origin_mm)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.04, 0.5), st.floats(0.04, 0.5), st.floats(-3.0, 3.0))
def test_resampling_keeps_a_constant(pitch_u: float, pitch_v: float, value: float) -> None:
    image = image_of(np.full((20, 30), value))
    out = resampled(image, pitch_u_mm=pitch_u, pitch_v_mm=pitch_v)
    assert (out.pitch_u_mm, out.pitch_v_mm) == (pitch_u, pitch_v)
    np.testing.assert_allclose(out.channels, np.float32(value), atol=3 * FLOAT32)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.05, 0.3), st.floats(0.05, 0.3))
def test_resampling_keeps_a_ramp_inside(pitch_u: float, pitch_v: float) -> None:
    pitch = 0.1

    def ramp(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return 0.5 + 0.3 * u[None, :] - 0.2 * v[:, None]

    image = image_of(ramp(np.arange(40) * pitch, np.arange(30) * pitch))
    out = resampled(image, pitch_u_mm=pitch_u, pitch_v_mm=pitch_v)
    u, v = np.arange(out.channels.shape[2]) * pitch_u, np.arange(out.channels.shape[1]) * pitch_v
    assert u[-1] <= 39 * pitch + 1e-6
    assert v[-1] <= 29 * pitch + 1e-6
    reach_u, reach_v = max(pitch, pitch_u), max(pitch, pitch_v)
    inside = np.ix_((v > reach_v) & (v < 2.9 - reach_v), (u > reach_u) & (u < 3.9 - reach_u))
    # a triangle whose width is no whole number of samples is lopsided, by 0.086 of a sample at worst (scanned
    # over widths and offsets); times the slopes, which add up
    np.testing.assert_allclose(out.channels[0][inside], ramp(u, v)[inside], atol=0.09 * pitch * (0.3 + 0.2))


def test_resampling_onto_its_own_grid_changes_nothing() -> None:
    values = np.random.default_rng(4).normal(size=(2, 12, 15))
    image = image_of(values)
    same = resampled(image, pitch_u_mm=0.1, pitch_v_mm=0.1)
    np.testing.assert_allclose(same.channels, image.channels, atol=10 * FLOAT32)
    assert same.origin_mm == image.origin_mm


def test_padding_is_land_and_moves_the_origin() -> None:
    image = image_of(np.ones((2, 4, 5)), pitch=(0.2, 0.1))
    wide = padded(image, 3)
    assert wide.channels.shape == (2, 10, 11)
    assert wide.origin_mm == pytest.approx((-1.0 - 0.6, -0.5 - 0.3))
    assert wide.channels.sum() == image.channels.sum()
    assert np.array_equal(wide.channels[:, 3:-3, 3:-3], image.channels)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.03, 0.5), st.floats(0.03, 0.5), st.integers(0, 2**32 - 1))
def test_resampling_is_a_product_with_triangles(pitch_u: float, pitch_v: float, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(2, 12, 17))
    image = image_of(values)
    out = resampled(image, pitch_u_mm=pitch_u, pitch_v_mm=pitch_v)

    def weights(n: int, n_out: int, pitch: float) -> np.ndarray:
        apart = np.abs(np.arange(n_out)[:, None] * pitch - np.arange(n)[None, :] * 0.1)
        made = np.clip(1.0 - apart / (max(pitch, 0.1) * (1.0 + 1e-6)), 0.0, None)
        return made / made.sum(axis=1, keepdims=True)

    n_v, n_u = out.channels.shape[1:]
    down, along = weights(12, n_v, pitch_v), weights(17, n_u, pitch_u)
    np.testing.assert_allclose(out.channels, down @ values @ along.T, atol=1e-5)


@pytest.mark.parametrize("angle", [-9.0, 0.7, 4.0, 90.0])
def test_turning_is_bilinear_about_the_middle(angle: float) -> None:
    rng = np.random.default_rng(1)
    upright = image_of(ndimage.gaussian_filter(rng.normal(size=(2, 21, 34)), (0, 1, 1)))
    out = turned(upright, rotation_deg=angle)
    rows, cols = out.channels.shape[1:]
    v, u = np.meshgrid(np.arange(rows) - 0.5 * (rows - 1), np.arange(cols) - 0.5 * (cols - 1), indexing="ij")
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    at = [10.0 + cos * v + sin * u, 16.5 - sin * v + cos * u]
    expected = np.stack([ndimage.map_coordinates(layer, at, order=1) for layer in upright.channels])
    # on the rim itself rounding decides
    rim = np.minimum.reduce([np.abs(at[0]), np.abs(at[0] - 20), np.abs(at[1]), np.abs(at[1] - 33)]) < 1e-6
    np.testing.assert_allclose(out.channels[:, ~rim], expected[:, ~rim], atol=1e-5)
