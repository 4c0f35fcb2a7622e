"""The camera's edge map against brightness of known slope."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.surface.maps import MapError, TraceDirection
from recognition.vision_edges import DARK, SCALE_HEIGHTS, log_brightness, vision_edges

HEIGHT_MM, PITCH_MM = 5.0, 0.05
RATE_MM = 0.08
"""Growth of ln(brightness + DARK) a mm."""


def ramp(*, along_x: bool, rate: float = RATE_MM) -> Photo:
    at = (np.arange(200) - 100) * PITCH_MM
    value = (0.5 + DARK) * np.exp(rate * at) - DARK
    grey = np.rint(255.0 * value).clip(0, 255).astype(np.uint8)
    image = np.broadcast_to(grey[None, :] if along_x else grey[:, None], (200, 200))
    return Photo(np.ascontiguousarray(image), pitch_mm=PITCH_MM, centre_mm=(0.0, 0.0))


@pytest.mark.parametrize("along_x", [True, False])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ramp_rises_by_what_it_should(along_x: bool, sign: float) -> None:
    edges = vision_edges(ramp(along_x=along_x, rate=sign * RATE_MM), height_mm=HEIGHT_MM, even=False)
    assert edges.directions == (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y)
    inner = edges.enhancement[:, 60:140, 60:140]
    along, across = (0, 1) if along_x else (1, 0)
    expected = sign * RATE_MM * SCALE_HEIGHTS * HEIGHT_MM
    # 8 bit steps of 1/255 over a slope of 0.5 grey levels a pixel: the mean over 80 pixels is good to 2 %
    assert inner[along].mean() == pytest.approx(expected, rel=0.02)
    assert abs(inner[across]).max() < 1e-6


def test_the_unsigned_map_is_the_size_of_the_signed_one() -> None:
    photo = Photo(np.random.default_rng(0).integers(60, 200, (80, 120), dtype=np.uint8), pitch_mm=PITCH_MM)
    signed = vision_edges(photo, height_mm=HEIGHT_MM)
    unsigned = vision_edges(photo, height_mm=HEIGHT_MM, signed=False)
    np.testing.assert_array_equal(unsigned.enhancement, np.abs(signed.enhancement))


def test_exposure_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    scene = rng.uniform(0.3, 0.6, (80, 120))
    bright = Photo(np.rint(255.0 * scene * 1.5).astype(np.uint8), pitch_mm=PITCH_MM)
    dim = Photo(np.rint(255.0 * scene).astype(np.uint8), pitch_mm=PITCH_MM)
    a = vision_edges(bright, height_mm=HEIGHT_MM).enhancement.ravel()
    b = vision_edges(dim, height_mm=HEIGHT_MM).enhancement.ravel()
    # they differ by rounding and by the dark floor alone
    assert np.corrcoef(a, b)[0, 1] > 0.99


@pytest.mark.parametrize("along_x", [True, False])
def test_the_slope_of_the_light_is_taken_off(along_x: bool) -> None:
    tilted = ramp(along_x=along_x)
    noise = np.random.default_rng(2).normal(0.0, 4.0, tilted.shape)
    photo = Photo(np.rint(np.clip(tilted.pixels + noise, 0, 255)).astype(np.uint8), pitch_mm=PITCH_MM)
    raw = vision_edges(photo, height_mm=HEIGHT_MM, even=False).enhancement[:, 60:140, 60:140]
    even = vision_edges(photo, height_mm=HEIGHT_MM).enhancement[:, 60:140, 60:140]

    def lean(layers: np.ndarray) -> float:
        return float((abs(layers.mean(axis=(1, 2))) / layers.std(axis=(1, 2))).max())

    # the map is two characters wide: its rims hold the slope back a little
    assert lean(even) < 0.25 * lean(raw)


def test_glare_is_not_valid_and_tells_nothing() -> None:
    pixels = np.full((100, 100, 3), 90, dtype=np.uint8)
    pixels[40:60, 30:50] = 255
    edges = vision_edges(Photo(pixels, pitch_mm=PITCH_MM), height_mm=HEIGHT_MM)
    assert not edges.valid[38:62, 28:52].any()
    assert edges.valid[:30].all()
    assert (edges.enhancement[:, ~edges.valid] == 0.0).all()


def test_without_a_pitch_a_pixel_counts_as_one_mm() -> None:
    edges = vision_edges(Photo(np.full((90, 90), 100, dtype=np.uint8)), height_mm=60.0)
    assert edges.pitch_mm == 1.0
    assert edges.origin_mm == (0.0, 0.0)
    with pytest.raises(MapError, match="less than 8 pixels"):
        vision_edges(Photo(np.full((90, 90), 100, dtype=np.uint8)), height_mm=5.0)


def test_colours_of_equal_brightness_are_told_apart_by_contrast() -> None:
    pixels = np.full((60, 60, 3), (60, 120, 90), dtype=np.uint8)
    pixels[20:40, 28:32] = (120, 60, 90)
    photo = Photo(pixels)
    plain = np.ptp(log_brightness(photo))
    assert np.ptp(log_brightness(photo, contrast=True)) > 5.0 * plain
