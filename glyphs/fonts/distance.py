"""Compiled distance kernels: points to segments, and the winding number of closed polygons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import FAST, kernel

_CHUNK = 1024  # points handled together: three float64 buffers of this length stay in the first-level cache


@kernel(allow=FAST)
def _least_squared_distance(x, y, segments, out):  # type: ignore[no-untyped-def]
    """Write the squared distance of each point from the nearest segment into `out`, infinite at first."""
    n = x.size
    for start in range(0, n, _CHUNK):
        stop = min(start + _CHUNK, n)
        for k in range(segments.shape[0]):
            ax, ay = segments[k, 0], segments[k, 1]
            dx, dy = segments[k, 2] - ax, segments[k, 3] - ay
            length2 = dx * dx + dy * dy
            inverse = 1.0 / length2 if length2 > 0.0 else 0.0
            for i in range(start, stop):
                px, py = x[i] - ax, y[i] - ay
                t = min(max((px * dx + py * dy) * inverse, 0.0), 1.0)
                ex, ey = px - t * dx, py - t * dy
                out[i] = min(out[i], ex * ex + ey * ey)


def segment_distance(
    x: NDArray[np.float64], y: NDArray[np.float64], segments: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance of every point from the nearest segment.

    Args:
        x: (n,) coordinates, any unit.
        y: (n,) coordinates in the same unit.
        segments: (m, 4) end points x0, y0, x1, y1; a segment of zero length is a point.

    Returns:
        (n,) distances; infinity when there is no segment.
    """
    out = np.full(x.size, np.inf)
    _least_squared_distance(x, y, segments, out)
    return np.asarray(np.sqrt(out))


@kernel()
def _count_windings(x, y, segments, out):  # type: ignore[no-untyped-def]
    n = x.size
    for start in range(0, n, _CHUNK):
        stop = min(start + _CHUNK, n)
        for k in range(segments.shape[0]):
            ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
            for i in range(start, stop):
                if (ay <= y[i]) != (by <= y[i]):
                    left = (bx - ax) * (y[i] - ay) - (x[i] - ax) * (by - ay)
                    if ay <= y[i]:
                        if left > 0.0:
                            out[i] += 1
                    elif left < 0.0:
                        out[i] -= 1


def winding_number(
    x: NDArray[np.float64], y: NDArray[np.float64], segments: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Winding number of closed polygons, given as directed segments (m, 4), about every point (n,).

    Returns:
        (n,) int32. Upward edges count when the point lies strictly to their left, downward edges when it lies
        strictly to their right (D. Sunday's rule), so a horizontal edge never counts twice.
    """
    out = np.zeros(x.size, np.int32)
    _count_windings(x, y, segments, out)
    return out
