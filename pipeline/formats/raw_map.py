"""Raw heights of a file: every reader returns them, and `pipeline.formats.grid` turns them into a map."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import MAX_PIXELS
from pipeline.errors import DataError

# heights that programs write for missing points; besides these all numbers of nines, such as -99.99 and -9999
_MISSING = (-32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0)
# least distance of such a height from all others, in ranges of the others; and the same for any other marker
_APART, _FAR_APART = 2.0, 100.0
# share of the points that may be missing, for the well-known heights and for other markers
_MOST_MISSING, _MOST_OTHERS = 0.9, 0.2
# shares of the points that may have an isolated value, and its least distance from all others in ranges of the others
_LEAST_SHARED, _MOST_SHARED, _ISOLATED = 0.001, 0.5, 8.0
_SUBSAMPLE = 200_000
# problems and hints of files of every format
PROFILE = ("holds a profile", "measure a surface")
CUT_SHORT = ("is damaged: it ends too soon", "copy or export it again")


@dataclass(frozen=True)
class RawMap:
    """Heights on a grid in the numbers of their file."""

    z: NDArray[np.number]  # (rows, cols) heights; NaN for dropouts
    x_pitch: float | None = None  # distance of columns; None where the file does not state it
    y_pitch: float | None = None
    z_mm: float | None = None  # millimetres in one unit of `z`, as the file or its format states
    xy_mm: float | None = None  # millimetres in one unit of the pitches, likewise
    bottom_first: bool = False  # the first row of `z` is the lowest one of the part, as a reader sees it
    rows_stated: bool = False  # by the file, or every writer of its format has the same row first
    one_unit: bool = False  # heights and distances have one unit, as the coordinates of a mesh
    soil: Soil | None = None
    unit: str = ""  # that the file states for its heights; empty where the format alone or nothing does


def check_size(rows: int, cols: int, most: int = MAX_PIXELS) -> None:
    """Refuse a map of more samples than the limit (DataError), before it is loaded."""
    if rows * cols > most:
        what = f"has {rows:,} x {cols:,} samples, over the limit of {most:,}"
        raise DataError(what, "crop or thin the map")


def numbers_in(
    data: bytes, kind: DTypeLike, start: int, shape: tuple[int, ...], most: int = MAX_PIXELS
) -> NDArray[Any]:
    """Numbers of a file of known size from a byte on, or records of them. Raises DataError: too many or too few."""
    check_size(shape[0], math.prod(shape[1:]), most)
    if len(data) < start + np.dtype(kind).itemsize * math.prod(shape):
        raise DataError(*CUT_SHORT)
    return np.frombuffer(data, kind, count=math.prod(shape), offset=start).reshape(shape)


def without_bad_points(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Replace infinities and the marker of missing points, a frequent extreme far from all others, by NaN, in place."""
    return _without_markers(z, _stands_for_missing)


def without_isolated_value(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Replace the lowest or highest value by NaN, in place, if many samples share it and no other comes near it."""
    return _without_markers(z, _is_isolated)


def _without_markers(
    z: NDArray[np.float64], is_marker: Callable[[float, int, float, float, float], bool]
) -> NDArray[np.float64]:
    z[~np.isfinite(z)] = np.nan
    z[np.abs(z) > 1e30] = np.nan
    for _ in range(2):  # one below all others and one above
        known = z[np.isfinite(z)]
        if known.size < 2:
            break
        for end in (float(known.min()), float(known.max())):
            others = known[known != end]
            if others.size and is_marker(end, known.size, *_isolation(end, others, known.size)):
                z[z == end] = np.nan
    return z


def _stands_for_missing(value: float, count: int, share: float, spread: float, gap: float) -> bool:
    well_known = value in _MISSING or set(f"{abs(value):.6g}".replace(".", "").split("e")[0]) == {"9"}
    if well_known:
        return share <= _MOST_MISSING and gap > _APART * spread
    often = 0.0 < share <= _MOST_OTHERS and share * count > 1.5
    return often and spread > 0.0 and gap > _FAR_APART * spread


def _is_isolated(_value: float, _count: int, share: float, spread: float, gap: float) -> bool:
    return _LEAST_SHARED <= share <= _MOST_SHARED and spread > 0.0 and gap > _ISOLATED * spread


def _isolation(value: float, others: NDArray[np.float64], count: int) -> tuple[float, float, float]:
    """Share of `count` heights that have the value, range of the others, and distance of the nearest one."""
    few = others[:: max(1, others.size // _SUBSAMPLE)]
    spread = float(np.ptp(np.percentile(few, (0.5, 99.5))))
    return 1.0 - others.size / count, spread, float(np.abs(others - value).min())
