r"""What a bench would have recorded over a piece: the contact simulation along the lines that were felt.

    piece --turned, shifted--> strip around each line --dilated by the tip--> heights and slopes   (once a radius)
    strip --tilt, play--> contact along its middle --gain, creep, lag--> raw signal less that of the air

A strip is a grid in the frame of its trace: u the way the whisker goes, v across, in the order of the plate::

    v ^  +----------------------------------------------+
      |  |  start o - - - - - - the line - - - - - ->    |  HALF_MM to either side: as far as a tip slips
      |  +----------------------------------------------+
      +-----> u

Small changes of the pose move the line in its strip, and shear it; a strip is not cut anew for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import one_line
from glyphs.surface.maps import HeightMap, MapError
from whisker_array.estimation.edges import UNUSABLE, calibrated_moments
from whisker_array.estimation.steadied import steadied
from whisker_array.identification.bench import Bench, Unknown
from whisker_array.identification.remembered import LARGEST_LANDS, crept, lagged
from whisker_array.scan.scan import Scan
from whisker_array.simulation.contact import trace_contact
from whisker_array.simulation.surface import TouchSurface, dilate_by_ball
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

Heights = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Height over the land, mm, at places of the piece, x and y in mm."""
HALF_MM = 0.3
GRID_MM = 0.0125
MOST_TRACES = 96
JAM_LANDS = 1.7
"""A moment so many times that of the land is felt just before a tip jams, by luck of the sampling: not used."""
_BESIDE = 3


@dataclass(frozen=True, eq=False)
class Trace:
    """One line of one whisker, as it was recorded.

    Attributes:
        plan: of its sweep.
        cluster: number of its pass: what shakes the base is shared within it, and drift ends with it.
        whisker: number of the whisker.
        line_mm: plate coordinate across the trace.
        felt_n_mm: (samples,) signal less that in the air, NaN where it is not to be used.
        crept_n_mm: (samples,) what a creep of 1 within seconds would have added.
    """

    plan: SweepPlan
    cluster: int
    whisker: int
    line_mm: float
    felt_n_mm: NDArray[np.float64]
    crept_n_mm: NDArray[np.float64]

    __repr__ = one_line


