"""Sizes at which photographs are read; a serial that is a small part of a large one."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from glyphs.camera.photo import Photo
from recognition.find.tiles import find_in_tiles
from recognition.find.wide import find_wide
from recognition.reader import Reader
from recognition.see.photo_frame import photo_middle_mm, photo_origin_mm, photo_pitch_mm
from recognition.see.photo_sizes import ENOUGH_ROWS, LARGE, SIZES, is_large_enough, shrunk, shrunk_versions
from recognition.see.view import photo_view
from tests.benchmarks.wide_frames import clutter, framed

# ------------------------------------------------------------------------------------------------------- photo sizes


def photo(pixels: int, *, pitch_mm: float | None = 0.01) -> Photo:
    rows = int((pixels / 3) ** 0.5)
    return Photo(np.zeros((rows, 3 * rows), dtype=np.uint8), pitch_mm=pitch_mm)


def test_large_photographs_are_read_at_several_sizes_and_small_ones_as_they_are() -> None:
    sizes = [small.pixels.size for small in shrunk_versions(photo(12_000_000))]
    assert sizes == pytest.approx(list(SIZES), rel=0.01)
    assert [small.shape for small in shrunk_versions(photo(400_000))] == [photo(400_000).shape]


def test_characters_of_enough_rows_are_large_enough() -> None:
    height_mm = 0.01 * ENOUGH_ROWS
    assert is_large_enough(photo(400_000), 1.02 * height_mm)
    assert not is_large_enough(photo(400_000), 0.98 * height_mm)


@pytest.mark.parametrize("centre", [None, (7.0, -3.0)])
def test_shrinking_leaves_the_frame_where_it_is(centre: tuple[float, float] | None) -> None:
    taken = Photo(np.zeros((900, 2000), dtype=np.uint8), pitch_mm=0.01, centre_mm=centre)
    small = shrunk(taken, 112_500)  # a quarter of the length
    assert small.shape == (225, 500)
    assert small.pitch_mm == pytest.approx(0.04)
    assert photo_middle_mm(small) == pytest.approx(photo_middle_mm(taken))
    # rims alike: the first pixel reaches as far out
    for one, other in zip(photo_origin_mm(small), photo_origin_mm(taken), strict=True):
        assert one - 0.02 == pytest.approx(other - 0.005)


def test_without_a_scale_the_frame_is_that_of_the_pixels_as_taken() -> None:
    taken = photo(10**6, pitch_mm=None)
    small = shrunk(taken, 62_500)
    assert small.pitch_mm is None
    assert photo_pitch_mm(small) == pytest.approx(4.0, rel=0.01)
    assert photo_middle_mm(small) == pytest.approx(photo_middle_mm(taken))


# -------------------------------------------------------------------------------------------------------------- wide

SERIAL = Path(__file__).parents[2] / "data" / "photos" / "1X2100H.jpg"
SHAPE = (3000, 4000)


@pytest.fixture(scope="module")
def ground() -> np.ndarray:
    return clutter(SHAPE, np.random.default_rng(4))


def test_a_small_part_of_a_large_photograph_is_read(ground: np.ndarray) -> None:
    plate = cv2.imread(str(SERIAL), cv2.IMREAD_GRAYSCALE)
    whole = (0.0, 0.0, float(plate.shape[1]), float(plate.shape[0]))
    frame, (x0, y0, x1, y1) = framed(plate, whole, 0.19, ground, np.random.default_rng(1))
    reading = Reader(format="9A9999A").read(Photo(frame))
    assert reading.text == "1X2100H"
    x, y = (reading.box.x0_mm + reading.box.x1_mm) / 2, (reading.box.y0_mm + reading.box.y1_mm) / 2
    assert abs(x - (x0 + x1) / 2) < 0.1 * (x1 - x0)
    assert abs(y - (y0 + y1) / 2) < 0.3 * (y1 - y0)
    rows, columns = reading.trace.photo.shape
    assert columns / rows == pytest.approx(SHAPE[1] / SHAPE[0], rel=1e-3)  # all of it


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_small_serial_among_clutter_is_found_in_tiles_that_are_like_text(seed: int) -> None:
    plate, rng = cv2.imread(str(SERIAL), cv2.IMREAD_GRAYSCALE), np.random.default_rng(seed)
    whole = (0.0, 0.0, float(plate.shape[1]), float(plate.shape[0]))
    frame, (x0, y0, x1, y1) = framed(plate, whole, 0.3, clutter((600, 900), rng), rng)
    lines = [found.line for found in find_in_tiles(photo_view(Photo(frame)), fine=True)[:3]]
    middles = [line.centre_mm.mean(axis=0) for line in lines]
    assert any(x0 < x < x1 and y0 < y < y1 for x, y in middles)


def test_noise_of_a_large_photograph_is_no_line() -> None:
    noise = np.random.default_rng(2).normal(120.0, 2.0, SHAPE)
    view = photo_view(shrunk(Photo(np.rint(noise).astype(np.uint8)), LARGE))
    assert all(line.score < 1.0 for line in find_wide(view))
    assert math.prod(view.layers.shape[1:]) == pytest.approx(LARGE, rel=0.01)
