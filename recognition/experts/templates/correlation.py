"""Sums of stretches of pixels, each times a value: what correlations of sparse templates are made of.

With an image's rows end to end, the shifts of one of a template's pixels along a row are a stretch of pixels, added to
a stretch of sums.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import ANY_ORDER, kernel

Image: TypeAlias = NDArray[np.float32]
LEAST_INK = 1e-4
"""Of a template's largest value, below which its pixels predict nothing."""


@kernel(allow=ANY_ORDER)
def add_stretches(total, low, size, flat, at, value, first, last):  # type: ignore[no-untyped-def]
    """total[low + i] += sum of value[n] * flat[at[n] + i] over first <= n < last; eight at once, to save on stores."""
    begin, n = np.uint64(low), first  # what has no sign need not be looked at as an index from the end
    while n + 8 <= last:
        v0, v1, v2, v3 = value[n], value[n + 1], value[n + 2], value[n + 3]
        v4, v5, v6, v7 = value[n + 4], value[n + 5], value[n + 6], value[n + 7]
        a0, a1, a2, a3 = np.uint64(at[n]), np.uint64(at[n + 1]), np.uint64(at[n + 2]), np.uint64(at[n + 3])
        a4, a5, a6, a7 = (
            np.uint64(at[n + 4]),
            np.uint64(at[n + 5]),
            np.uint64(at[n + 6]),
            np.uint64(at[n + 7]),
        )
        for j in range(size):
            i = np.uint64(j)
            some = v0 * flat[a0 + i] + v1 * flat[a1 + i] + v2 * flat[a2 + i] + v3 * flat[a3 + i]
            more = v4 * flat[a4 + i] + v5 * flat[a5 + i] + v6 * flat[a6 + i] + v7 * flat[a7 + i]
            total[begin + i] += some + more
        n += 8
    while n < last:
        v0, a0 = value[n], np.uint64(at[n])
        for j in range(size):
            i = np.uint64(j)
            total[begin + i] += v0 * flat[a0 + i]
        n += 1
