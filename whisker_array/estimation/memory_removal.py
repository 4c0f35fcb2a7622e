"""Remove the creep and hysteresis of gauges from a scan, if the calibration has measured them.

    raw --- zero in air, / gain --> approximate load --> reading of a gauge with that memory
                                          |                        |
    raw <------------ minus ------- gain (reading - load) <--------+

The approximate load still contains creep and hysteresis, 1 to 2 % of it, so a similar share of them is left: 0.1 % of
the land's moment. The exact inverse (that of a play operator is a play operator, Kuhnen 2003) would need an absolute
zero of the load, which drifts; this method uses the zero of each pass, which also removes slow creep.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import SensorMemory, SensorState, read_gauges, rest_gauges
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.array import RasterPlan

NEVER_RUN = np.uint8(SampleFlag.OUTSIDE)
BETWEEN_S = RasterPlan.turnaround_s
"""Time in air before a pass; it is not recorded, so this is the plan's default."""


def remove_memory(scan: Scan) -> Scan:
    """Remove creep and hysteresis from a scan; unchanged if the calibration has none.

    Passes are processed in the order of the scan, because hysteresis depends on the last load before a pass.

    Args:
        scan: scan whose gains are known from a bench.

    Returns:
        The scan, with a calibration that has no memory.
    """
    known = scan.calibration
    if known is None or known.memory is None:
        return scan
    state = SensorState.at_rest(known.memory.n_whiskers, known.memory)
    sweeps = tuple(
        _remove_from_sweep(s, known.memory, state, gain=known.gain, step_s=1.0 / scan.sample_rate_hz)
        for s in scan.sweeps
    )
    return replace(scan, sweeps=sweeps, calibration=replace(known, memory=None), log=None)


def _remove_from_sweep(
    sweep: Sweep, memory: SensorMemory, state: SensorState, *, gain: np.ndarray, step_s: float
) -> Sweep:
    n_air = sweep.air_n_mm.shape[2]
    if not n_air:
        return sweep  # without air samples a pass has no zero, and its load is unknown
    moment, air = np.empty_like(sweep.moment_n_mm), np.empty_like(sweep.air_n_mm)
    scale = gain[:, None]
    for i in range(moment.shape[0]):
        rest_gauges(memory, state, seconds=BETWEEN_S)
        zero = np.median(sweep.air_n_mm[i], axis=1).astype(np.float64)
        load = (sweep.moment_n_mm[i] - zero[:, None]) / scale
        # a shorter pass among longer ones has samples that never ran
        load[((sweep.flags[i] & NEVER_RUN) != 0) & (sweep.moment_n_mm[i] == 0.0)] = 0.0
        both = np.concatenate([np.zeros((gain.size, n_air)), load], axis=1)
        added = scale * (read_gauges(both, memory=memory, state=state, step_s=step_s) - both)
        air[i] = sweep.air_n_mm[i] - added[:, :n_air]
        moment[i] = sweep.moment_n_mm[i] - added[:, n_air:]
    return replace(sweep, moment_n_mm=moment, air_n_mm=air)
