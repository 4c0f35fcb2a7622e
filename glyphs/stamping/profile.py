"""Cross-section of a groove: a wall of constant slope with circular fillets at both ends."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Number = float | NDArray[np.float32]

_LEAST = 1e-9  # mm; avoids an empty range when the radius vanishes


def round_radius(depth: Number, half_width: Number, *, bevel_rad: float) -> Number:
    """Radius of the widest arc that rounds the floor of a groove of that depth, tangent to both walls, mm."""
    tan_half = math.tan(bevel_rad / 2)
    fit = (half_width - depth / math.tan(bevel_rad)) / tan_half
    # a quarter of the arc that spans the whole groove: a narrow groove stays round but becomes shallower
    least = 0.25 * half_width / math.sin(bevel_rad)
    return np.minimum(np.maximum(fit, least), depth / (math.sin(bevel_rad) * tan_half))


def sunk_depth(
    inside: NDArray[np.float32],
    *,
    depth: Number,
    # half the width of the groove if known: a V then has its root fillet at the middle, where the walls meet.
    # None: the walls continue until they meet.
    half_width: Number | None,
    bevel_rad: float,
    root_radius: Number,
    edge_radius: float,  # fillet of wall and land, mm; covers at most 0.3 of the wall
) -> NDArray[np.float32]:
    """Depth below the land, mm, as a function of the distance inside the groove's edge."""
    slope, sine, cosine, tan_half = (
        math.tan(bevel_rad), math.sin(bevel_rad), math.cos(bevel_rad), math.tan(bevel_rad / 2)
    )  # fmt: skip
    floor: Number = depth
    if half_width is not None:
        root_radius = np.minimum(root_radius, half_width / sine)
        floor = np.minimum(depth, half_width * slope - root_radius * (1 / cosine - 1))
    wall = floor / sine
    edge_run = np.minimum(edge_radius * tan_half, 0.3 * wall)
    root_run = np.minimum(root_radius * tan_half, wall - edge_run)
    corner = floor / slope
    out = np.clip(inside * np.float32(slope), 0.0, floor)
    if edge_radius > 0.0:
        radius = edge_run / tan_half
        reach = np.clip(inside + edge_run, 0.0, radius * sine)
        out = np.where(inside < edge_run * cosine, radius - np.sqrt(radius**2 - reach**2), out)
    if np.any(np.asarray(root_radius) > 0.0):
        radius = root_run / tan_half
        reach = np.clip(corner + root_run - inside, 0.0, np.maximum(radius * sine, _LEAST))
        arc = floor - radius + np.sqrt(np.maximum(radius**2 - reach**2, 0.0))
        out = np.where(inside > corner - root_run * cosine, arc, out)
    return np.asarray(out, dtype=np.float32)
