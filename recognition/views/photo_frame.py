"""Pixels and millimetres of a photograph.

The *photo frame* is the plate frame as far as the camera knows it: x along the columns, y along the rows. Where
the stage knows what lies under the middle of the picture, it is the plate's own; else pixel (0, 0) is its origin;
and without a pitch a pixel of the photograph as taken counts as one "mm": everything in recognition is free of scale.
"""

from __future__ import annotations

from glyphs.camera.photo import Photo


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
