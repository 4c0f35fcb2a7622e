"""Height maps, and their blur."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.surface.blur import gaussian_blur, sample_bilinear
from glyphs.surface.maps import EdgeMap, HeightMap, MapError, TraceDirection

PLANE = np.zeros((3, 4), np.float32)


def test_height_map_keeps_what_it_was_given_read_only():
    source = np.arange(12.0).reshape(3, 4)
    heights = HeightMap(source, 0.5)
    source[0, 0] = 99.0
    assert heights.z_mm[0, 0] == 0.0
    assert heights.z_mm.dtype == np.float32
    assert heights.shape == (3, 4)
    assert heights.size_mm == (1.5, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        heights.z_mm[0, 0] = 1.0


def test_height_map_leaves_a_float32_source_writeable():
    source = PLANE.copy()
    heights = HeightMap(source, 0.1)
    source[0, 0] = 5.0
    assert heights.z_mm[0, 0] == 0.0


@pytest.mark.parametrize(
    ("z", "pitch_mm", "message"),
    [
        (np.zeros(5), 0.1, "rows and columns"),
        (np.zeros((1, 5)), 0.1, "rows and columns"),
        (np.full((3, 3), np.nan), 0.1, "no finite height"),
        (np.full((3, 3), np.inf), 0.1, "infinit"),
        (np.zeros((3, 3), complex), 0.1, "real numbers"),
        (np.array([["a", "b"], ["c", "d"]]), 0.1, "real numbers"),
        (PLANE, 0.0, "pitch_mm"),
        (PLANE, -1.0, "pitch_mm"),
        (PLANE, float("nan"), "pitch_mm"),
        (np.broadcast_to(np.float32(0), (9000, 9000)), 0.1, "limit"),
    ],
)
def test_height_map_refuses(z, pitch_mm, message):
    with pytest.raises(MapError, match=message):
        HeightMap(z, pitch_mm)


def edge_map(**change):
    values = {
        "enhancement": np.zeros((2, 3, 4), np.float32),
        "directions": (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y),
        "valid": np.ones((3, 4), bool),
        "pitch_mm": 0.1,
    }
    return EdgeMap(**{**values, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"directions": (0,)}, "do not agree"),
        ({"directions": (0, 0)}, "at most once"),
        ({"valid": np.ones((4, 3), bool)}, "do not agree"),
        ({"enhancement": np.full((2, 3, 4), np.nan)}, "finite"),
        ({"pitch_mm": 0.0}, "pitch_mm"),
    ],
)
def test_edge_map_refuses(change, message):
    with pytest.raises(MapError, match=message):
        edge_map(**change)


@pytest.mark.parametrize("shape", [(60, 90), (3, 5), (2, 40), (1, 1)])
@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.7, 3.0, 12.0])
@pytest.mark.parametrize("truncate", [3.0, 4.0])
def test_blurred_is_scipys_filter(shape: tuple[int, int], sigma: float, truncate: float) -> None:
    from scipy.ndimage import gaussian_filter

    z = np.random.default_rng(1).standard_normal(shape, dtype=np.float32)
    expected = gaussian_filter(z, sigma, mode="nearest", truncate=truncate)
    np.testing.assert_array_equal(gaussian_blur(z, sigma, truncate=truncate), expected)
    wide = np.repeat(z[:, :, None], 2, axis=2)[:, :, 1]  # not contiguous
    np.testing.assert_array_equal(gaussian_blur(wide, sigma, truncate=truncate), expected)


def test_sampled_is_scipys_interpolation_inside_and_beyond() -> None:
    from scipy.ndimage import map_coordinates

    rng = np.random.default_rng(2)
    z = rng.standard_normal((40, 70), dtype=np.float32)
    row, col = rng.uniform(-5.0, 45.0, (30, 50)), rng.uniform(-5.0, 75.0, (30, 50))
    row[0], col[1], row[2], col[3] = 7.0, 11.0, 39.0, 69.0  # on samples and on the last ones
    expected = map_coordinates(
        z, np.stack([row, col]), output=np.float32, order=1, mode="mirror", prefilter=False
    )
    np.testing.assert_array_equal(sample_bilinear(z, row, col), expected)
