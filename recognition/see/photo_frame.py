"""Pixels and millimetres of a photograph.

The *photo frame* has x along the columns and y along the rows. If the photograph says where on the plate its middle
lies, it is the plate frame; otherwise its origin is pixel (0, 0). Without a pitch, one pixel of the original photograph
counts as one "mm": nothing in recognition depends on the scale.
"""

from __future__ import annotations

from glyphs.camera.photo import Photo


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
