"""Pixels and millimetres of a photograph.

The *photo frame* has x along the columns and y along the rows. If the photograph says where on the plate its middle
lies, it is the plate frame; otherwise its origin is pixel (0, 0). Without a pitch, one pixel of the original photograph
counts as one "mm": nothing in recognition depends on the scale.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glyphs.camera.photo import Photo
from recognition.see.text_line import TextLine


def photo_pitch_mm(photo: Photo) -> float:
    """Size of a pixel, mm; if unknown, in pixels of the original photograph."""
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


def cut(photo: Photo, area: tuple[float, float, float, float]) -> Photo:
    """Crop a photograph and its others to left, top, right and bottom, in shares, in the same frame."""
    rows, columns = pixels_of(area, photo.shape)
    pitch, (x0, y0) = photo_pitch_mm(photo), photo_origin_mm(photo)
    middle = (
        x0 + 0.5 * (columns.start + columns.stop - 1) * pitch,
        y0 + 0.5 * (rows.start + rows.stop - 1) * pitch,
    )
    others = tuple(cut(other, area) for other in photo.others)
    return replace(photo, pixels=photo.pixels[rows, columns], centre_mm=middle, others=others)


def area_about(
    line: TextLine, photo: Photo, *, along: float = 6.0, across: float = 2.5
) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of the land around a line, character heights, as shares of a photograph."""
    rows, columns = photo.shape
    low, high = line.centre_mm.min(axis=0), line.centre_mm.max(axis=0)
    margin = line.height_mm * np.where(high - low > line.height_mm, along, across)
    size = np.multiply((columns, rows), photo_pitch_mm(photo))
    left, top = np.clip((low - margin - photo_origin_mm(photo)) / size, 0.0, 1.0)
    right, bottom = np.clip((high + margin - photo_origin_mm(photo)) / size, 0.0, 1.0)
    return float(left), float(top), float(right), float(bottom)


def pixels_of(
    area: tuple[float, float, float, float], shape: Sequence[int], *, least: int = 8
) -> tuple[slice, slice]:
    """Rows and columns, `least` each, of left, top, right and bottom as shares of (rows, columns)."""

    def pixels(low: float, high: float, n: int) -> slice:
        first = max(min(math.floor(low * n), n - least), 0)
        return slice(first, max(math.ceil(high * n), first + least))

    left, top, right, bottom = area
    return pixels(top, bottom, shape[0]), pixels(left, right, shape[1])
