"""From the heights of a file to a HeightMap: bad points, rows, units, offset, and one pitch for both axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, damage_reported
from glyphs.surface.maps import MAX_PIXELS, HeightMap
from pipeline.common.settings import MapSettings
from pipeline.formats.raw_map import RawMap
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

# heights that programs write for missing points; besides these all numbers of nines, such as -99.99 and -9999
_MISSING = (-32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0)
# distance of such a height from all others, in ranges of the others; and of any other height that stands for missing
_APART, _FAR_APART = 2.0, 100.0
# share of the points that may be missing: of the well-known heights, and of others
_MOST_MISSING, _MOST_OTHERS = 0.9, 0.2
_SUBSAMPLE = 200_000


def height_map(path: Path, raw: RawMap, settings: MapSettings) -> HeightMap:
    """The height map that a file holds.

    Args:
        path: the file, for messages.
        raw: its heights.
        settings: unit, pitch and order of rows that are given.

    Raises:
        FileError: sizes, pitches, units or heights that cannot be used.
    """
    if raw.z.ndim != 2 or min(raw.z.shape) < 2:
        raise FileError(path, f"is a profile or point list of shape {raw.z.shape}", "measure a surface")
    check_size(path, *raw.z.shape)
    x_pitch, y_pitch = _pitches(path, raw, settings)
    z = without_bad_points(np.array(raw.z, dtype=np.float64))
    if not np.isfinite(z).any():
        raise FileError(path, "has no finite height; every point is a dropout", "measure it again")
    z_mm, xy_mm = factors_to_mm(path, replace(raw, z=z), min(x_pitch, y_pitch), settings)
    z *= z_mm
    offset = float(np.median(z[np.isfinite(z)]))
    if abs(offset) > MOST_OFFSET_MM:
        z -= offset
    z[np.abs(z) > MAX_HEIGHT_MM] = np.nan
    if raw.is_bottom_first(settings):
        z = z[::-1]
    for pitch in (x_pitch * xy_mm, y_pitch * xy_mm):
        if not (np.isfinite(pitch) and 0.0 < pitch <= MAX_PITCH_MM):
            raise FileError(
                path,
                f"has samples {pitch:.4g} mm apart",
                "give their distance in mm with --pitch-mm, at most 10",
            )
    z, pitch_mm = _squared(path, z, x_pitch * xy_mm, y_pitch * xy_mm)
    with damage_reported(path, kind="height map"):
        return HeightMap(np.asarray(z, dtype=np.float32), pitch_mm)


def check_size(path: Path, rows: int, cols: int) -> None:
    """Refuse a map of more samples than the limit, before it is loaded.

    Raises:
        FileError: it has more.
    """
    if rows * cols > MAX_PIXELS:
        raise FileError(
            path, f"{rows:,} x {cols:,} samples exceed the limit of {MAX_PIXELS:,}", "crop or thin the map"
        )


def _pitches(path: Path, raw: RawMap, settings: MapSettings) -> tuple[float, float]:
    """Distances of columns and rows, in the file's numbers; what the settings give goes before them."""
    if settings.pitch_mm is not None:
        return settings.pitch_mm, settings.pitch_mm
    if raw.x_pitch is None or raw.y_pitch is None:
        raise FileError(
            path,
            f"is a matrix of {raw.z.shape[0]} x {raw.z.shape[1]} heights without the distance of its samples",
            "give it with --pitch-mm, such as --pitch-mm 0.05, or save .npz with z_mm and pitch_mm",
        )
    for pitch in (raw.x_pitch, raw.y_pitch):
        if not (np.isfinite(pitch) and pitch > 0.0):
            raise FileError(
                path, f"states {pitch:g} as the distance of its samples", "give it with --pitch-mm"
            )
    return raw.x_pitch, raw.y_pitch


def without_bad_points(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """The heights with NaN in place of infinities and of a number that stands for missing points; changed in place."""
    z[~np.isfinite(z)] = np.nan
    z[np.abs(z) > 1e30] = np.nan
    for _ in range(2):  # one below all others and one above
        known = z[np.isfinite(z)]
        if known.size < 2:
            break
        for end in (float(known.min()), float(known.max())):
            if _stands_for_missing(end, known):
                z[z == end] = np.nan
    return z


def _stands_for_missing(value: float, known: NDArray[np.float64]) -> bool:
    """Whether the lowest or highest height is no height: far from all others, and written again and again."""
    others = known[known != value]
    if not others.size:
        return False
    share = 1.0 - others.size / known.size
    well_known = value in _MISSING or set(f"{abs(value):.6g}".replace(".", "").split("e")[0]) == {"9"}
    few = others[:: max(1, others.size // _SUBSAMPLE)]
    spread = float(np.ptp(np.percentile(few, (0.5, 99.5))))
    gap = float(np.abs(others - value).min())
    if well_known:
        return share <= _MOST_MISSING and gap > _APART * spread
    return (
        0.0 < share <= _MOST_OTHERS
        and spread > 0.0
        and gap > _FAR_APART * spread
        and share * known.size > 1.5
    )


def _squared(
    path: Path, z: NDArray[np.float64], x_mm: float, y_mm: float
) -> tuple[NDArray[np.float64], float]:
    """Heights on a square grid, and its pitch.

    The coarser axis is resampled linearly to the finer pitch; where one pitch is more than four times the
    other, the finer axis is resampled to the coarser pitch instead. What touches a dropout stays one.
    """
    finer, coarser = sorted((x_mm, y_mm))
    if coarser / finer - 1.0 <= SAME_PITCH:
        return z, 0.5 * (finer + coarser)
    pitch = coarser if coarser / finer > MUCH_FINER else finer
    rows, cols = (_count(n, p, pitch) for n, p in zip(z.shape, (y_mm, x_mm), strict=True))
    check_size(path, rows, cols)
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
