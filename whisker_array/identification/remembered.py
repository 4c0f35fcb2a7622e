"""What creep and hysteresis have added to a recording, for each unit of either: they are found beside all else.

    felt = gain * moment + creep * crept + lag * lagged

Both are nearly linear in their figures (`whisker_array.scan.sensor_memory`), so `estimation.steadied` of the smallest
memory shows what a unit of it would take off. Slow creep goes with the zero of each pass.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from whisker_array.estimation.edges import calibrated_moments
from whisker_array.estimation.steadied import steadied
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import PLAYS, RELAX_S, SensorMemory

_LITTLE = 1e-3
_LARGEST_LANDS = 3.0
"""Largest load of a gauge's life, in moments of the land: plays are shares of it."""


def remembered(scan: Scan) -> list[NDArray[np.float64]]:
    """Of every sweep (2, passes, whiskers, samples), N mm: what a creep of 1 within seconds adds, and a lag of 1."""
    n = scan.n_whiskers
    largest = _LARGEST_LANDS * abs(scan.touch.land_moment_n_mm())
    quick, widths = np.array(RELAX_S[:2]), np.array(PLAYS)
    nothing, little = np.zeros((n, widths.size)), np.full((n, 2), _LITTLE)
    # a lag of 1: the zero is off by the largest load after that load
    weight = np.full((n, widths.size), _LITTLE / widths.sum())
    creeps = SensorMemory(little / 2.0, quick, nothing, largest * widths, largest)
    lags = SensorMemory(0.0 * little, quick, weight, largest * widths, largest)
    known = scan.calibration or Calibration(np.ones(n), np.zeros(n))
    taken = [
        steadied(replace(scan, calibration=replace(known, memory=memory), log=None))
        for memory in (creeps, lags)
    ]
    plain = replace(scan, calibration=replace(known, memory=None), log=None)
    return [
        np.stack(
            [
                (calibrated_moments(plain, sweep) - calibrated_moments(other, less)) / _LITTLE
                for other, less in zip(taken, lesser, strict=True)
            ]
        )
        for sweep, *lesser in zip(scan.sweeps, *(other.sweeps for other in taken), strict=True)
    ]
