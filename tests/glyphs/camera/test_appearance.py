"""Light on a surface, and the camera above it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from glyphs.camera.appearance import photograph
from glyphs.camera.pose import Camera, apply_homography
from glyphs.camera.shading import Light, lit_share, openness, radiance
from glyphs.soiling.coat import Look
from glyphs.soiling.soil import Soil
from glyphs.soiling.soiled import SoiledPart
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap, MapError

LAMP = Light(azimuth_deg=0.0, elevation_deg=40.0, ambient=0.0, shadows=False)
STILL = Camera(pitch_mm=0.1, defocus_mm=0.0, noise=0.0, dark_noise=0.0, vignetting=0.0, bloom=0.0)


def _matt(shape: tuple[int, int], albedo: float = 0.5) -> Look:
    """No mirror at all."""
    ones = np.ones(shape, dtype=np.float32)
    return Look(albedo * np.ones((*shape, 3)), 0.5 * ones, 0.0 * ones)


def _plane(slope_x: float, slope_y: float) -> HeightMap:
    y, x = np.mgrid[:24, :24] * 0.1
    return HeightMap((slope_x * x + slope_y * y).astype(np.float32), 0.1)


def _scene(z: np.ndarray, look: Look) -> SoiledPart:
    height_map = HeightMap(z.astype(np.float32), 0.1)
    part = StampedPart(height_map, "", 5.0, (), "none")
    return SoiledPart(part, height_map, Soil(np.zeros(z.shape), np.float32(1.0), np.float32(0.2)), look)


@pytest.mark.parametrize("slope_x", [-0.5, -0.1, 0.0, 0.3])
@pytest.mark.parametrize("slope_y", [-0.4, 0.0, 0.2])
def test_a_matt_plane_is_as_bright_as_lambert_says(slope_x: float, slope_y: float) -> None:
    for azimuth in (0.0, 90.0, 200.0):
        light = Light(azimuth_deg=azimuth, elevation_deg=40.0, ambient=0.0, shadows=False)
        seen = radiance(_plane(slope_x, slope_y), _matt((24, 24)), light)
        az, el = math.radians(azimuth), math.radians(40.0)
        facing = -slope_x * math.cos(el) * math.cos(az) - slope_y * math.cos(el) * math.sin(az) + math.sin(el)
        cosine = max(0.0, facing / math.sqrt(1.0 + slope_x**2 + slope_y**2))
        # float32 gradients of a plane: relative errors of some 1e-5
        np.testing.assert_allclose(seen, 0.5 * cosine / math.sin(el), rtol=1e-4, atol=1e-5)


def test_a_glint_is_brightest_where_the_mirror_stands_right() -> None:
    ones = np.ones((24, 24), dtype=np.float32)
    steel = Look(np.zeros((24, 24, 3)), 0.1 * ones, 0.6 * ones)
    # light from +x at 40 degrees is mirrored upwards by a plane whose normal leans 25 degrees towards it
    slopes = np.tan(np.radians(np.arange(-40.0, 41.0, 5.0)))
    light = Light(azimuth_deg=0.0, elevation_deg=40.0, ambient=0.0, size_deg=2.0, shadows=False)
    seen = [float(radiance(_plane(-s, 0.0), steel, light)[12, 12, 0]) for s in slopes]
    assert np.degrees(np.arctan(slopes[int(np.argmax(seen))])) == pytest.approx(25.0, abs=1e-6)
    assert max(seen) > 50.0 * seen[0]


def test_light_is_shared_out_between_lamp_and_dome() -> None:
    for ambient in (0.0, 0.4, 1.0):
        light = Light(ambient=ambient)
        np.testing.assert_allclose(radiance(_plane(0, 0), _matt((24, 24)), light), 0.5, rtol=1e-5)


def test_a_wall_casts_its_shadow_away_from_the_lamp() -> None:
    z = np.zeros((20, 120), dtype=np.float32)
    z[:, 60:62] = 1.0
    light = Light(azimuth_deg=0.0, elevation_deg=45.0, size_deg=0.5)  # lamp at the right
    lit = lit_share(z, light, pitch_mm=0.1)
    # a wall of 1 mm under light of 45 degrees: a shadow of 1 mm, ten samples, to its left
    assert (lit[:, 52:60] < 0.5).all()
    assert (lit[:, :48] > 0.95).all()
    assert (lit[:, 62:] > 0.95).all()
    overhead = lit_share(z, Light(elevation_deg=90.0), pitch_mm=0.1)
    assert (overhead == 1.0).all()


def test_a_groove_sees_less_of_the_sky() -> None:
    z = np.zeros((40, 40), dtype=np.float32)
    z[:, 18:22] = -0.3
    sky = openness(z, pitch_mm=0.1)
    assert sky[20, 20] < 0.8 * sky[20, 5]
    np.testing.assert_allclose(sky[:, :4], 1.0, atol=1e-3)


@pytest.mark.parametrize(
    "camera",
    [
        STILL,
        Camera(**{**vars(STILL), "shift_mm": (0.7, -0.4)}),
        Camera(**{**vars(STILL), "rotation_deg": 5.0}),
        Camera(
            **{
                **vars(STILL),
                "perspective_per_mm": (0.004, -0.003),
                "shift_mm": (0.3, 0.1),
                "rotation_deg": -3.0,
            }
        ),
    ],
)
def test_a_known_corner_is_where_the_homography_says(camera: Camera) -> None:
    # a matt plate, white in one quadrant: its corner at sample (row 60, column 80)
    look = _matt((121, 161), 0.1)
    albedo = look.albedo.copy()
    albedo[60:, 80:] = 0.9
    scene = _scene(np.zeros((121, 161)), Look(albedo, look.roughness, look.reflectance))
    photo = photograph(scene, Light(elevation_deg=90.0, ambient=0.0), camera, rng=np.random.default_rng(0))
    back = np.linalg.inv(camera.to_plate(scene.height_map))
    col, row = (
        float(v) for v in apply_homography(back, 7.95, 5.95)
    )  # the edge lies half a sample before the white
    grey = photo.grey() / photo.grey().max()
    c, r = round(col), round(row)
    # three pixels from the corner, along either edge and across, all is either white or dark
    turn = math.radians(camera.rotation_deg)
    for u, v, white in ((4, 4, True), (-4, 4, False), (4, -4, False), (-4, -4, False)):
        x, y = u * math.cos(turn) - v * math.sin(turn), u * math.sin(turn) + v * math.cos(turn)
        assert (grey[round(r + y), round(c + x)] > 0.8) == white
    assert photo.centre_mm == (8.0, 6.0)
    assert photo.pitch_mm == 0.1


def test_a_still_camera_has_a_pixel_a_sample_and_no_noise() -> None:
    rng = np.random.default_rng(0)
    ones = np.ones((30, 40), dtype=np.float32)
    albedo = np.repeat(rng.uniform(0.2, 0.6, (30, 40, 1)), 3, axis=2)
    scene = _scene(np.zeros((30, 40)), Look(albedo, 0.5 * ones, 0.0 * ones))
    light = Light(elevation_deg=90.0, ambient=0.0)
    photo, again = (photograph(scene, light, STILL, rng=np.random.default_rng(s)) for s in (1, 2))
    np.testing.assert_array_equal(photo.pixels, again.pixels)
    linear = (photo.pixels[..., 1] / 255.0) ** 2.2
    # the pixel's own width blurs a little; what is left is nearly all of the pattern
    assert np.corrcoef(linear.ravel(), albedo[..., 0].ravel())[0, 1] > 0.97


def test_noise_is_what_it_says() -> None:
    scene = _scene(np.zeros((80, 80)), _matt((80, 80)))
    camera = Camera(**{**vars(STILL), "noise": 0.03, "dark_noise": 0.01})
    photo = photograph(scene, LAMP, camera, rng=np.random.default_rng(3))
    linear = (photo.pixels / 255.0) ** 2.2
    assert linear.mean() == pytest.approx(0.2, abs=0.005)  # medium grey
    expected = math.sqrt(0.03**2 * 0.2 + 0.01**2)
    # 19,200 values: 0.5 % standard error; rounding to 8 bit adds 3 %
    assert linear.std() == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Light(elevation_deg=0.0),
        lambda: Light(ambient=1.5),
        lambda: Light(size_deg=0.0),
        lambda: Light(azimuth_deg=float("nan")),
        lambda: Camera(pitch_mm=0.0),
        lambda: Camera(noise=-0.1),
        lambda: Camera(perspective_per_mm=(0.1, 0.0)),
        lambda: Camera(vignetting=2.0),
        lambda: Camera(shift_mm=(float("inf"), 0.0)),
        lambda: radiance(_plane(0, 0), _matt((3, 3)), LAMP),
        lambda: radiance(HeightMap(np.array([[0.0, np.nan], [0.0, 0.0]]), 1.0), _matt((2, 2)), LAMP),
        lambda: Look(np.ones((4, 4, 3)), np.zeros((4, 4)), np.zeros((4, 4))),
        lambda: Look(np.ones((4, 4, 3)), np.ones((4, 5)), np.zeros((4, 4))),
    ],
)
def test_what_cannot_be_is_refused(wrong) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(MapError, match=r"\S"):
        wrong()
