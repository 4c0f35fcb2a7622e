"""Sizes at which a photograph is read: as few pixels as the characters need, to save time.

12 million --> 0.6 million: characters 25 pixels high --> 4 million: 65 pixels, read
           \\-> 0.6 million: 90 pixels, read
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from glyphs.camera.photo import Photo
from recognition.see.photo_frame import photo_middle_mm, photo_pitch_mm

SIZES = (600_000, 4_000_000)
"""Sizes at which a photograph is read, pixels, in turn until its characters are high enough."""
LARGE = 2_000_000
"""Pixels from which a photograph is large: its serial may be a small part of it, so it is looked for first."""
ENOUGH_ROWS = 60
"""Pixels per character height from which more hardly help."""
_HARDLY_LARGER = 1.5
"""Ratio of pixels up to which a photograph is not shrunk to a size first."""


def shrunk_versions(photo: Photo) -> Iterator[Photo]:
    """The photograph at increasing sizes."""
    rows, cols = photo.shape
    sizes = [size for size in SIZES[:-1] if rows * cols > _HARDLY_LARGER * size]
    yield from (shrunk(photo, size) for size in (*sizes, SIZES[-1]))


def is_large_enough(photo: Photo, height_mm: float) -> bool:
    """Whether characters of a height have enough pixels in a photograph."""
    return height_mm / photo_pitch_mm(photo) >= ENOUGH_ROWS


def shrunk(photo: Photo, pixels: int) -> Photo:
    """Shrink a photograph to about a number of pixels, in the same frame; unchanged if it has fewer."""
    from glyphs.opencv import cv2

    rows, cols = photo.shape
    scale = (pixels / (rows * cols)) ** 0.5
    if scale >= 1.0:
        return photo
    size = (max(8, round(cols * scale)), max(8, round(rows * scale)))
    pixels_shrunk: Any = cv2.resize(photo.pixels, size, interpolation=cv2.INTER_AREA)
    # the rim of the picture keeps its position; the middle of the first pixel, the frame's origin, does not
    pitch = photo_pitch_mm(photo) * cols / size[0]
    size_of_pixels = {"shrunk": pitch} if photo.pitch_mm is None else {"pitch_mm": pitch}
    others = tuple(shrunk(other, pixels) for other in photo.others)
    return replace(
        photo, pixels=pixels_shrunk, centre_mm=photo_middle_mm(photo), others=others, **size_of_pixels
    )
