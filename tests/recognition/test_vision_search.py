"""Templates for sight on pictures shaded by a formula of their own."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.fonts.glyph import Font
from glyphs.fonts.serials import allowed_characters
from glyphs.stamping.stamp import StampedPart
from recognition.vision_fit import Supposed, VisionFit
from recognition.vision_frame import rectify
from recognition.vision_search import VisionSearch, lights
from recognition.vision_templates import CLOSE_LOOK, GLANCE, VisionBasis, predict_basis

TEXT, FORMAT, CHARS = "K7B29", "A9A99", "ABEFHKPRT0123456789"
HEIGHT_MM = 5.0
NOISE = 3.0


def shaded(part: StampedPart, azimuth_deg: float, *, filled: float = 0.0, seed: int = 0) -> NDArray[np.uint8]:
    """Lambert's law for a lamp 45 degrees high; strokes darker by `filled`; a slope of light and noise."""
    z = part.height_map.z_mm.astype(np.float64)
    gy, gx = np.gradient(z, part.height_map.pitch_mm)
    a = math.radians(azimuth_deg)
    # the normal of a surface z(x, y) is (-gx, -gy, 1)
    light = (1.0 - gx * math.cos(a) - gy * math.sin(a)) / np.sqrt(1.0 + gx**2 + gy**2)
    value = 110.0 * np.clip(light, 0.05, None) * (1.0 + filled * z / abs(z.min()))
    value *= np.linspace(0.8, 1.2, z.shape[1])
    noise = np.random.default_rng(seed).normal(0.0, NOISE, z.shape)
    return np.rint(np.clip(value + noise, 0, 255)).astype(np.uint8)


@pytest.fixture(scope="module")
def basis(gothic: Font) -> VisionBasis:
    return predict_basis(gothic, CHARS, look=GLANCE)


def read(basis: VisionBasis, photo: Photo, *, height_mm: float = HEIGHT_MM, turn: float = 0.0) -> VisionFit:
    search = VisionSearch(photo, places=allowed_characters(FORMAT))
    fit = search.fit(basis, Supposed(height_mm, turn))
    assert fit is not None
    return search.refined(fit)


def photo_of(part: StampedPart, azimuth_deg: float, **options: float) -> Photo:
    return Photo(shaded(part, azimuth_deg, **options), pitch_mm=part.height_map.pitch_mm)


@pytest.mark.parametrize("azimuth", [0, 45, 90, 135, 180, 225, 270, 315])
def test_any_light_will_do(azimuth: int, basis: VisionBasis, make_part: Callable[..., StampedPart]) -> None:
    part = make_part(TEXT)
    fit = read(basis, photo_of(part, azimuth))
    assert fit.text == TEXT
    # log brightness falls with the slope towards the lamp: the weights point away from it
    a = math.radians(azimuth)
    along = -(fit.light[0] * math.cos(a) + fit.light[1] * math.sin(a))
    assert along / math.hypot(fit.light[0], fit.light[1]) > 0.9
    for k, (x0, y0, x1, y1) in enumerate(part.boxes_mm):
        place = fit.character(k)
        # a tenth of the height: blows land off the line by a few hundredths
        assert place.middle_mm[0] == pytest.approx(0.5 * (x0 + x1), abs=0.1 * HEIGHT_MM)
        assert place.middle_mm[1] == pytest.approx(0.5 * (y0 + y1), abs=0.1 * HEIGHT_MM)


@pytest.mark.parametrize("filled", [0.6, -0.6])
def test_filled_strokes_are_seen_in_flat_light(
    filled: float, basis: VisionBasis, make_part: Callable[..., StampedPart]
) -> None:
    part = make_part(TEXT)
    z = part.height_map.z_mm.astype(np.float64)
    grey = 120.0 * (1.0 + filled * z / abs(z.min()))
    noise = np.random.default_rng(3).normal(0.0, NOISE, z.shape)
    photo = Photo(np.rint(np.clip(grey + noise, 0, 255)).astype(np.uint8), pitch_mm=part.height_map.pitch_mm)
    fit = read(basis, photo)
    assert fit.text == TEXT
    # a filled groove is darker where z is lower: the weight of h has the sign of the filling
    assert math.copysign(1.0, fit.light[2]) == math.copysign(1.0, filled)
    assert abs(fit.light[2]) > 3.0 * math.hypot(fit.light[0], fit.light[1])


