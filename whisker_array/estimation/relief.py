"""Height and slope maps of the surface, and the route by which they were measured.

Each position on a line is traced in up to four ways, all of which depend on the same lift and slope (`estimate`)::

    route       traced by                                 gives
    PROFILED    a profiler and differentiators            height from the first, slope from the others
    TURNED      a differentiator dragged both ways        height and slope, at the friction known or assumed
    FLOORS      a differentiator dragged one way          height on floors and land only (F = 1 there)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import ANY_ORDER, kernel, read_only
from glyphs.ranges import Positive, Validated
from glyphs.surface.display import OneLine, picture_html
from glyphs.surface.maps import OPPOSITE_DIRECTIONS, EdgeMap, MapError
from whisker_array.estimation.estimate import is_profiler, moment_per_lift, tip_shift_mm
from whisker_array.simulation.contact import land_lag_mm
from whisker_array.whisker.touch import Touch

STEEPEST = 3.0
"""Slopes are clipped here, at 72 degrees; no die is steeper, so beyond is noise at an edge."""


class Route(StrEnum):
    """Routes by which height and slope are separated."""

    PROFILED = "profiled"
    TURNED = "turned"
    FLOORS = "floors"


@dataclass(frozen=True, eq=False, repr=False)
class Relief(OneLine, Validated, error=MapError):
    """Height and slopes of the surface, (rows, cols) float32 on a grid of the plate frame, above the land, NaN where
    unknown. A slope, dh/dx or dh/dy, is None where no trace ran along that axis both ways (or with a profiler). The
    friction of every pixel needs a profiler and two ways."""

    height_mm: NDArray[np.float32]
    slope_x: NDArray[np.float32] | None
    slope_y: NDArray[np.float32] | None
    pitch_mm: Positive
    origin_mm: tuple[float, float]
    friction: float
    friction_sd: float | None
    route: Route
    friction_map: NDArray[np.float32] | None = None

    def _repr_html_(self) -> str:
        return picture_html(self, self.height_mm)

    def __post_init__(self) -> None:
        for slope in (self.slope_x, self.slope_y, self.friction_map):
            if slope is not None and slope.shape != self.height_mm.shape:
                raise MapError(f"maps of {slope.shape} do not fit the heights {self.height_mm.shape}")
        super().__post_init__()

    @property
    def steepness(self) -> NDArray[np.float32]:
        """(rows, cols) |grad h| from its known components; zero if none is known."""
        parts = [s for s in (self.slope_x, self.slope_y) if s is not None]
        if not parts:
            return np.zeros(self.height_mm.shape, dtype=np.float32)
        return np.sqrt(np.sum([s * s for s in parts], axis=0, dtype=np.float32))


@kernel(allow=ANY_ORDER)
def both_ways(ahead, back, row, arm, mu, land, steepest, slope, total, count):  # type: ignore[no-untyped-def]
    """Compute the slope along the traces, and add the known lifts of both directions, in preloads, to `total`.

    Enhancement (rows, cols) is that of the two ways, the base ahead in + and in -; row and arm (3,) are those of the
    tip, as in eqs. (11) and (14). The slope (rows, cols) is NaN where none fits the moments; `count` counts the lifts.
    """
    # m = lift (a - b p) / (c - e p) one way, p = -p the other: R'a ~ (-mu - p, 1 - mu p)
    a, b = arm[1] - arm[0] * mu, arm[1] * mu + arm[0]
    c, e = row[1] - row[0] * mu, row[1] * mu + row[0]
    rows, cols = slope.shape
    for i in range(rows):
        for j in range(cols):
            forward, other = (1.0 + ahead[i, j]) * land, (1.0 + back[i, j]) * land
            q = forward / other
            square, linear, constant = b * e * (q - 1.0), (a * e - b * c) * (1.0 + q), a * c * (1.0 - q)
            disc = linear * linear - 4.0 * square * constant
            # the root nearer to zero; NaN if none is real
            p = -2.0 * constant / (linear + math.copysign(math.sqrt(disc), linear))
            p = -steepest if p < -steepest else p
            p = steepest if p > steepest else p
            slope[i, j] = p
            # the lean's tangent, tan(atan(p) + atan(mu)); beyond 90 degrees no force lifts the tip
            up, down = 1.0 - p * mu, 1.0 + p * mu
            t, s = (mu + p) / up, (mu - p) / down
            give_t, give_s = row[1] - row[0] * t, row[1] - row[0] * s
            lift_t, lift_s = forward * give_t / (arm[1] - arm[0] * t), other * give_s / (arm[1] - arm[0] * s)
            known_t = up > 0.0 and give_t > 0.0 and abs(lift_t) < np.inf
            known_s = down > 0.0 and give_s > 0.0 and abs(lift_s) < np.inf
            total[i, j] += (lift_t if known_t else 0.0) + (lift_s if known_s else 0.0)
            count[i, j] += (1 if known_t else 0) + (1 if known_s else 0)


def relief_from_edges(edges: EdgeMap, touch: Touch, *, friction: float | None = None) -> Relief:
    """Compute height and slopes from traces in opposite directions. Raises MapError."""
    mu, tip = touch.friction if friction is None else friction, touch.tip
    by_direction = dict(zip(edges.directions, edges.enhancement, strict=True))
    total, count = np.zeros(edges.shape), np.zeros(edges.shape, dtype=np.uint8)
    route = Route.PROFILED if is_profiler(tip) else Route.FLOORS
    land = float(moment_per_lift(np.arctan(mu), tip))
    if route is not Route.PROFILED and not np.isfinite(land):
        raise MapError(f"at a friction of {mu} the whisker jams on the land", hint="check the friction")
    slopes = {}
    for axis, (ahead, back) in enumerate(OPPOSITE_DIRECTIONS):
        if route is Route.PROFILED or ahead not in by_direction or back not in by_direction:
            continue
        route, slopes[axis] = Route.TURNED, np.empty(edges.shape, dtype=np.float32)
        maps = map(read_only, (by_direction[ahead], by_direction[back]))
        of_tip = map(read_only, (tip.compliance_mm_per_n[1], tip.moment_arm_mm))
        both_ways(*maps, *of_tip, mu, land, STEEPEST, slopes[axis], total, count)
    # where no way separates it from the slope, the height is that of floors and land (F = 1)
    lift = 1.0 + edges.enhancement.mean(axis=0, dtype=np.float64)
    if route is Route.TURNED:
        lift = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    height = ((lift - 1.0) * touch.preload_mm).astype(np.float32)
    for layer in (height, *slopes.values()):
        layer[~edges.valid] = np.nan
    return Relief(
        height_mm=height,
        slope_x=slopes.get(0),
        slope_y=slopes.get(1),
        pitch_mm=edges.pitch_mm,
        origin_mm=edges.origin_mm,
        friction=mu,
        friction_sd=None,
        route=route,
    )


def move_to_tips(edges: EdgeMap, touch: Touch, relief: Relief) -> EdgeMap:
    """Move every value of an edge map from the position of the stage to that of the tip, which walls deflect. One round
    reduces the error of 45 degree slopes from 10 degrees to 2."""
    from scipy.ndimage import map_coordinates

    lag = land_lag_mm(touch.tip, preload_mm=touch.preload_mm, friction=touch.friction)
    rows, cols = np.indices(relief.height_mm.shape, dtype=np.float64)
    lift = touch.preload_mm + np.nan_to_num(relief.height_mm.astype(np.float64))
    phi = np.arctan(relief.friction)
    layers = []
    for layer, direction in zip(edges.enhancement, edges.directions, strict=True):
        slope = relief.slope_x if direction.along_x else relief.slope_y
        tau = 0.0 if slope is None else direction.sign * np.arctan(np.nan_to_num(slope.astype(np.float64)))
        bent = tip_shift_mm(np.minimum(tau + phi, 1.5), lift, touch.tip) - lag
        pixels = direction.sign * np.nan_to_num(bent) / edges.pitch_mm
        moved = (rows, cols - pixels) if direction.along_x else (rows - pixels, cols)
        layers.append(map_coordinates(layer.astype(np.float64), moved, order=1, mode="nearest"))
    return replace(edges, enhancement=np.stack(layers).astype(np.float32))
