"""Staggered rows of a comb: convert between samples by time and samples by position on the plate.

by time               row 0   |a b c d e f - - -|        instant j: row r is over position j - behind[r]
                      row 1   |- - - a b c d e f|
by position           row 0   |a b c d e f|
                      row 1   |a b c d e f|              only the stretch that all rows cover is kept
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whisker_array.arrays import Floats


def to_instants(
    by_position: NDArray[Any], behind: NDArray[np.intp], *, outside: float | None = None
) -> NDArray[Any]:
    """Convert (passes, whiskers, samples) from position to time; `outside` fills before and after a row's samples."""
    n = by_position.shape[2]
    place = np.arange(n + int(behind.max(initial=0))) - behind[:, None]
    out = np.take_along_axis(by_position, np.clip(place, 0, n - 1)[None], axis=2)
    if outside is not None:
        out[:, (place < 0) | (place >= n)] = outside
    return out


def to_places(by_time: NDArray[Any], behind: Floats | NDArray[np.intp]) -> NDArray[Any]:
    """Convert samples by time to samples by position, over the stretch that all rows cover; flags are combined."""
    late = np.floor(behind).astype(np.intp)
    part = np.asarray(behind, dtype=np.float64) - late
    n = by_time.shape[2] - int(np.ceil(behind).max(initial=0))
    instant = (np.arange(n) + late[:, None])[None]
    here = np.take_along_axis(by_time, instant, axis=2)
    if not part.any():
        return here
    following = np.minimum(instant + 1, by_time.shape[2] - 1)
    after = np.take_along_axis(by_time, following, axis=2)
    between = part[None, :, None]
    if np.issubdtype(by_time.dtype, np.integer):
        return np.asarray(np.where(between > 0.0, here | after, here))
    return np.asarray((1.0 - between) * here + between * after, dtype=by_time.dtype)
