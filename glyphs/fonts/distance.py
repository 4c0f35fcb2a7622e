"""Compiled distance kernels: points to segments, and the winding number of closed polygons.

Points are handled in tiles; segments too far from a tile are skipped for all of its points at once:

    .-------.         nearest segment to the middle: d        a segment nearer to some point than that one
    |   x   |  r      is no farther from the middle than d + 2 r
    '-------'
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import FAST, kernel

_ROWS, _COLUMNS = 8, 16
"""Rows and columns of a tile: few, so that it is small, but enough for vector instructions along its rows."""


@kernel(allow=FAST)
def _least_squared_distance(x, y, segments, reach, nearby, out):  # type: ignore[no-untyped-def]
    # x, y and out, which starts at infinity, are (rows, columns); reach and nearby are work arrays, (m,): squared
    # distance of each segment from the tile's middle, and indices of the segments near the tile
    rows, columns = x.shape
    for top in range(0, rows, _ROWS):
        bottom = min(top + _ROWS, rows)
        for left in range(0, columns, _COLUMNS):
            right = min(left + _COLUMNS, columns)
            x0, x1, y0, y1 = x[top, left], x[top, left], y[top, left], y[top, left]
            for i in range(top, bottom):
                for j in range(left, right):
                    x0, x1 = min(x0, x[i, j]), max(x1, x[i, j])
                    y0, y1 = min(y0, y[i, j]), max(y1, y[i, j])
            mx, my = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
            nearest = np.inf
            for k in range(segments.shape[0]):
                ax, ay = segments[k, 0], segments[k, 1]
                dx, dy = segments[k, 2] - ax, segments[k, 3] - ay
                length2 = dx * dx + dy * dy
                inverse = 1.0 / length2 if length2 > 0.0 else 0.0
                t = min(max(((mx - ax) * dx + (my - ay) * dy) * inverse, 0.0), 1.0)
                ex, ey = mx - ax - t * dx, my - ay - t * dy
                reach[k] = ex * ex + ey * ey
                nearest = min(nearest, reach[k])
            # twice the radius of the tile, and a little for rounding
            far = np.sqrt(nearest) + 1.000001 * np.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)) + 1e-9
            count = 0
            for k in range(segments.shape[0]):
                if reach[k] <= far * far:
                    nearby[count] = k
                    count += 1
            for n in range(count):
                k = nearby[n]
                ax, ay = segments[k, 0], segments[k, 1]
                dx, dy = segments[k, 2] - ax, segments[k, 3] - ay
                length2 = dx * dx + dy * dy
                inverse = 1.0 / length2 if length2 > 0.0 else 0.0
                for i in range(top, bottom):
                    for j in range(left, right):
                        px, py = x[i, j] - ax, y[i, j] - ay
                        t = min(max((px * dx + py * dy) * inverse, 0.0), 1.0)
                        ex, ey = px - t * dx, py - t * dy
                        out[i, j] = min(out[i, j], ex * ex + ey * ey)


def segment_distance(
    x: NDArray[np.float64], y: NDArray[np.float64], segments: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance, (rows, columns), of each point from the nearest of (m, 4) segments or points; inf without any."""
    out = np.full(x.shape, np.inf)
    count = len(segments)
    if count:
        _least_squared_distance(x, y, segments, np.empty(count), np.empty(count, np.int64), out)
    return np.asarray(np.sqrt(out))


@kernel()
def _count_windings(x, y, segments, out):  # type: ignore[no-untyped-def]
    rows, columns = x.shape
    for top in range(0, rows, _ROWS):
        bottom = min(top + _ROWS, rows)
        y0, y1 = y[top, 0], y[top, 0]
        for i in range(top, bottom):
            for j in range(columns):
                y0, y1 = min(y0, y[i, j]), max(y1, y[i, j])
        for k in range(segments.shape[0]):
            ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
            if max(ay, by) < y0 or min(ay, by) > y1:
                continue
            for i in range(top, bottom):
                for j in range(columns):
                    if (ay <= y[i, j]) != (by <= y[i, j]):
                        side = (bx - ax) * (y[i, j] - ay) - (x[i, j] - ax) * (by - ay)
                        if ay <= y[i, j]:
                            if side > 0.0:
                                out[i, j] += 1
                        elif side < 0.0:
                            out[i, j] -= 1


def winding_number(
    x: NDArray[np.float64], y: NDArray[np.float64], segments: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Winding number (int32) of closed polygons, directed segments (m, 4), about every point (rows, columns). Upward
    edges count when the point lies strictly to their left, downward edges when strictly to their right (D. Sunday's
    rule), so a horizontal edge never counts twice."""
    out = np.zeros(x.shape, np.int32)
    if x.size:
        _count_windings(x, y, segments, out)
    return out
