"""Find the samples of a pass in a converter's record, and their positions.

sync   ____|^^^^^^|________|^^^^^^^^^^^^^^^^^|____      high: the stage's spare output
             air     lower      the pass       lift

The converter samples an output that the stage sets while it drags the tips: both share one clock. A pass that took more
or less time than planned (`Ramp`) is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from pipeline.bench.moves import Moves
from whisker_array.scan.stage_error import StageError
from whisker_array.whisker.passes import Pass

_LATE_S = 0.03
"""Tolerance, s, between the time that the output is set and the duration of the move: firmware planning and samples."""
_LONGER = 0.02  # further tolerance, as a share of the duration of the move


@dataclass(frozen=True, eq=False)
class Record:
    """Samples between start and stop."""

    volts: NDArray[np.float64]  # (samples, whiskers)
    sync: NDArray[np.bool_]  # (samples,) whether the stage's output was set
    rate_hz: float
    clipped: NDArray[np.bool_]  # (samples, whiskers) whether the sample is at an end of the converter's range

    def stretches(self) -> list[slice]:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], self.sync.astype(np.int8), [0]])))
        return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def beyond(order: Pass, field_mm: tuple[float, float, float, float]) -> NDArray[np.bool_]:
    """(lines, samples) mask of samples beyond the field; run-in and run-out may lie there."""
    x0, y0, x1, y1 = field_mm
    along, across = ((x0, x1), (y0, y1)) if order.direction.along_x else ((y0, y1), (x0, x1))
    plan, tolerance = order.sweep_plan(), 0.5 * order.sample_pitch_mm
    place, lines = plan.position_mm(), np.asarray(order.line_mm)[:, None]
    off = (place < along[0] - tolerance) | (place > along[1] + tolerance)
    off[: plan.n_lead] = off[plan.n_samples - plan.n_lead :] = False
    return np.asarray((lines < across[0] - tolerance) | (lines > across[1] + tolerance) | off)


def samples(
    record: Record, order: Pass, moves: Moves
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """(lines, samples) volts in the air, volts on the part, and mask of clipped ones, in the order of the pass's lines.
    Raises StageError: the pass cannot be found by the stage's output."""
    stretches, wanted = record.stretches(), 2 if moves.air_s > 0.0 else 1
    if len(stretches) != wanted:
        raise StageError(
            f"the converter saw the stage's output set {len(stretches)} times, not {wanted}",
            "check the wire from the stage's spare output to the converter",
        )
    air_at, felt_at = stretches[0], stretches[-1]
    took_s, should_s = (felt_at.stop - felt_at.start) / record.rate_hz, moves.ramp.duration_s
    if abs(took_s - should_s) > _LATE_S + 2.0 / record.rate_hz + _LONGER * should_s:
        raise StageError(
            f"the pass took {took_s:.3f} s and not {should_s:.3f} s",
            "set acceleration_mm_s2 as in the firmware, and leave its feed override at 100 %",
        )
    lines = record.volts[:, list(moves.whisker)]
    time_s = (np.arange(felt_at.stop - felt_at.start) + 0.5) / record.rate_hz
    run_mm = moves.ramp.at_mm(time_s)
    at_mm = moves.first_mm + order.sample_pitch_mm * np.arange(order.n_samples, dtype=np.float64)
    felt = _average_around(run_mm, lines[felt_at], at_mm, order.sample_pitch_mm)
    nearest = np.clip(np.searchsorted(run_mm, at_mm), 0, run_mm.size - 1)
    clipped = record.clipped[felt_at][:, list(moves.whisker)][nearest].T
    rate_hz = moves.speed_mm_s / order.sample_pitch_mm
    air = np.empty((len(order.line_mm), 0))
    if moves.air_s > 0.0:
        time_s = np.arange(air_at.stop - air_at.start) / record.rate_hz
        at_s = (np.arange(order.air_samples, dtype=np.float64) + 2.0) / rate_hz
        air = _average_around(time_s, lines[air_at], at_s, 1.0 / rate_hz)
    return air, felt, clipped


def _average_around(
    x: NDArray[np.float64], rows: NDArray[np.float64], points: NDArray[np.float64], width: float
) -> NDArray[np.float64]:
    """(channels, at) means of (samples, channels) over a width around each point, against aliasing."""
    whole = cumulative_trapezoid(rows, x, axis=0, initial=0.0)
    low, high = (np.array([np.interp(points + s * width, x, c) for c in whole.T]) for s in (-0.5, 0.5))
    return np.asarray((high - low) / width)