@pytest.mark.parametrize("rotation", [-10.0, -5.0, 5.0, 10.0])
def test_a_rotated_line(rotation: float, basis: VisionBasis, make_part: Callable[..., StampedPart]) -> None:
    part = make_part(TEXT, line_rotation_deg=rotation)
    fit = read(basis, photo_of(part, 60.0), turn=rotation + 0.8)
    assert fit.text == TEXT
    assert fit.supposed.rotation_deg == pytest.approx(rotation, abs=1.0)


def test_beyond_the_photograph_nothing_is_seen(basis: VisionBasis) -> None:
    # a slope of light goes on beyond the rim in streaks; none of them may count
    rows, cols = 200, 500
    grey = 100.0 + 0.1 * np.arange(cols)[None, :] + np.random.default_rng(6).normal(0.0, NOISE, (rows, cols))
    search = VisionSearch(Photo(np.rint(grey).astype(np.uint8), pitch_mm=0.06), places=None)
    edges = search.edges(Supposed(HEIGHT_MM, 10.0), GLANCE)
    corner = edges[:, :20, :20]
    assert (corner == 0.0).all()
    assert (edges[:, edges.shape[1] // 2, 40:-40] != 0.0).any()


def test_the_perspective_of_a_tilted_part(basis: VisionBasis, make_part: Callable[..., StampedPart]) -> None:
    part = make_part(TEXT)
    pixels = shaded(part, 200.0)
    rows, cols = pixels.shape
    # a part tilted so that its right end is 6 % smaller
    lean = 0.03 * rows
    seen = rectify(
        Photo(pixels), [(0, -lean), (cols, lean), (cols, rows - lean), (0, rows + lean)], shape=(rows, cols)
    )
    fit = read(basis, Photo(seen.pixels, pitch_mm=part.height_map.pitch_mm))
    assert fit.text == TEXT


def test_the_close_look_agrees_and_is_surer(gothic: Font, make_part: Callable[..., StampedPart]) -> None:
    part = make_part(TEXT)
    close = predict_basis(gothic, CHARS, look=CLOSE_LOOK)
    fit = read(close, photo_of(part, 120.0))
    assert fit.text == TEXT
    assert np.exp(fit.settled.log_belief.max(axis=1)).min() > 0.95
    assert fit.trust.min() > 0.95


def test_the_number_of_characters_is_found(basis: VisionBasis, make_part: Callable[..., StampedPart]) -> None:
    search = VisionSearch(photo_of(make_part(TEXT), 30.0), places=None)
    fit = search.fit(basis, Supposed(HEIGHT_MM))
    assert fit is not None
    assert fit.text == TEXT


def test_land_alone_explains_nothing(basis: VisionBasis, make_part: Callable[..., StampedPart]) -> None:
    line = read(basis, photo_of(make_part(TEXT), 30.0))
    grey = np.random.default_rng(4).normal(120.0, NOISE, (120, 400)).clip(0, 255).astype(np.uint8)
    pitch = make_part(TEXT).height_map.pitch_mm
    land = VisionSearch(Photo(grey, pitch_mm=pitch), places=allowed_characters(FORMAT)).fit(
        basis, Supposed(HEIGHT_MM)
    )
    assert land is None or land.value < 0.2 * line.value


def test_templates_of_one_light_are_the_weighted_sum(basis: VisionBasis) -> None:
    weights = np.array([0.5, -0.2, 0.1])
    made = basis.templates(weights)
    expected = sum(w * basis.patches[:, b] for b, w in enumerate(weights))
    np.testing.assert_allclose(made.patches, expected, atol=1e-5)
    assert made.chars == basis.chars
    assert len(lights()) == 10
