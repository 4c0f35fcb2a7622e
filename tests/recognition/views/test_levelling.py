"""A part mounted level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap
from recognition.views.levelling import level

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
    flat = make_part(
        "K7B29", calm=True, pitch_mm=5.0 / 150
    ).height_map  # so fine that the fit is of a thinned grid
    z = flat.z_mm + form(flat.shape, flat.pitch_mm, tilt_deg=2.0, dome_mm=0.05).astype(np.float32)
    gone = np.random.default_rng(0).random(z.shape) < 0.1
    gone[50:150, 250:450] = True
    z[gone] = np.nan
    mounted = level(HeightMap(z, flat.pitch_mm)).z_mm
    assert np.array_equal(np.isnan(mounted), gone)
    assert np.sqrt(np.mean((mounted - flat.z_mm)[~gone] ** 2)) < 1e-3


def test_a_flat_plate_stays_flat() -> None:
    z = np.full((20, 30), 0.25, dtype=np.float32)
    assert (
        np.abs(level(HeightMap(z, 0.1)).z_mm).max() < 1e-6
    )  # the damping leaves 1e-10 of it, float32 the rest
