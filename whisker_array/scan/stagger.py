"""Staggered rows of a comb: convert between samples by time and samples by position on the plate.

taken (instants)      row 0   |a b c d e f - - -|        instant j: row r is over place j - behind[r]
                      row 1   |- - - a b c d e f|
laid  (places)        row 0   |a b c d e f|
                      row 1   |a b c d e f|              what is outside all rows' stretch is not kept
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def to_instants(
    laid: NDArray[Any], behind: NDArray[np.intp], *, outside: float | None = None
) -> NDArray[Any]:
    """Convert samples by position to samples by time; each row waits on its first sample and ends on its last.

    Args:
        laid: (passes, whiskers, samples) at places.
        behind: (whiskers,) samples by which each whisker comes later.
        outside: value before and behind a row's own samples; default: its first and last.

    Returns:
        (passes, whiskers, samples + greatest of behind).
    """
    n = laid.shape[2]
    late = int(behind.max(initial=0))
    if not late:
        return laid
    place = np.arange(n + late) - behind[:, None]
    out = np.take_along_axis(laid, np.clip(place, 0, n - 1)[None], axis=2)
    if outside is not None:
        out[:, (place < 0) | (place >= n)] = outside
    return out


def to_places(taken: NDArray[Any], behind: NDArray[np.float64] | NDArray[np.intp]) -> NDArray[Any]:
    """Convert samples by time to samples by position, over the stretch that all rows ran.

    A row that comes to its places between two samples has them by a straight line; bits of flags are gathered.

    Args:
        taken: (passes, whiskers, instants).
        behind: (whiskers,) samples by which each whisker comes later, whole or not.
    """
    late = np.floor(behind).astype(np.intp)
    part = np.asarray(behind, dtype=np.float64) - late
    n = taken.shape[2] - int(np.ceil(behind).max(initial=0))
    instant = (np.arange(n) + late[:, None])[None]
    here = np.take_along_axis(taken, instant, axis=2)
    if not part.any():
        return here
    following = np.minimum(instant + 1, taken.shape[2] - 1)
    after = np.take_along_axis(taken, following, axis=2)
    between = part[None, :, None]
    if np.issubdtype(taken.dtype, np.integer):
        return np.asarray(np.where(between > 0.0, here | after, here))
    return np.asarray((1.0 - between) * here + between * after, dtype=taken.dtype)