def traces_of(scan: Scan, *, most: int = MOST_TRACES) -> tuple[Trace, ...]:
    """The lines of a recording that tell most: of every whisker and sweep those with most relief under them.

    Raises:
        MapError: none can be used.
    """
    scan = steadied(scan)
    groups: list[list[Trace]] = []
    cluster = 0
    for sweep, added in zip(scan.sweeps, crept(scan), strict=True):
        moment = calibrated_moments(scan, sweep)
        moment[(sweep.flags & UNUSABLE) != 0] = np.nan
        for whisker in range(moment.shape[1]):
            lines = [
                Trace(
                    sweep.plan,
                    cluster + p,
                    whisker,
                    float(sweep.plan.line_mm[p, whisker]),
                    without_jams(moment[p, whisker]),
                    added[p, whisker],
                )
                for p in range(moment.shape[0])
                if np.isfinite(moment[p, whisker]).mean() > 0.5
            ]
            if lines:
                groups.append(sorted(lines, key=lambda one: -float(np.nanstd(one.felt_n_mm))))
        cluster += moment.shape[0]
    if not groups:
        raise MapError("no line of the recording can be used", hint="record passes that run over the piece")
    each = max(2, most // len(groups))
    # of the better half, evenly: the very best run all alike
    chosen = [
        group[k]
        for group in groups
        for k in sorted({int(n) for n in np.linspace(0, max(0, len(group) // 2 - 1), min(each, len(group)))})
    ]
    return tuple(chosen)


def without_jams(moment_n_mm: NDArray[np.float64], *, share: float = 1.0) -> NDArray[np.float64]:
    """A line's moments, NaN where its tip was about to jam, at that share of the limit, and just beside that."""
    land = np.nanmedian(moment_n_mm)
    near = np.abs(moment_n_mm) > share * JAM_LANDS * np.abs(land)
    if not near.any():
        return moment_n_mm
    wide = np.convolve(near, np.ones(2 * _BESIDE + 1), mode="same") > 0.5
    return np.where(wide, np.nan, moment_n_mm)


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


class Forward:
    """Predicts the traces of any bench that is near the one that the strips were cut for."""

    def __init__(
        self,
        heights: Heights,
        traces: Sequence[Trace],
        *,
        nominal: LShaped | Touch,
        about: Bench,
        setup_friction: float,
        grid_mm: float = GRID_MM,
    ) -> None:
        """Cut the strips.

        Args:
            heights: of the piece.
            traces: to be predicted.
            nominal: the whisker as drawn.
            about: the bench, whose pose of the piece the strips are cut for.
            setup_friction: at which the stage was set up, so that the tip is over the commanded place.
            grid_mm: of the strips.
        """
        self.traces = tuple(traces)
        self._nominal, self._about, self._setup, self._grid = nominal, about, setup_friction, grid_mm
        self._largest = LARGEST_LANDS * abs(about.touch(nominal).land_moment_n_mm())
        self._bare = [_strip(heights, trace, about, grid_mm) for trace in self.traces]
        self._by_radius: dict[float, list[NDArray[np.float32]]] = {}
        self._surfaces: dict[tuple[float, ...], list[TouchSurface]] = {}

    def moments(self, bench: Bench) -> list[NDArray[np.float64]]:
        """(samples,) of every trace, N mm: what the tip presses, and what its gauge makes of that.

        Raises:
            WhiskerError: a number that no whisker has.
        """
        return [
            pressed + bench.memory[:, trace.whisker] @ self.units(trace, pressed)
            for trace, pressed in zip(self.traces, self.pressed(bench), strict=True)
        ]

    def units(self, trace: Trace, pressed: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2, samples) what a creep of 1 adds to a trace, and a lag of 1."""
        return np.stack([trace.crept_n_mm, lagged(pressed, largest_n_mm=self._largest)])

    def pressed(self, bench: Bench) -> list[NDArray[np.float64]]:
        """(samples,) of every trace: gain times moment, N mm; where the tip jams, what a jam begins with.

        Raises:
            WhiskerError: a number that no whisker has.
        """
        touch = bench.touch(self._nominal)
        surfaces = self._surfaces_of(bench)
        pushed = touch.tip.pushed()
        found = []
        for trace, surface in zip(self.traces, surfaces, strict=True):
            along, across = self._moved(trace, bench)
            start = MARGIN_MM + along
            traced = trace_contact(
                surface,
                pushed if trace.plan.pushed else touch.tip,
                lines_mm=np.array([HALF_MM + across]),
                start_mm=start,
                step_mm=trace.plan.step_mm,
                n_samples=trace.plan.n_samples,
                preload_mm=touch.preload_mm,
                nominal_friction=self._setup,
            )
            moment = bench.gain[trace.whisker] * traced.moment_n_mm[0].astype(np.float64)
            most = JAM_LANDS * abs(float(np.median(moment)))
            found.append(np.clip(moment, -most, most))
        return found

    def spare_jams(self, bench: Bench) -> None:
        """Leave out of the traces what a bench predicts to be about to jam; for good, so that a fit is smooth."""
        self.traces = tuple(
            replace(
                trace,
                felt_n_mm=np.where(np.isnan(without_jams(p, share=0.98)), np.nan, trace.felt_n_mm),
            )
            for trace, p in zip(self.traces, self.moments(bench), strict=True)
        )

    def _surfaces_of(self, bench: Bench) -> list[TouchSurface]:
        names = (Unknown.RADIUS, Unknown.TILT_X, Unknown.TILT_Y, Unknown.FRICTION, Unknown.YAW)
        key = tuple(bench[name] for name in names)
        if key not in self._surfaces:
            if len(self._surfaces) > 1:  # that of the bench from which differences are taken, and one more
                self._surfaces.popitem()
            dilated = self._dilated(bench[Unknown.RADIUS])
            self._surfaces[key] = [
                self._surface(z, trace, bench) for z, trace in zip(dilated, self.traces, strict=True)
            ]
        return self._surfaces[key]

    def _dilated(self, radius_mm: float) -> list[NDArray[np.float32]]:
        if radius_mm not in self._by_radius:
            if len(self._by_radius) > 3:
                self._by_radius.clear()
            self._by_radius[radius_mm] = [
                dilate_by_ball(z, pitch_mm=self._grid, radius_mm=radius_mm) for z in self._bare
            ]
        return self._by_radius[radius_mm]

    def _moved(self, trace: Trace, bench: Bench) -> tuple[float, float]:
        """How far the line lies off in its strip, along and across: the pose's change, and play."""
        dx, dy = (bench[name] - self._about[name] for name in (Unknown.SHIFT_X, Unknown.SHIFT_Y))
        turned = math.radians(bench[Unknown.YAW] - self._about[Unknown.YAW])
        direction, plan = trace.plan.direction, trace.plan
        middle = float(plan.position_mm().mean())
        # a piece turned by a small angle about the origin: x' = x + yaw y, y' = y - yaw x in its frame
        if direction.along_x:
            along, across = -dx + turned * trace.line_mm, -dy - turned * middle
        else:
            along, across = -dy - turned * trace.line_mm, -dx + turned * middle
        sign = -1.0 if direction.backward else 1.0
        return sign * along - 0.5 * bench[Unknown.PLAY], across

    def _surface(self, z: NDArray[np.float32], trace: Trace, bench: Bench) -> TouchSurface:
        rises = [1e-3 * bench[name] for name in (Unknown.TILT_X, Unknown.TILT_Y)]
        along, across = rises if trace.plan.direction.along_x else rises[::-1]
        sign = -1.0 if trace.plan.direction.backward else 1.0
        u_mm = trace.plan.position_mm()[0] + sign * (np.arange(z.shape[1]) * self._grid - MARGIN_MM)
        v_mm = trace.line_mm + np.arange(z.shape[0]) * self._grid - HALF_MM
        tilted = self._sheared(z, trace, bench, u_mm) + (
            along * u_mm[None, :] + across * v_mm[:, None]
        ).astype(np.float32)
        fields = np.empty((*z.shape, 4), dtype=np.float32)
        fields[..., 0] = tilted
        fields[..., 1] = np.gradient(tilted, self._grid, axis=1)
        fields[..., 2] = np.gradient(tilted, self._grid, axis=0)
        fields[..., 3] = bench[Unknown.FRICTION]
        return TouchSurface(fields, np.zeros(z.shape, dtype=np.bool_), self._grid)

    def _sheared(
        self, z: NDArray[np.float32], trace: Trace, bench: Bench, u_mm: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """The strip with what yaw moves it sideways from its one end to the other, about the line's middle."""
        turned = math.radians(bench[Unknown.YAW] - self._about[Unknown.YAW])
        if turned == 0.0:
            return z
        off = turned * (u_mm - float(trace.plan.position_mm().mean())) / self._grid
        off = -off if trace.plan.direction.along_x else off
        row = np.clip(np.arange(z.shape[0])[:, None] + off, 0.0, z.shape[0] - 1.001)
        below = row.astype(np.intp)
        share = (row - below).astype(np.float32)
        columns = np.arange(z.shape[1])
        return (1.0 - share) * z[below, columns] + share * z[below + 1, columns]


MARGIN_MM = 1.0
"""Of a strip before the start of its line, and after its end."""


def _strip(heights: Heights, trace: Trace, about: Bench, grid_mm: float) -> NDArray[np.float32]:
    """(v, u) heights around a line, as the pose has the piece."""
    plan = trace.plan
    reach = (plan.n_samples - 1) * plan.step_mm + 2.0 * MARGIN_MM
    sign = -1.0 if plan.direction.backward else 1.0
    u_mm = plan.position_mm()[0] + sign * (np.arange(int(reach / grid_mm) + 1) * grid_mm - MARGIN_MM)
    v_mm = trace.line_mm + np.arange(round(2.0 * HALF_MM / grid_mm) + 1) * grid_mm - HALF_MM
    x, y = (u_mm[None, :], v_mm[:, None]) if plan.direction.along_x else (v_mm[:, None], u_mm[None, :])
    x, y = x - about[Unknown.SHIFT_X], y - about[Unknown.SHIFT_Y]
    yaw = math.radians(about[Unknown.YAW])
    at_x, at_y = math.cos(yaw) * x + math.sin(yaw) * y, math.cos(yaw) * y - math.sin(yaw) * x
    return heights(at_x, at_y).astype(np.float32)
