r"""What a bench would have recorded over a piece: the contact simulation along the lines that were felt.

piece --turned, shifted--> strip around each line --dilated by the tip--> heights and slopes   (once a radius)
strip --tilt, play--> contact along its middle --gain, creep, lag--> raw signal less that of the air
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.bench import Bench, Unknown, screw_ways
from whisker_array.identification.remembered import lagged
from whisker_array.identification.strips import HALF_MM, MARGIN_MM, Heights, leaned, strip_of
from whisker_array.identification.traces import JAM_LANDS, Trace, without_jams
from whisker_array.simulation.contact import trace_contact
from whisker_array.simulation.dilation import dilate_by_ball
from whisker_array.simulation.surface import TouchSurface
from whisker_array.whisker.shapes import LShaped, TipModel
from whisker_array.whisker.touch import Touch

GRID_MM = 0.00625
STEPS = 4
"""A tip slides from sample to sample in so many steps: with one it would jump into what it slides along."""


class Forward:
    """Predicts the traces of any bench that is near the one that the strips were cut for.

    - Strips are dilated anew for another radius, tilted and sheared anew for another tilt or yaw; the last are kept.
    - What is predicted of a trace depends on nothing but the bench that is asked for.
    """

    def __init__(
        self,
        heights: Heights,
        traces: Sequence[Trace],
        *,
        nominal: LShaped | Touch,
        about: Bench,
        setup_friction: float,
        largest_n_mm: float,
        grid_mm: float = GRID_MM,
    ) -> None:
        """Cut the strips.

        Args:
            heights: of the piece.
            traces: to be predicted.
            nominal: the whisker as drawn.
            about: the bench, whose pose of the piece the strips are cut for.
            setup_friction: at which the stage was set up, so that the tip is over the commanded place.
            largest_n_mm: largest load of a gauge's life.
            grid_mm: of the strips.
        """
        self.traces = tuple(traces)
        self.nominal = nominal
        self._about, self._setup, self._grid, self._largest = about, setup_friction, grid_mm, largest_n_mm
        self._ways = [_screw_ways(trace) for trace in self.traces]
        self._bare = [strip_of(heights, trace, about=about, grid_mm=grid_mm) for trace in self.traces]
        self._dilated: tuple[float, list[NDArray[np.float32]]] = (-1.0, [])
        self._tilted: tuple[tuple[float, ...], list[NDArray[np.float32]]] = ((), [])

    def moments(self, bench: Bench, *, tip: TipModel | None = None) -> list[NDArray[np.float64]]:
        """(samples,) of every trace, N mm: what the tip presses, and what its gauge makes of that.

        Args:
            bench: the numbers.
            tip: in place of that of the bench's whisker.

        Raises:
            WhiskerError: a number that no whisker has.
        """
        return [
            pressed[::STEPS] + bench.memory[:, trace.whisker] @ self.units(trace, pressed)
            for trace, pressed in zip(self.traces, self.pressed(bench, tip=tip), strict=True)
        ]

    def units(self, trace: Trace, pressed: NDArray[np.float64]) -> NDArray[np.float64]:
        """(2, samples) what a creep of 1 adds to a trace, and a lag."""
        # a jam is no prediction's, but what follows it in the gauge is
        jammed = np.repeat(np.isnan(trace.felt_n_mm), STEPS)[STEPS // 2 :][: pressed.size]
        met = np.repeat(trace.load_n_mm, STEPS)[STEPS // 2 :][: pressed.size]
        lag = lagged(np.where(jammed, met, pressed), play_n_mm=trace.play_n_mm, largest_n_mm=self._largest)
        return np.stack([trace.crept_n_mm, lag[::STEPS]])

    def pressed(self, bench: Bench, *, tip: TipModel | None = None) -> list[NDArray[np.float64]]:
        """(STEPS (samples - 1) + 1,) of every trace: gain times moment, N mm; where it jams, what a jam begins with.

        Raises:
            WhiskerError: a number that no whisker has.
        """
        touch = bench.touch(self.nominal)
        tip = touch.tip if tip is None else tip
        pushed, found = tip.pushed(), []
        for trace, fields, ways in zip(self.traces, self._fields_of(bench), self._ways, strict=True):
            fields[..., 3] = touch.friction
            along, across = self._moved(trace, bench)
            traced = trace_contact(
                TouchSurface(fields, np.zeros((1, 1), dtype=np.bool_), self._grid),
                pushed if trace.plan.pushed else tip,
                lines_mm=np.array([HALF_MM + across]),
                start_mm=MARGIN_MM + along,
                step_mm=trace.plan.step_mm / STEPS,
                n_samples=STEPS * (trace.plan.n_samples - 1) + 1,
                preload_mm=touch.preload_mm,
                nominal_friction=self._setup,
            )
            moment = bench.gain[trace.whisker] * traced.moment_n_mm[0].astype(np.float64)
            screw = bench.screw[0 if trace.plan.direction.along_x else 1]
            if screw.any():
                at = np.arange(moment.size)
                moment = np.interp(at + ways @ screw, at, moment)
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

    def _fields_of(self, bench: Bench) -> list[NDArray[np.float32]]:
        key = tuple(bench[n] for n in (Unknown.RADIUS, Unknown.TILT_X, Unknown.TILT_Y, Unknown.YAW))
        if self._tilted[0] != key:
            radius_mm = bench[Unknown.RADIUS]
            if self._dilated[0] != radius_mm:
                dilated = [dilate_by_ball(z, pitch_mm=self._grid, radius_mm=radius_mm) for z in self._bare]
                self._dilated = radius_mm, dilated
            fields = [
                leaned(z, trace, bench, about=self._about, grid_mm=self._grid)
                for z, trace in zip(self._dilated[1], self.traces, strict=True)
            ]
            self._tilted = key, fields
        return self._tilted[1]

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


def _screw_ways(trace: Trace) -> NDArray[np.float64]:
    """(STEPS (samples - 1) + 1, 1 + 2 leads): by how many steps each number of the screw puts a trace's tip ahead."""
    sign, step_mm = -1.0 if trace.plan.direction.backward else 1.0, trace.plan.step_mm / STEPS
    at_mm = sign * step_mm * np.arange(STEPS * (trace.plan.n_samples - 1) + 1)
    return sign / step_mm * screw_ways(trace.plan.position_mm()[0] + at_mm)
