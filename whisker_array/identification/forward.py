r"""Predict the recording of a bench over a piece by contact simulation along its lines.

piece --dilated by the tip--> heights and slopes, and how they change with its radius   (once)
map --pose, play--> contact along the lines --gain--> raw signal minus that of the air
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from whisker_array.identification.bench import Bench, Unknown, screw_basis
from whisker_array.identification.piece_map import Heights, PieceMap
from whisker_array.identification.traces import JAM_LANDS, Trace, mask_jams
from whisker_array.simulation.contact import trace_contact
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.shapes import LShaped, TipModel
from whisker_array.whisker.touch import Touch

GRID_MM = 0.00625
STEPS = 4
"""Simulation steps per sample; with one step a tip would jump into the wall along which it slides."""


class Forward:
    """Predict the traces of benches near the one for which it was made.

    The prediction of a trace depends only on the given bench.
    """

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
        """Make the map of the piece.

        Args:
            heights: heights of the test piece.
            traces: traces to be predicted; those of a sweep one after the other.
            nominal: the whisker as drawn.
            about: bench near which predictions are made; the map is for its tip.
            setup_friction: friction at which the stage was set up, so that the tip is at the commanded position.
            grid_mm: pitch of the map.
        """
        self.traces = tuple(traces)
        self.nominal = nominal
        self._setup = setup_friction
        self._sweeps = [
            _Sweep.of(list(sweep)) for _, sweep in groupby(self.traces, key=lambda trace: id(trace.plan))
        ]
        self._piece = PieceMap(heights, [sweep.plan for sweep in self._sweeps], about=about, grid_mm=grid_mm)

    def moments(self, bench: Bench, *, tip: TipModel | None = None) -> list[NDArray[np.float64]]:
        """Predict gain times moment (samples,) of every trace, N mm.

        Where a tip jams, the moment is limited to that at which a jam begins.

        Raises:
            WhiskerError: an impossible number.
        """
        touch = bench.touch(self.nominal)
        tip = touch.tip if tip is None else tip
        pushed = tip.pushed()
        found: list[NDArray[np.float64]] = []
        surface = self._piece.surface(touch.tip_radius_mm)
        for sweep in self._sweeps:
            plan = sweep.plan
            traced = trace_contact(
                surface,
                pushed if plan.pushed else tip,
                lines_mm=sweep.line_mm,
                start_mm=(-1.0 if plan.direction.backward else 1.0) * plan.start_mm
                - 0.5 * bench[Unknown.PLAY],
                step_mm=plan.step_mm / STEPS,
                n_samples=STEPS * (plan.n_samples - 1) + 1,
                preload_mm=touch.preload_mm,
                nominal_friction=self._setup,
                pose=self._piece.pose(plan.direction, bench),
            )
            moment = bench.gain[sweep.whiskers, None] * traced.moment_n_mm.astype(np.float64)
            screw = bench.screw[0 if plan.direction.along_x else 1]
            if screw.any():
                at = np.arange(moment.shape[1], dtype=np.float64)
                there = at + sweep.screw_basis @ screw
                moment = np.stack([np.interp(there, at, line) for line in moment])
            most = JAM_LANDS * np.abs(np.median(moment, axis=1, keepdims=True))
            found += list(np.clip(moment, -most, most)[:, ::STEPS])
        return found

    def exclude_jams(self, bench: Bench) -> None:
        """Exclude samples that are predicted to be near jamming, permanently, so that the fit is smooth."""
        masked = [
            replace(
                trace,
                measured_n_mm=np.where(np.isnan(mask_jams(p, share=0.98)), np.nan, trace.measured_n_mm),
            )
            for trace, p in zip(self.traces, self.moments(bench), strict=True)
        ]
        self.traces = tuple(masked)


@dataclass(frozen=True, eq=False)
class _Sweep:
    """Common data of a sweep's lines; `screw_basis` is that of `_screw_basis`."""

    plan: SweepPlan
    line_mm: NDArray[np.float64]
    screw_basis: NDArray[np.float64]
    whiskers: NDArray[np.intp]

    @classmethod
    def of(cls, traces: Sequence[Trace]) -> _Sweep:
        """Gather the traces of a sweep."""
        return cls(
            plan=traces[0].plan,
            line_mm=np.array([trace.line_mm for trace in traces]),
            screw_basis=_screw_basis(traces[0].plan),
            whiskers=np.array([trace.whisker for trace in traces]),
        )


def _screw_basis(plan: SweepPlan) -> NDArray[np.float64]:
    """(STEPS (samples - 1) + 1, 1 + 2 leads): displacement of a sweep's tips by each number of the screw, in steps."""
    sign, step_mm = -1.0 if plan.direction.backward else 1.0, plan.step_mm / STEPS
    at_mm = sign * step_mm * np.arange(STEPS * (plan.n_samples - 1) + 1, dtype=np.float64)
    return sign / step_mm * screw_basis(plan.start_mm + at_mm)
