"""What creep and hysteresis add to a recording, for each unit of either: they are found beside all else.

    felt = gain * moment + creep * crept + lag * lagged

Both are nearly linear in their figures (`whisker_array.scan.sensor_memory`). Creep is slow, so the recording itself
shows what a unit of it has added. Lag answers every sample, and noise in it would be taken for lag: that of a noiseless
prediction is taken.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from whisker_array.estimation.edges import calibrated_moments
from whisker_array.estimation.steadied import steadied
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import PLAYS, RELAX_S, SensorMemory, SensorState, reading_of

LARGEST_LANDS = 3.0
"""Largest load of a gauge's life, in moments of the land: plays are shares of it."""
_LITTLE = 1e-3
_QUICK_S = np.array(RELAX_S[:2])


def creeping(creep: float, *, n_whiskers: int) -> SensorMemory:
    """Gauges that creep within seconds, and do not lag."""
    none = np.zeros((n_whiskers, 1))
    return SensorMemory(np.full((n_whiskers, 2), creep / 2.0), _QUICK_S, none, np.array([1.0]), 1.0)


def lagging(lag: float, *, largest_n_mm: float) -> SensorMemory:
    """One gauge that lags, and does not creep: after the largest load its zero is off by that share of it."""
    widths = np.array(PLAYS)
    weight = np.full((1, widths.size), lag / widths.sum())
    return SensorMemory(np.zeros((1, 2)), _QUICK_S, weight, largest_n_mm * widths, largest_n_mm)


def crept(scan: Scan) -> list[NDArray[np.float64]]:
    """Of every sweep (passes, whiskers, samples), N mm: what a creep of 1 within seconds has added."""
    n = scan.n_whiskers
    known = scan.calibration or Calibration(np.ones(n), np.zeros(n))
    plain = replace(scan, calibration=replace(known, memory=None), log=None)
    taken = steadied(replace(plain, calibration=replace(known, memory=creeping(_LITTLE, n_whiskers=n))))
    return [
        (calibrated_moments(plain, sweep) - calibrated_moments(taken, less)) / _LITTLE
        for sweep, less in zip(plain.sweeps, taken.sweeps, strict=True)
    ]


def lagged(load_n_mm: NDArray[np.float64], *, largest_n_mm: float) -> NDArray[np.float64]:
    """(samples,) what a lag of 1 adds to a pass, N mm, after one that ended at the load this one begins with."""
    memory = lagging(_LITTLE, largest_n_mm=largest_n_mm)
    before = np.array([load_n_mm[0], 0.0])
    load = np.concatenate([before, load_n_mm])[None, :]
    read = reading_of(load, memory=memory, state=SensorState.at_rest(1, memory), step_s=1.0)[0]
    return np.asarray((read[2:] - read[1] - load_n_mm) / _LITTLE)
