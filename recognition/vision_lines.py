"""Where the line may lie in a photograph, before anything is read: places for an engine to judge."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.localise import Band, activity_of, bands, line_rotation_deg
from recognition.vision_edges import derivatives, limited, log_brightness
from recognition.vision_frame import LinePlace, photo_origin_mm, photo_pitch_mm, whole

LOOK_ROWS = 120
"""Rows at which the photograph is looked over: a line that matters is some 20 to 100 of them high."""
HEIGHT_SHARES = (0.77, 0.62, 0.5, 0.4, 0.32)
"""Character heights supposed where nothing is known, of the photograph's rows."""
STEP_HEIGHTS = 0.85
"""Usual distance of neighbouring characters, character heights."""
SAME_TURN_DEG = 1.0
WIDTH_PER_CHARACTER = (0.3, 2.2)
"""Least and most of the line's width that a character takes, character heights."""


def line_places(
    photo: Photo, *, height_mm: float | None = None, n_places: int | None = None
) -> tuple[LinePlace, ...]:
    """Places where a line may lie: bands in which edges gather, and the whole photograph.

    Args:
        photo: as taken.
        height_mm: of the characters, if known.
        n_places: characters of the line, if known.
    """
    found = [p for p in _gathered(photo, height_mm) if _plausible(p, n_places)]
    full = whole(photo)
    if height_mm is not None and n_places is not None:
        # where a camera that is set up for the part has it
        width = min(STEP_HEIGHTS * n_places * height_mm, full.width_mm)
        found.append(LinePlace(full.middle_mm, width, height_mm))
    return (*found[:4], full)


def distinct_turns_deg(places: Sequence[LinePlace]) -> tuple[float, ...]:
    """Rotations worth trying, the smallest first; none stands for its neighbour within a degree."""
    kept: list[float] = []
    for turn in sorted((0.0, *(p.rotation_deg for p in places)), key=abs):
        if all(abs(turn - k) > SAME_TURN_DEG for k in kept):
            kept.append(turn)
    return tuple(kept)


def supposed_heights_mm(photo: Photo, places: tuple[LinePlace, ...]) -> tuple[float, ...]:
    """Character heights worth trying, no two nearly the same."""
    rows, pitch = photo.shape[0], photo_pitch_mm(photo)
    tried = [p.height_mm * f for p in places for f in (1.0, 0.88)]
    tried += [share * rows * pitch for share in HEIGHT_SHARES]
    kept: list[float] = []
    for height in tried:
        if height >= 8.0 * pitch and all(abs(math.log(height / k)) > 0.07 for k in kept):
            kept.append(height)
    return tuple(kept)


def _gathered(photo: Photo, height_mm: float | None) -> list[LinePlace]:
    from glyphs.opencv import cv2

    rows, cols = photo.shape
    pitch = photo_pitch_mm(photo)
    zoom = max(1.0, rows / LOOK_ROWS)
    shape = (max(8, round(cols / zoom)), max(8, round(rows / zoom)))
    log = np.asarray(cv2.resize(log_brightness(photo), shape, interpolation=cv2.INTER_AREA), dtype=np.float32)
    size = rows / shape[1] * pitch
    layers = limited(derivatives(log, scale_px=1.2), clip=3.0)
    turn = line_rotation_deg(activity_of(layers))
    out: list[LinePlace] = []
    for rotation in (turn, 0.0) if turn else (0.0,):
        middle = (0.5 * (layers.shape[2] - 1), 0.5 * (layers.shape[1] - 1))
        about = cv2.getRotationMatrix2D(middle, rotation, 1.0)
        turned = np.stack([cv2.warpAffine(a, about, shape, borderValue=0.0) for a in layers]).astype(
            np.float32
        )
        activity = activity_of(turned)
        for band in bands(activity, pitch_mm=size, most=3):
            out.append(_place(photo, activity, band, size, rotation, height_mm))
    return out


def _place(
    photo: Photo,
    activity: NDArray[np.float64],
    band: Band,
    size_mm: float,
    rotation_deg: float,
    height_mm: float | None,
) -> LinePlace:
    """The band between its first and last busy column, in the photo frame."""
    rows, cols = activity.shape
    height = height_mm if height_mm is not None else band.height_mm
    half = max(1, round(0.5 * height / size_mm))
    row = round(band.middle_mm / size_mm)
    profile = activity[max(0, row - half) : row + half + 1].mean(axis=0)
    width = max(1, round(0.25 * height / size_mm))
    smooth = np.convolve(profile, np.ones(2 * width + 1) / (2 * width + 1), mode="same")
    busy = np.flatnonzero(smooth > 0.25 * float(np.percentile(smooth, 90.0)))
    left, right = (float(busy[0]), float(busy[-1])) if busy.size else (0.0, cols - 1.0)
    u = (0.5 * (left + right) - 0.5 * (cols - 1)) * size_mm
    v = band.middle_mm - 0.5 * (rows - 1) * size_mm
    angle = math.radians(rotation_deg)
    x0, y0 = photo_origin_mm(photo)
    pitch = photo_pitch_mm(photo)
    middle = (
        x0 + 0.5 * (photo.shape[1] - 1) * pitch + math.cos(angle) * u - math.sin(angle) * v,
        y0 + 0.5 * (photo.shape[0] - 1) * pitch + math.sin(angle) * u + math.cos(angle) * v,
    )
    return LinePlace(middle, max(right - left, 1.0) * size_mm, height, rotation_deg)


def _plausible(place: LinePlace, n_places: int | None) -> bool:
    if n_places is None:
        return True
    each = place.width_mm / place.height_mm / n_places
    return WIDTH_PER_CHARACTER[0] < each < WIDTH_PER_CHARACTER[1]
