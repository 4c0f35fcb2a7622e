"""Crops and the way back."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.surface.maps import MapError
from recognition.box import Box
from recognition.vision_frame import LinePlace, line_crop, rectify, whole

PITCH_MM = 0.1


def spots(rows: int, cols: int, at: list[tuple[float, float]], *, pitch: float | None = PITCH_MM) -> Photo:
    """Bright spots at (column, row) on black."""
    y, x = np.mgrid[:rows, :cols]
    image = sum(np.exp(-((x - c) ** 2 + (y - r) ** 2) / (2 * 2.0**2)) for c, r in at)
    return Photo(np.rint(255.0 * np.clip(image, 0, 1)).astype(np.uint8), pitch_mm=pitch)


def brightest(photo: Photo) -> tuple[float, float]:
    grey = photo.grey().astype(np.float64)
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
    return float((x * grey).sum() / grey.sum()), float((y * grey).sum() / grey.sum())


@pytest.mark.parametrize("rotation", [-10.0, 0.0, 7.0])
@pytest.mark.parametrize("centre", [None, (3.0, -2.0)])
def test_a_spot_is_found_again_where_it_was(rotation: float, centre: tuple[float, float] | None) -> None:
    made = spots(120, 200, [(130.0, 66.0)])
    photo = Photo(made.pixels, pitch_mm=PITCH_MM, centre_mm=centre)
    x0, y0 = (0.0, 0.0) if centre is None else (centre[0] - 9.95, centre[1] - 5.95)
    place = LinePlace((x0 + 10.0, y0 + 6.0), 10.0, 4.0, rotation, shear=0.1, taper=0.1)
    crop = line_crop(photo, place)
    column, row = brightest(crop.photo)
    size = crop.photo.pitch_mm or 1.0
    box = crop.box(Box(*(2 * ((column + 0.5) * size, (row + 0.5) * size))))
    # a fifth of a pixel: interpolation of a spot of two pixels
    assert box.x0_mm == pytest.approx(x0 + 130.0 * PITCH_MM, abs=0.2 * PITCH_MM)
    assert box.y0_mm == pytest.approx(y0 + 66.0 * PITCH_MM, abs=0.2 * PITCH_MM)


def test_large_crops_are_shrunk_and_map_back() -> None:
    photo = spots(600, 900, [(700.0, 200.0)], pitch=None)
    crop = line_crop(photo, whole(photo))
    assert crop.photo.shape[0] < 300
    column, row = brightest(crop.photo)
    size = crop.photo.pitch_mm or 1.0
    box = crop.box(Box(*(2 * ((column + 0.5) * size, (row + 0.5) * size))))
    assert (box.x0_mm, box.y0_mm) == pytest.approx((700.0, 200.0), abs=1.0)


def test_rectify_undoes_a_perspective() -> None:
    corners = [(20.0, 30.0), (180.0, 10.0), (190.0, 110.0), (10.0, 90.0)]
    flat = rectify(spots(120, 200, corners), corners, shape=(80, 160)).grey()
    # each corner's spot, a quarter of it, lies in a corner of the outcome; pixels' middles lie inside the rim
    assert min(flat[:3, :3].max(), flat[:3, -3:].max(), flat[-3:, :3].max(), flat[-3:, -3:].max()) > 0.7
    assert flat[20:60, 20:140].max() < 0.01


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([(0, 0), (50, 0), (50, 50)], "four corners"),
        ([(0, 0), (50, 50), (50, 0), (0, 50)], "convex"),
        ([(0, 0), (4, 0), (4, 4), (0, 4)], "no characters"),
    ],
)
def test_corners_that_bound_nothing_are_refused(corners: list[tuple[int, int]], message: str) -> None:
    with pytest.raises(MapError, match=message):
        rectify(spots(60, 60, [(30.0, 30.0)]), corners)


def test_a_place_needs_a_size() -> None:
    with pytest.raises(MapError, match="positive"):
        LinePlace((0.0, 0.0), 0.0, 5.0)
    with pytest.raises(MapError, match="folds"):
        LinePlace((0.0, 0.0), 10.0, 5.0, taper=1.0)
