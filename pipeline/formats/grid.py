"""Conversion of the heights of a file to a HeightMap: bad points, rows, units, offset, and one pitch for both axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap
from pipeline.common.settings import MapSettings
from pipeline.errors import DataError
from pipeline.formats.raw_map import RawMap, check_size, without_bad_points
from pipeline.formats.units import factors_to_mm

# relative difference of two pitches that is taken for none: 1 in 1000 shears no character
SAME_PITCH = 1e-3
MUCH_FINER = 4.0
# mm from the median height: what lies farther off is some instrument's bad point
MAX_HEIGHT_MM = 1000.0
# mm, median height that is taken off: float32 holds a nanometre up to here
MOST_OFFSET_MM = 10.0
# mm: even with a unit given, no readable character has samples so far apart
MAX_PITCH_MM = 10.0


def height_map(raw: RawMap, settings: MapSettings) -> HeightMap:
    """The height map that a file holds.

    Args:
        raw: its heights.
        settings: unit, pitch and order of rows that are given.

    Raises:
        MarksError: sizes, pitches, units or heights that cannot be used.
    """
    if raw.z.ndim != 2 or min(raw.z.shape) < 2:
        raise DataError(f"is a profile or point list of shape {raw.z.shape}", "measure a surface")
    check_size(*raw.z.shape)
    x_pitch, y_pitch = _pitches(raw, settings)
    z = without_bad_points(np.array(raw.z, dtype=np.float64))
    if not np.isfinite(z).any():
        raise DataError("has no finite height; every point is a dropout", "measure it again")
    z_mm, xy_mm = factors_to_mm(replace(raw, z=z), min(x_pitch, y_pitch), settings)
    z *= z_mm
    offset = float(np.median(z[np.isfinite(z)]))
    if abs(offset) > MOST_OFFSET_MM:
        z -= offset
    z[np.abs(z) > MAX_HEIGHT_MM] = np.nan
    if raw.is_bottom_first(settings):
        z = z[::-1]
    for pitch in (x_pitch * xy_mm, y_pitch * xy_mm):
        if not (np.isfinite(pitch) and 0.0 < pitch <= MAX_PITCH_MM):
            what = f"has samples {pitch:.4g} mm apart"
            raise DataError(what, "give their distance in mm with --pitch-mm, at most 10")
    z, pitch_mm = _squared(z, x_pitch * xy_mm, y_pitch * xy_mm)
    return HeightMap(np.asarray(z, dtype=np.float32), pitch_mm)


def _pitches(raw: RawMap, settings: MapSettings) -> tuple[float, float]:
    """Distances of columns and rows, in the file's numbers; what the settings give goes before them."""
    if settings.pitch_mm is not None:
        return settings.pitch_mm, settings.pitch_mm
    if raw.x_pitch is None or raw.y_pitch is None:
        raise DataError(
            f"is a matrix of {raw.z.shape[0]} x {raw.z.shape[1]} heights without the distance of its samples",
            "give it with --pitch-mm, such as --pitch-mm 0.05, or save .npz with z_mm and pitch_mm",
        )
    for pitch in (raw.x_pitch, raw.y_pitch):
        if not (np.isfinite(pitch) and pitch > 0.0):
            raise DataError(f"states {pitch:g} as the distance of its samples", "give it with --pitch-mm")
    return raw.x_pitch, raw.y_pitch


def _squared(z: NDArray[np.float64], x_mm: float, y_mm: float) -> tuple[NDArray[np.float64], float]:
    """Heights on a square grid, and its pitch.

    The coarser axis is resampled linearly to the finer pitch; where one pitch is more than four times the
    other, the finer axis is resampled to the coarser pitch instead. What touches a dropout stays one.
    """
    finer, coarser = sorted((x_mm, y_mm))
    if coarser / finer - 1.0 <= SAME_PITCH:
        return z, 0.5 * (finer + coarser)
    pitch = coarser if coarser / finer > MUCH_FINER else finer
    rows, cols = (_count(n, p, pitch) for n, p in zip(z.shape, (y_mm, x_mm), strict=True))
    check_size(rows, cols)
    z = _resampled(z, rows, pitch / y_mm)
    return _resampled(z.T, cols, pitch / x_mm).T, pitch


def _count(n: int, old_mm: float, new_mm: float) -> int:
    return max(2, int((n - 1) * old_mm / new_mm + 1e-9) + 1)


def _resampled(z: NDArray[np.float64], n_rows: int, step: float) -> NDArray[np.float64]:
    """Rows taken at multiples of `step` rows, linearly between neighbours."""
    if n_rows == z.shape[0] and abs(step - 1.0) < 1e-12:
        return z
    at = np.minimum(np.arange(n_rows) * step, z.shape[0] - 1)
    low = np.minimum(at.astype(np.intp), z.shape[0] - 2)
    weight = (at - low)[:, None]
    # a row that is hit exactly does not look at its neighbour, which may be a dropout
    between = (1.0 - weight) * z[low] + weight * z[low + 1]
    return np.asarray(np.where(weight == 0.0, z[low], np.where(weight == 1.0, z[low + 1], between)))
