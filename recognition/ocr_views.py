"""The same line of characters made ready for a recogniser in several ways.

A network trained on print is thrown by patches of grime and by margins; each of these views takes some of that
away, none is best everywhere, and what they say is averaged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo

WORK_ROWS = 96
"""Rows at which a view is computed: twice what the network sees."""
CLAHE_CLIP, CLAHE_TILES = 8.0, (8, 4)
LEVEL_SHARE, LEVEL_REACH, LEVEL_GAIN = 0.26, 30.0, 4.0
"""Width of the median taken off over the rows of the picture, brightness kept about it, and its gain."""

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class View:
    """One way of showing a line.

    Attributes:
        name: of the view.
        picture: from (rows, cols, 3) to the same, or to (rows, cols) where it has no colour left.
        trim: share of the rows cut off at top and bottom.
        stretch: widening.
    """

    name: str
    picture: Callable[[Picture], Picture]
    trim: float = 0.0
    stretch: float = 1.0


def as_it_is(picture: Picture) -> Picture:
    """Nothing done."""
    return picture


def equalised(picture: Picture) -> Picture:
    """Grey, its contrast evened out tile by tile (CLAHE): faint strokes in dark patches come up."""
    from glyphs.opencv import cv2

    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    return np.asarray(cv2.createCLAHE(CLAHE_CLIP, CLAHE_TILES).apply(grey), dtype=np.uint8)


def levelled(picture: Picture) -> Picture:
    """Grey, the median of the neighbourhood taken off: patches and light go, strokes stay."""
    from glyphs.opencv import cv2

    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    wide = min(255, int(LEVEL_SHARE * grey.shape[0]) | 1)
    rest = grey.astype(np.float32) - cv2.medianBlur(grey, wide).astype(np.float32)
    level = 128.0 + LEVEL_GAIN * np.clip(rest, -LEVEL_REACH, LEVEL_REACH)
    return np.asarray(np.clip(level, 0, 255), dtype=np.uint8)


def inverted(picture: Picture) -> Picture:
    """Dark for bright, after evening out."""
    return np.asarray(255 - equalised(picture), dtype=np.uint8)


VIEWS = (
    View("as it is", as_it_is),
    View("equalised", equalised, trim=0.06),
    View("equalised, wide", equalised, trim=0.04, stretch=1.2),
    View("levelled", levelled, trim=0.06, stretch=1.1),
    View("inverted", inverted, trim=0.04, stretch=1.1),
)
FIRST_VIEW = VIEWS[1]
"""The one that does best alone: it judges where the line is."""


def view_of(photo: Photo, view: View, *, rows: int) -> Picture:
    """The view of a line crop, (rows, cols, 3)."""
    from glyphs.opencv import cv2

    pixels = photo.pixels if photo.pixels.ndim == 3 else np.repeat(photo.pixels[..., None], 3, axis=2)
    cut = round(view.trim * pixels.shape[0])
    pixels = pixels[cut : pixels.shape[0] - cut]
    work = _sized(pixels, WORK_ROWS, math.ceil(WORK_ROWS * pixels.shape[1] / pixels.shape[0]))
    cols = max(8, math.ceil(rows * view.stretch * pixels.shape[1] / pixels.shape[0]))
    made = cv2.resize(view.picture(work), (cols, rows), interpolation=cv2.INTER_AREA)
    if made.ndim == 2:
        made = np.repeat(made[..., None], 3, axis=2)
    return np.asarray(made, dtype=np.uint8)


def _sized(pixels: Picture, rows: int, cols: int) -> Picture:
    from glyphs.opencv import cv2

    how = cv2.INTER_AREA if pixels.shape[0] > rows else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.ascontiguousarray(pixels), (max(8, cols), rows), interpolation=how))
