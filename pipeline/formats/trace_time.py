"""The rate of a trace table from its times: coarse clocks, pauses, time stamps, midnight.

time |          ....             ties: several samples to a tick of the clock; the rate comes from the ends of
     |   ...  ..                 each stretch, not from single steps
     | ..   pause: left out
     +----------------> sample   back: to midnight, or to 0 at a new pass; anywhere else it is an error
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import DataError
from pipeline.formats.trace_table import TraceTable
from pipeline.formats.units import DAY_S, TimeUnit

Floats = NDArray[np.float64]

PAUSE_STEPS = 2.5
"""Of the usual step of the clock, above which the sampling had paused."""
SPEEDS_MM_S = (0.2, 2000.0)
"""Of a stage that traces: slower or faster by its own times, the times are in another unit."""


def rate_hz(table: TraceTable, time_s: Floats, number: Floats) -> float:
    """Samples a second.

    Args:
        table: for messages.
        time_s: (rows,) of its rows.
        number: (rows,) of the pass of each row: a clock may start anew with a pass.

    Raises:
        DataError: times that are missing, run back within a pass, or never change.
    """
    lost = np.flatnonzero(~np.isfinite(time_s))
    if lost.size:
        raise DataError(f"has no time {table.at(int(lost[0]))}", "fill it in, or take that row out")
    steps = np.diff(time_s)
    steps = np.where(np.abs(steps + DAY_S) < 0.5 * DAY_S, steps + DAY_S, steps)
    back = np.flatnonzero((steps < 0.0) & (np.diff(number) == 0.0))
    if back.size:
        raise DataError(
            f"has a time that runs back {table.at(int(back[0]) + 1)}",
            "give the rows in the order in which they were sampled, or sampling_rate_hz in place of columns.time",
        )
    grows = steps[steps > 0.0]
    if not grows.size:
        raise DataError("has times that are all the same", "give sampling_rate_hz in place of columns.time")
    run = steps[(steps >= 0.0) & (steps <= PAUSE_STEPS * float(np.median(grows)))]
    return run.size / float(run.sum())


def check_speed(*, step_mm: float, rate_hz: float, unit: TimeUnit) -> None:
    """Refuse times by which the stage crawls or flies.

    Raises:
        DataError: with the unit that they are likely in.
    """
    speed, (least, most) = step_mm * rate_hz, SPEEDS_MM_S
    if least <= speed <= most:
        return
    likely = [u for u in TimeUnit if least <= speed * unit.seconds / u.seconds <= most and u is not unit]
    asked = f'say time_unit = "{likely[0].value}" if that is their unit' if likely else "correct time_unit"
    raise DataError(
        f"moves at {speed:.3g} mm/s and was sampled at {rate_hz:.4g} Hz by its times in {unit.value}",
        f"{asked}, or give sampling_rate_hz in place of columns.time",
    )
