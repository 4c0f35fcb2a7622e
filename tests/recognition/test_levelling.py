"""A part mounted level, and the first look at it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glyphs.stamping.plate import plate_form, plate_texture
from glyphs.stamping.stamp import PlateVariation, StampedPart
from glyphs.surface.maps import HeightMap
from recognition.levelling import first_look, level, relief_mm

Make = Callable[..., StampedPart]


def form(shape: tuple[int, int], pitch_mm: float, *, tilt_deg: float, dome_mm: float) -> np.ndarray:
    rows, cols = shape
    y, x = np.mgrid[:rows, :cols] * pitch_mm
    slope = np.tan(np.radians(tilt_deg))
    u, v = 2.0 * x / x.max() - 1.0, 2.0 * y / y.max() - 1.0
    return 0.7 + slope * x - 0.4 * slope * y + dome_mm * (1.0 - u**2 - v**2)


@pytest.mark.parametrize(("tilt_deg", "dome_mm"), [(0.0, 0.0), (2.0, 0.0), (-3.0, 0.05), (0.5, -0.1)])
@pytest.mark.parametrize("raised", [False, True])
def test_plane_and_dome_go_and_the_serial_stays(
    tilt_deg: float, dome_mm: float, raised: bool, make_part: Make
) -> None:
    flat = make_part("K7B29", calm=True, raised=raised).height_map
    mounted = level(
        HeightMap(
            flat.z_mm + form(flat.shape, flat.pitch_mm, tilt_deg=tilt_deg, dome_mm=dome_mm), flat.pitch_mm
        )
    )
    assert mounted.pitch_mm == flat.pitch_mm
    # the land of the flat part is exactly zero
    assert np.sqrt(np.mean((mounted.z_mm - flat.z_mm) ** 2)) < 1e-3


def test_dropouts_stay_dropouts_and_do_no_harm(make_part: Make) -> None:
    flat = make_part("K7B29", calm=True).height_map
    z = flat.z_mm + form(flat.shape, flat.pitch_mm, tilt_deg=2.0, dome_mm=0.05).astype(np.float32)
    gone = np.random.default_rng(0).random(z.shape) < 0.1
    gone[20:60, 100:180] = True
    z[gone] = np.nan
    mounted = level(HeightMap(z, flat.pitch_mm)).z_mm
    assert np.array_equal(np.isnan(mounted), gone)
    assert np.sqrt(np.mean((mounted - flat.z_mm)[~gone] ** 2)) < 1e-3


def test_relief_is_the_depth_of_the_marks(make_part: Make) -> None:
    part = make_part("K7B29", calm=True).height_map
    # the outer percents are cut off, the marks take more than that
    assert relief_mm(part) == pytest.approx(-float(part.z_mm.min()), rel=0.1)


@pytest.mark.parametrize("angle", [-9.0, -6.5, -3.0, 0.0, 3.0, 6.5, 9.0])
def test_the_first_look_finds_the_rotation(angle: float, make_part: Make) -> None:
    part = make_part("K7B29X4", calm=True, line_rotation_deg=angle)
    assert first_look(level(part.height_map)).rotation_deg == pytest.approx(angle, abs=0.7)


@pytest.mark.parametrize("height_mm", [2.5, 5.0, 10.0])
@pytest.mark.parametrize("raised", [False, True])
def test_the_first_look_finds_the_height(height_mm: float, raised: bool, make_part: Make) -> None:
    part = make_part("K7B29X4", height_mm=height_mm, raised=raised)
    look = first_look(level(part.height_map))
    assert look.heights_mm[0] == pytest.approx(height_mm, rel=0.2)


def textured(**amounts: float) -> HeightMap:
    x, y = np.arange(400) * 0.08, np.arange(160) * 0.08
    bare = {"tilt_deg": 0.0, "waviness_um": 0.0, "lay_um": 0.0, "roughness_ra_um": 0.0}
    plate = PlateVariation(**{**bare, **amounts})
    rng = np.random.default_rng(4)
    return HeightMap(plate_form(x, y, plate, rng=rng) + plate_texture(x, y, plate, rng=rng), 0.08)


@pytest.mark.parametrize(
    "amounts",
    [{}, {"lay_um": 5.0}, {"roughness_ra_um": 3.0}, {"tilt_deg": 1.0, "lay_um": 3.0, "roughness_ra_um": 1.5}],
)
def test_the_first_look_sees_no_text_in_texture(amounts: dict[str, float]) -> None:
    assert first_look(level(textured(**amounts))).heights_mm == ()
