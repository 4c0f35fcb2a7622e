"""Names of array types, and a quantile of arrays with unknown values."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
AnyFloats: TypeAlias = NDArray[np.floating[Any]]
Mask: TypeAlias = NDArray[np.bool_]


def quantile_of_known(
    values: AnyFloats, q: float = 0.5, *, fewest: int = 1, most_places: int = 4
) -> AnyFloats:
    """Quantile of the known values along the last axis, like `np.nanquantile`, which is much slower for many rows.

    Rows with different numbers of known values have it at different places; up to `most_places` are found unsorted.
    """
    if not values.shape[-1]:
        return np.full(values.shape[:-1], np.nan)
    known = (values < np.inf).sum(axis=-1)
    last = np.maximum(known - 1, 0)
    below = (q * last).astype(np.intp)
    above = np.minimum(below + 1, last)
    places = np.unique((below, above))
    few = places.size <= most_places
    ordered = np.partition(values, places, axis=-1) if few else np.sort(values, axis=-1)
    low, high = (np.take_along_axis(ordered, k[..., None], axis=-1)[..., 0] for k in (below, above))
    return np.where(known >= fewest, low + (q * last - below) * (high - low), np.nan)
