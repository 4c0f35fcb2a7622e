r"""Strips of a piece along the lines that were felt, and what a pose does to them.

A strip is a grid in the frame of its trace: u the way the whisker goes, v across, in the order of the plate::

    v ^  +----------------------------------------------+
      |  |  start o - - - - - - the line - - - - - ->    |  HALF_MM to either side: as far as a tip slips
      |  +----------------------------------------------+
      +-----> u

Small changes of the pose move the line in its strip, and shear it; a strip is not cut anew for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import FAST, kernel, read_only
from glyphs.surface.maps import HeightMap, MapError
from whisker_array.identification.bench import Bench, Unknown
from whisker_array.identification.traces import Trace
from whisker_array.simulation.surface import fields_of
from whisker_array.simulation.threads import in_threads

Heights = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Height over the land, mm, at places of the piece, x and y in mm."""
HALF_MM = 0.3
MARGIN_MM = 1.0
"""Of a strip before the start of its line, and after its end."""


def heights_of(surface: HeightMap) -> Heights:
    """Those of a map, between its samples too; beyond it as at its rim.

    Raises:
        MapError: a map with holes.
    """
    if np.isnan(surface.z_mm).any():
        raise MapError("the piece's map has places that were not measured", hint="fill them, or cut them off")
    rows, cols = surface.shape

    def at(x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        from scipy.ndimage import map_coordinates

        places = np.broadcast_arrays(
            np.clip(y_mm / surface.pitch_mm, 0, rows - 1), np.clip(x_mm / surface.pitch_mm, 0, cols - 1)
        )
        return np.asarray(map_coordinates(surface.z_mm, places, order=1, mode="nearest"), dtype=np.float64)

    return at


def strip_of(heights: Heights, trace: Trace, *, about: Bench, grid_mm: float) -> NDArray[np.float32]:
    """(v, u) heights around a line, as the pose has the piece."""
    plan = trace.plan
    reach = (plan.n_samples - 1) * plan.step_mm + 2.0 * MARGIN_MM
    shape = round(2.0 * HALF_MM / grid_mm) + 1, int(reach / grid_mm) + 1
    u_mm, v_mm = _places(trace, shape, grid_mm=grid_mm)
    x, y = (u_mm[None, :], v_mm[:, None]) if plan.direction.along_x else (v_mm[:, None], u_mm[None, :])
    x, y = x - about[Unknown.SHIFT_X], y - about[Unknown.SHIFT_Y]
    yaw = math.radians(about[Unknown.YAW])
    at_x, at_y = math.cos(yaw) * x + math.sin(yaw) * y, math.cos(yaw) * y - math.sin(yaw) * x
    return heights(at_x, at_y).astype(np.float32)


def leaned(
    z_mm: NDArray[np.float32], trace: Trace, bench: Bench, *, about: Bench, grid_mm: float
) -> NDArray[np.float32]:
    """(v, u, 4) fields of a strip, dilated before, as the bench's tilt and yaw have it about the line's middle.

    Args:
        z_mm: (v, u) of the strip.
        trace: along its middle.
        bench: the pose.
        about: the bench for which the strip was cut.
        grid_mm: of the strip.
    """
    u_mm, v_mm = _places(trace, z_mm.shape, grid_mm=grid_mm)
    rises = [1e-3 * bench[name] for name in (Unknown.TILT_X, Unknown.TILT_Y)]
    along, across = rises if trace.plan.direction.along_x else rises[::-1]
    turned = math.radians(bench[Unknown.YAW] - about[Unknown.YAW])
    side = turned * (u_mm - float(trace.plan.position_mm().mean())) / grid_mm
    side = -side if trace.plan.direction.along_x else side
    rows = np.floor(side).astype(np.intp)
    share = (side - rows).astype(np.float32)
    out = np.empty_like(z_mm)
    rise_u, rise_v = ((rise * at).astype(np.float32) for rise, at in ((along, u_mm), (across, v_mm)))
    given = (*(read_only(each) for each in (z_mm, rows, share, rise_u, rise_v)), out)
    in_threads(lambda first, last: _lean(first, last, *given), z_mm.shape[0])
    return fields_of(out, np.zeros((1, 1), dtype=np.float32), pitch_mm=grid_mm)


def _places(
    trace: Trace, shape: tuple[int, ...], *, grid_mm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a strip's columns and rows lie on the plate, mm: along the line and across."""
    sign = -1.0 if trace.plan.direction.backward else 1.0
    start_mm = float(trace.plan.position_mm()[0])
    u_mm = start_mm + sign * (np.arange(shape[1], dtype=np.float64) * grid_mm - MARGIN_MM)
    return u_mm, trace.line_mm + np.arange(shape[0], dtype=np.float64) * grid_mm - HALF_MM


@kernel(allow=FAST)
def _lean(first, last, z, rows, share, rise_u, rise_v, out):  # type: ignore[no-untyped-def]
    end = z.shape[0] - 1
    for r in range(first, last):
        for c in range(z.shape[1]):
            below = r + rows[c]
            low, high = z[min(max(below, 0), end), c], z[min(max(below + 1, 0), end), c]
            out[r, c] = low + share[c] * (high - low) + rise_u[c] + rise_v[r]
