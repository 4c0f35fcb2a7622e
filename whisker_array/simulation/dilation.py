"""Heights of a resting ball tip.

A ball of radius r resting on z(x) has its lowest point at the *dilated* height (ISO 16610-41, the tip's
morphological closing of valleys)::

            ___                h_d(x) = max over |u| <= r of  z(x + u) + sqrt(r^2 - u^2) - r
           /   \\
    ------(  r  )------        a groove narrower than the ball appears shallower,
          .\\_._/.              a ridge wider.
    _____/  h_d  \\____
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import FAST, kernel, read_only
from glyphs.ranges import require_not_negative
from whisker_array.simulation.threads import in_threads
from whisker_array.whisker.sections import WhiskerError

_MOST_REACH = 60
_BLOCK = 64
"""Number of columns dilated together, or skipped if nothing around them is higher."""


def dilate_by_ball(z_mm: NDArray[np.float32], *, pitch_mm: float, radius_mm: float) -> NDArray[np.float32]:
    """Height of the lowest point of a ball tip resting on the surface, (rows, cols) float32, mm.

    The ball is evaluated at the offsets of the grid, so its bottom is exact and its flank is sampled; a radius below
    one pitch leaves the surface unchanged. Beyond the border the edge values are repeated. Raises WhiskerError.
    """
    require_not_negative(WhiskerError, radius_mm=radius_mm)
    reach = int(np.floor(radius_mm / pitch_mm))
    if reach < 1:
        return z_mm
    if reach > _MOST_REACH:
        raise WhiskerError(
            f"a tip of {radius_mm} mm spans {reach} samples of {pitch_mm} mm",
            hint="thin the map or use a finer tip",
        )
    offsets = np.arange(-reach, reach + 1)
    square = radius_mm**2 - (offsets[:, None] ** 2 + offsets**2) * pitch_mm**2
    lift = (np.sqrt(np.maximum(square, 0.0)) - radius_mm).astype(np.float32)
    half = (square >= 0.0).sum(axis=1) // 2
    padded = np.pad(np.ascontiguousarray(z_mm, dtype=np.float32), reach, mode="edge")
    # highest point that the balls of each row and block can touch
    ends = [(left, min(left + _BLOCK, z_mm.shape[1]) + 2 * reach) for left in range(0, z_mm.shape[1], _BLOCK)]
    highest = np.stack([padded[:, first:end].max(axis=1) for first, end in ends], axis=1)
    out = np.array(z_mm, dtype=np.float32)
    arrays = read_only(padded), read_only(lift), read_only(half), read_only(highest), reach, out
    in_threads(lambda first, last: _dilate(first, last, *arrays), z_mm.shape[0])
    return out


@kernel(allow=FAST)
def _dilate(first, last, padded, lift, half, highest, reach, out):  # type: ignore[no-untyped-def]
    for r in range(first, last):
        for left in range(0, out.shape[1], _BLOCK):
            right = min(left + _BLOCK, out.shape[1])
            here = out[r, left:right]
            lowest, top = here[0], highest[r, left // _BLOCK]
            for c in range(here.size):
                lowest = min(lowest, here[c])
            for i in range(1, 2 * reach + 1):
                top = max(top, highest[r + i, left // _BLOCK])
            # where nothing around is higher, the ball rests on the sample itself
            if lowest >= top:
                continue
            for i in range(2 * reach + 1):
                for j in range(reach - half[i], reach + half[i] + 1):
                    up, there = lift[i, j], padded[r + i, left + j : right + j]
                    for c in range(here.size):
                        here[c] = max(here[c], there[c] + up)
