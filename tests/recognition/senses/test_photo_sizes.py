from __future__ import annotations

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from recognition.see.photo_frame import photo_middle_mm, photo_origin_mm, photo_pitch_mm
from recognition.see.photo_sizes import ENOUGH_ROWS, SIZES, is_large_enough, shrunk, shrunk_versions


def photo(pixels: int, *, pitch_mm: float | None = 0.01) -> Photo:
    rows = int((pixels / 3) ** 0.5)
    return Photo(np.zeros((rows, 3 * rows), dtype=np.uint8), pitch_mm=pitch_mm)


def looks(given: Photo, height_mm: float | None) -> list[int]:
    """Pixels of the photographs that are looked at, of characters so high."""
    seen: list[int] = []
    for small in shrunk_versions(given):
        seen.append(small.shape[0] * small.shape[1])
        if height_mm is not None and is_large_enough(small, height_mm):
            break
    return seen


def test_small_photographs_are_read_as_they_are() -> None:
    taken = photo(400_000)
    assert looks(taken, None) == [taken.shape[0] * taken.shape[1]]


def test_high_characters_are_read_at_the_first_size() -> None:
    taken = photo(12_000_000)
    height_mm = 0.01 * ENOUGH_ROWS * (12_000_000 / SIZES[0]) ** 0.5
    assert looks(taken, 1.02 * height_mm) == pytest.approx([SIZES[0]], rel=0.01)
    assert looks(taken, 0.98 * height_mm) == pytest.approx(list(SIZES), rel=0.01)


def test_where_no_line_is_found_all_sizes_are_tried() -> None:
    assert looks(photo(12_000_000), None) == pytest.approx(list(SIZES), rel=0.01)


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
