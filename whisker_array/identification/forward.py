r"""Predict the recording of a bench over a piece by contact simulation along its lines.

piece --dilated by the tip--> heights and slopes, and how they change with its radius   (once)
map --pose, play--> contact along the lines --gain--> raw signal minus that of the air
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from whisker_array.arrays import Floats
from whisker_array.identification.bench import Bench, Unknown
from whisker_array.identification.piece_map import Heights, PieceMap
from whisker_array.identification.traces import JAM_LANDS, Trace, mask_jams
from whisker_array.simulation.contact import trace_contact
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch

GRID_MM = 0.00625
STEPS = 4
"""Simulation steps per sample; with one step a tip would jump into the wall along which it slides."""


class Forward:
    """Predict the traces of benches near the one for which it was made."""

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
        self.traces = tuple(traces)
        self._nominal, self._setup = nominal, setup_friction
        self._piece = PieceMap(heights, traces, about=about, grid_mm=grid_mm)

    def moments(self, bench: Bench) -> list[Floats]:
        """Predict gain times moment (samples,) of every trace, N mm, up to a jam. Raises WhiskerError."""
        touch = replace(bench.touch(self._nominal), friction=self._setup)
        surface = self._piece.surface(touch.tip_radius_mm)
        predicted: list[Floats] = []
        for _, sweep in groupby(self.traces, key=lambda trace: id(trace.plan)):
            lines = tuple(sweep)
            plan = lines[0].plan
            start_mm = -plan.start_mm if plan.direction.backward else plan.start_mm
            finer = replace(
                plan,
                line_mm=np.array([trace.line_mm for trace in lines]),
                start_mm=start_mm - 0.5 * bench[Unknown.PLAY],
                step_mm=plan.step_mm / STEPS,
                n_samples=STEPS * (plan.n_samples - 1) + 1,
            )
            pose = self._piece.pose(plan.direction, bench)
            moment = trace_contact(surface, touch, finer, pose=pose).moment_n_mm.astype(np.float64)
            moment *= bench.gain[[trace.whisker for trace in lines], None]
            most = JAM_LANDS * np.abs(np.median(moment, axis=1, keepdims=True))
            predicted += list(np.clip(moment, -most, most)[:, ::STEPS])
        return predicted

    def exclude_jams(self, bench: Bench) -> None:
        """Exclude samples that are predicted to be near jamming, permanently, so that the fit is smooth."""
        self.traces = tuple(
            replace(
                trace,
                measured_n_mm=np.where(np.isnan(mask_jams(p, share=0.98)), np.nan, trace.measured_n_mm),
            )
            for trace, p in zip(self.traces, self.moments(bench), strict=True)
        )
