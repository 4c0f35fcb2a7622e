"""Pixels and millimetres of a photograph, crops of lines out of it, and the way back.

The *photo frame* is the plate frame as far as the camera knows it: x along the columns, y along the rows. Where
the stage knows what lies under the middle of the picture, it is the plate's own; else pixel (0, 0) is its origin;
and without a pitch a pixel of the photograph as taken counts as one "mm": everything in recognition is free of scale.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.camera.photo import Photo
from glyphs.surface.maps import MapError
from recognition.box import Box

CROP_MARGIN_HEIGHTS = 0.15
"""Land around the line in a crop, character heights: an engine sees little but the line, and all of it."""
MOST_CROP_ROWS = 192
"""Rows of a crop at most: no recogniser looks closer."""


def photo_pitch_mm(photo: Photo) -> float:
    """Size of a pixel; where it is not known, in pixels of the photograph as taken."""
    return photo.pitch_mm if photo.pitch_mm is not None else photo.shrunk


def photo_origin_mm(photo: Photo) -> tuple[float, float]:
    """Photo frame (x, y) of pixel (0, 0)."""
    if photo.centre_mm is None:
        return (0.0, 0.0)
    (rows, cols), pitch = photo.shape, photo_pitch_mm(photo)
    return (photo.centre_mm[0] - 0.5 * (cols - 1) * pitch, photo.centre_mm[1] - 0.5 * (rows - 1) * pitch)


def photo_middle_mm(photo: Photo) -> tuple[float, float]:
    """Photo frame (x, y) of the middle of a picture."""
    (rows, cols), pitch, (x0, y0) = photo.shape, photo_pitch_mm(photo), photo_origin_mm(photo)
    return (x0 + 0.5 * (cols - 1) * pitch, y0 + 0.5 * (rows - 1) * pitch)


@dataclass(frozen=True)
class LinePlace:
    """Where a line of characters lies.

    ::

        +---------------------------+   width: ink to ink along the line
        | K  7  B  2  9  1          |   height: of the characters, across it
        +-------------x-------------+   x: the middle

    Attributes:
        middle_mm: photo frame.
        width_mm, height_mm: along and across the line.
        rotation_deg: of the line, from +x towards +y.
        shear: lean of the characters to the right, columns per row upwards.
        taper: relative growth of the height from the left end to the right end.

    Raises:
        MapError: sizes that are not positive, or numbers out of range.
    """

    middle_mm: tuple[float, float]
    width_mm: float
    height_mm: float
    rotation_deg: float = 0.0
    shear: float = 0.0
    taper: float = 0.0

    def __post_init__(self) -> None:
        numbers = (*self.middle_mm, self.width_mm, self.height_mm, self.rotation_deg, self.shear, self.taper)
        if not np.isfinite(numbers).all() or min(self.width_mm, self.height_mm) <= 0.0:
            raise MapError(
                f"{self} is not a place of a line", hint="width and height must be positive, all finite"
            )
        if abs(self.taper) >= 1.0:
            raise MapError(f"taper {self.taper} folds the line over", hint="it lies between -1 and 1")

    def corners(self, *, margin_heights: float = 0.0) -> NDArray[np.float64]:
        """(4, 2) photo frame corners, from the top left clockwise, with a margin all round."""
        half = 0.5 * self.width_mm + margin_heights * self.height_mm
        angle = math.radians(self.rotation_deg)
        out = []
        for side, up in ((-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
            tall = self.height_mm * (0.5 + margin_heights) * (1.0 + 0.5 * side * self.taper)
            u, v = side * half + up * tall * self.shear, -up * tall
            out.append(
                (
                    self.middle_mm[0] + math.cos(angle) * u - math.sin(angle) * v,
                    self.middle_mm[1] + math.sin(angle) * u + math.cos(angle) * v,
                )
            )
        return np.array(out)


@dataclass(frozen=True, eq=False)
class LineCrop:
    """A line cut out of a photograph and set upright.

    Attributes:
        photo: the line with its margin; its pitch is counted as that of the photograph is, its centre unknown.
        to_frame: (3, 3) homography from the crop's own millimetres to the photo frame.
    """

    photo: Photo
    to_frame: NDArray[np.float64]

    def box(self, box: Box) -> Box:
        """Axis-parallel hull, in the photo frame, of a box of the crop."""
        x = np.array([box.x0_mm, box.x1_mm, box.x1_mm, box.x0_mm])
        y = np.array([box.y0_mm, box.y0_mm, box.y1_mm, box.y1_mm])
        p = self.to_frame @ np.stack([x, y, np.ones(4)])
        px, py = p[0] / p[2], p[1] / p[2]
        return Box(float(px.min()), float(py.min()), float(px.max()), float(py.max()))


def whole(photo: Photo) -> LinePlace:
    """The place of a line that fills the photograph but for the usual margin."""
    (rows, cols), pitch = photo.shape, photo_pitch_mm(photo)
    height = rows / (1.0 + 2.0 * CROP_MARGIN_HEIGHTS)
    width = max(cols - 2.0 * CROP_MARGIN_HEIGHTS * height, 0.2 * height)
    return LinePlace(photo_middle_mm(photo), width * pitch, height * pitch)


def line_crop(photo: Photo, place: LinePlace, *, margin_heights: float = CROP_MARGIN_HEIGHTS) -> LineCrop:
    """Cut a line out, upright, sheared and tapered back, with a margin.

    Raises:
        MapError: the line is less than eight pixels high.
    """
    pitch = photo_pitch_mm(photo)
    rows = round(place.height_mm / pitch * (1.0 + 2.0 * margin_heights))
    scale = min(1.0, MOST_CROP_ROWS / max(rows, 1))
    cols = round((place.width_mm + 2.0 * margin_heights * place.height_mm) / pitch * scale)
    shape = (round(rows * scale), max(8, cols))
    corners = place.corners(margin_heights=margin_heights)
    origin = np.array(photo_origin_mm(photo))
    made = rectify(photo, (corners - origin) / pitch, shape=shape)
    size = pitch / scale
    # corners are the outer rims of the crop's pixels
    back = _homography(
        np.array([(0.0, 0.0), (shape[1], 0.0), (shape[1], shape[0]), (0.0, shape[0])]) * size, corners
    )
    return LineCrop(Photo(made.pixels, pitch_mm=size), back)


def rectify(photo: Photo, corners: ArrayLike, *, shape: tuple[int, int] | None = None) -> Photo:
    """The photograph of a flat rectangle, as seen from straight above.

    Args:
        photo: as taken.
        corners: (4, 2) columns and rows of its corners, from the top left clockwise.
        shape: (rows, cols) of the outcome; by the sides' lengths unless given.

    Returns:
        A photograph without pitch or centre: perspective has none of its own.

    Raises:
        MapError: corners that bound no area, or too small.
    """
    from glyphs.opencv import cv2

    c = np.asarray(corners, dtype=np.float64)
    if c.shape != (4, 2) or not np.isfinite(c).all():
        raise MapError("give four corners (column, row), from the top left clockwise")
    nxt = np.roll(c, -1, axis=0)
    on, back = np.roll(nxt, -1, axis=0) - nxt, nxt - c
    turn = on[:, 0] * back[:, 1] - on[:, 1] * back[:, 0]
    if not ((turn < 0).all() or (turn > 0).all()):
        raise MapError("the corners bound no convex area", hint="give them in order, clockwise")
    side = np.hypot(*(nxt - c).T)
    if shape is None:
        shape = (round(0.5 * (side[1] + side[3])), round(0.5 * (side[0] + side[2])))
    if min(shape) < 8:
        raise MapError(f"the area is {shape[0]} x {shape[1]} pixels", hint="that shows no characters")
    rim = np.array([(0.0, 0.0), (shape[1], 0.0), (shape[1], shape[0]), (0.0, shape[0])]) - 0.5
    to_photo = _homography(rim, c)
    # averaging beforehand, where the outcome is coarser than the picture
    coarse = min(float(side[0]) / shape[1], float(side[1]) / shape[0])
    pixels = photo.pixels
    if coarse > 1.5:
        pixels = np.asarray(cv2.GaussianBlur(pixels, (0, 0), 0.4 * coarse), dtype=np.uint8)
    made = cv2.warpPerspective(
        pixels,
        to_photo,
        (shape[1], shape[0]),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return Photo(np.asarray(made, dtype=np.uint8))


def _homography(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) that takes four points to four others."""
    rows = []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y])
    solved = np.linalg.solve(np.array(rows, dtype=np.float64), np.asarray(target, dtype=np.float64).ravel())
    return np.append(solved, 1.0).reshape(3, 3)


def boxes_in_frame(crop: LineCrop, boxes: Sequence[Box]) -> tuple[Box, ...]:
    """Boxes of the crop in the photo frame."""
    return tuple(crop.box(b) for b in boxes)
