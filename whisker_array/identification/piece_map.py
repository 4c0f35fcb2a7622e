r"""Map of the test piece, and its pose under the recorded lines.

    plate --shift, yaw--> piece --ASKEW_RAD--> map         trace --direction--> plate

The grid is slightly rotated, so that a wall of the piece crosses it at all phases and the error differs on every
line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from whisker_array.arrays import Floats
from whisker_array.identification.bench import Bench, Unknown
from whisker_array.identification.traces import Trace
from whisker_array.simulation.contact import SurfacePose
from whisker_array.simulation.surface import TouchSurface, dilated_fields
from whisker_array.simulation.threads import in_threads
from whisker_array.whisker.sections import WhiskerError

Heights = Callable[[Floats, Floats], Floats]
"""Height above the land, mm, at positions on the piece, x and y in mm."""
MARGIN_MM = 1.0
"""Margin of a map around its lines, for shifts of the piece and slips of the tip."""
ASKEW_RAD = 0.05
_ROWS_AT_ONCE = 16
"""Number of rows computed at once, so that they stay in the cache."""
RADIUS_STEP = 0.1
"""Relative step of a tip's radius over which the signal changes nearly linearly, for any grid."""


def heights_of(surface: HeightMap) -> Heights:
    """Make a map's interpolating function, its edge values repeated. Raises MapError if the map has holes."""
    if np.isnan(surface.z_mm).any():
        raise MapError("the piece's map has places that were not measured", hint="fill them, or cut them off")
    rows, cols = surface.shape

    def at(x_mm: Floats, y_mm: Floats) -> Floats:
        from scipy.ndimage import map_coordinates

        places = np.broadcast_arrays(
            np.clip(y_mm / surface.pitch_mm, 0, rows - 1), np.clip(x_mm / surface.pitch_mm, 0, cols - 1)
        )
        return np.asarray(map_coordinates(surface.z_mm, places, order=1, mode="nearest"), dtype=np.float64)

    return at


class PieceMap:
    """The piece dilated by the tip, on a rotated grid, for all poses and directions (`contact.SurfacePose`), and tip
    radii in steps of `RADIUS_STEP`; extrapolated maps would have notches that catch tips."""

    def __init__(self, heights: Heights, traces: Iterable[Trace], *, about: Bench, grid_mm: float) -> None:
        ends = np.array([end for trace in traces for end in _ends_mm(trace)])
        askew = _turn(ASKEW_RAD) @ (_turn(math.radians(about[Unknown.YAW])) @ (ends - _shift_mm(about)).T)
        self._origin = askew.min(axis=1) - MARGIN_MM
        # the tip of `about` lies in the middle between two steps
        self._radius_mm, self._grid = about[Unknown.RADIUS] / math.sqrt(1.0 + RADIUS_STEP), grid_mm
        u_mm, v_mm = (
            np.arange(low, high, grid_mm)
            for low, high in zip(self._origin, askew.max(axis=1) + MARGIN_MM, strict=True)
        )
        back = _turn(-ASKEW_RAD)
        self._bare = np.empty((v_mm.size, u_mm.size), dtype=np.float32)

        def fill(first: int, last: int) -> None:
            for begin in range(first, last, _ROWS_AT_ONCE):
                v = v_mm[begin : min(begin + _ROWS_AT_ONCE, last), None]
                self._bare[begin : begin + v.size] = heights(*(row[0] * u_mm + row[1] * v for row in back))

        in_threads(fill, v_mm.size)
        self._surface = lru_cache(2)(self._surface_of)

    def _dilated(self, step: int) -> NDArray[np.float32]:
        radius_mm = self._radius_mm * (1.0 + RADIUS_STEP) ** step
        return dilated_fields(self._bare, pitch_mm=self._grid, radius_mm=radius_mm)[..., :3]

    def _surface_of(self, step: int) -> TouchSurface:
        low, high = self._dilated(step), self._dilated(step + 1)
        fields = np.concatenate([low, high - low], axis=2)
        return TouchSurface(fields, np.zeros((1, 1), dtype=np.bool_), self._grid)

    def surface(self, radius_mm: float) -> TouchSurface:
        """Surface for the tip of the step below a radius, and its difference to the next. Raises WhiskerError."""
        return self._surface(self._at(radius_mm)[0])

    def _at(self, radius_mm: float) -> tuple[int, float]:
        if not radius_mm > 0.0:
            raise WhiskerError(f"a tip's radius is {radius_mm} mm", hint="it must be positive")
        step = math.floor(math.log(radius_mm / self._radius_mm) / math.log1p(RADIUS_STEP))
        below_mm = self._radius_mm * (1.0 + RADIUS_STEP) ** step
        return step, (radius_mm / below_mm - 1.0) / RADIUS_STEP

    def pose(self, direction: TraceDirection, bench: Bench) -> SurfacePose:
        """Place the map under traces of a direction: x along the plate's or against it, z as the plate's."""
        x, z = (direction.sign, 0.0), (0.0, 1.0)
        plate_from_trace = np.array((x, z) if direction.along_x else (z, x))
        map_from_plate = _turn(ASKEW_RAD + math.radians(bench[Unknown.YAW]))
        turn = map_from_plate @ plate_from_trace
        corner = -map_from_plate @ _shift_mm(bench) - self._origin
        rises = 1e-3 * np.array([bench[Unknown.TILT_X], bench[Unknown.TILT_Y]]) @ plate_from_trace
        column, row = np.concatenate([corner[:, None], turn], axis=1).tolist()
        return SurfacePose(
            column_mm=tuple(column),
            row_mm=tuple(row),
            tilt=(0.0, *rises.tolist()),
            share=self._at(bench[Unknown.RADIUS])[1],
            friction=bench[Unknown.FRICTION],
        )


def _turn(by_rad: float) -> Floats:
    c, s = math.cos(by_rad), math.sin(by_rad)
    return np.array([[c, s], [-s, c]])


def _shift_mm(bench: Bench) -> Floats:
    return np.array([bench[Unknown.SHIFT_X], bench[Unknown.SHIFT_Y]])


def _ends_mm(trace: Trace) -> list[tuple[float, float]]:
    line_mm, along_x = trace.line_mm, trace.plan.direction.along_x
    return [(end, line_mm) if along_x else (line_mm, end) for end in trace.plan.position_mm()[[0, -1]]]
