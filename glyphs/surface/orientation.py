"""The plane of a plate in a cloud of points, and its surface of triangles seen from above."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel

Points = NDArray[np.float64]


def plate_normal(
    points: Points,  # (n, 3), finite
    *,
    rounds: int = 5,
    thin: float = 0.1,  # most thickness of a plate over its shorter side, standard deviations
    upright: float = 0.17,  # least z of a normal that tells the side of the scanner: 10 degrees
) -> Points | None:
    """Unit normal of a plate, towards its outside; None if the points have no thin direction: the third principal axis
    of the points within three robust standard deviations of the plane. A scanner's z points at the scanner, so the
    outside is where z is positive; for an upright plate, the positive side of the axis nearest to its normal."""
    inlier = np.ones(len(points), dtype=np.bool_)
    for _ in range(rounds):
        offset = points - points[inlier].mean(axis=0)
        spread, axes = np.linalg.eigh(np.cov(offset[inlier].T))
        normal, far = axes[:, 0], offset @ axes[:, 0]
        middle = np.median(far)
        inlier = np.abs(far - middle) <= 3.0 * 1.4826 * np.median(np.abs(far - middle)) + 1e-12
        if inlier.sum() < 4:
            return None
    if not 1e-6 < np.std(offset @ normal) / math.sqrt(max(float(spread[1]), 1e-300)) <= thin:
        return None  # a body, or a profile: points without any thickness
    facing = normal[2] if abs(normal[2]) > upright else normal[np.argmax(np.abs(normal))]
    return np.asarray(normal if facing > 0.0 else -normal)


def rotation_to_z(normal: Points) -> Points:
    """(3, 3) shortest rotation that turns a direction to +z."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.align_vectors([[0.0, 0.0, 1.0]], normal[None])[0].as_matrix())


@kernel()
def draw_triangles(z, places, faces):  # type: ignore[no-untyped-def]
    """Raise z (rows, cols), NaN if empty, to the triangles of points (n, 3): column, row, height."""
    for i in range(faces.shape[0]):
        a, b, c = places[faces[i, 0]], places[faces[i, 1]], places[faces[i, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if abs(area) < 1e-12:  # a wall
            continue
        # slopes of its plane, and limits of its heights: the slopes of a thin triangle are inaccurate
        across = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) / area
        down = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) / area
        low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        first, last = math.ceil(min(a[1], b[1], c[1]) - 1e-6), math.floor(max(a[1], b[1], c[1]) + 1e-6)
        for v in range(max(0, first), min(z.shape[0] - 1, last) + 1):
            left, right = np.inf, -np.inf
            for p, q in ((a, b), (b, c), (c, a)):
                if abs(q[1] - p[1]) < 1e-9:
                    crossing = p[0], q[0]
                else:
                    share = (v - p[1]) / (q[1] - p[1])
                    x = p[0] + min(max(share, 0.0), 1.0) * (q[0] - p[0])
                    crossing = x, x
                if min(p[1], q[1]) - 1e-6 <= v <= max(p[1], q[1]) + 1e-6:
                    left, right = min(left, crossing[0], crossing[1]), max(right, crossing[0], crossing[1])
            if left > right:
                continue
            for u in range(max(0, math.ceil(left - 1e-6)), min(z.shape[1] - 1, math.floor(right + 1e-6)) + 1):
                height = min(max(a[2] + across * (u - a[0]) + down * (v - a[1]), low), high)
                if not z[v, u] >= height:
                    z[v, u] = height
