"""Contributions of unit creep and unit hysteresis to a recording; both are fitted with the other parameters.

    measured = gain * moment + creep * crept + lag * lagged

Creep is slow, so the contribution of a unit of it follows from the recorded loads, that is the recording minus the
present estimate of creep and lag. Lag responds to every sample, and noise would look like lag. Its contribution is
therefore computed from a noiseless prediction; from the recording come only the states of the plays at the start of a
pass and the loads where the tip jammed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from whisker_array.estimation.edges import calibrated_moments
from whisker_array.estimation.memory_removal import BETWEEN_S, remove_memory
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import (
    PLAYS,
    RELAX_S,
    SensorMemory,
    SensorState,
    read_gauges,
    rest_gauges,
)

LARGEST_LANDS = 3.0
"""Largest past load of a gauge, in land moments; plays are shares of it."""
_WITHIN_SECONDS = RELAX_S[:2]
_SMALL_SHARE = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class GaugeEffects(OneLine):
    """Contributions of the gauges to a sweep.

    Attributes:
        crept_n_mm: (passes, whiskers, samples) contribution of a creep of 1.
        play_n_mm: (passes, whiskers, plays) states of the plays of a lag when each pass began.
        load_n_mm: (passes, whiskers, samples) the recording without creep and lag.
    """

    crept_n_mm: NDArray[np.float64]
    play_n_mm: NDArray[np.float64]
    load_n_mm: NDArray[np.float64]


def gauges(memory: NDArray[np.float64], *, largest_n_mm: float) -> SensorMemory:
    """Make gauges with (2, whiskers) shares of creep and lag.

    After the largest load the zero is off by the share of lag. Negative shares count as 0. There is no creep over a
    minute or more, which a recording of two minutes cannot separate from drift.
    """
    creep, lag = np.maximum(memory, 0.0)
    widths = np.array(PLAYS)
    return SensorMemory(
        np.stack([creep / 2.0, creep / 2.0], axis=1),
        np.array(_WITHIN_SECONDS),
        lag[:, None] / widths.sum() * np.ones(widths.size),
        largest_n_mm * widths,
        largest_n_mm,
    )


def gauge_effects(
    scan: Scan, *, gain: NDArray[np.float64], memory: NDArray[np.float64], largest_n_mm: float
) -> list[GaugeEffects]:
    """Compute the contribution of gauges to every sweep, from loads corrected by the present estimate.

    Args:
        scan: the recording.
        gain: (whiskers,) present estimate.
        memory: (2, whiskers) present estimate.
        largest_n_mm: load of which the plays are shares.
    """
    known = scan.calibration or Calibration(np.ones(scan.n_whiskers), np.zeros(scan.n_whiskers))
    plain = replace(
        scan, calibration=replace(known, memory=gauges(memory, largest_n_mm=largest_n_mm)), log=None
    )
    plain = remove_memory(plain)
    creep, lag = (
        gauges(_SMALL_SHARE * np.repeat(of, scan.n_whiskers, axis=1), largest_n_mm=largest_n_mm)
        for of in ([[1.0], [0.0]], [[0.0], [1.0]])
    )
    taken = remove_memory(replace(plain, calibration=replace(known, memory=creep)))
    state = SensorState.at_rest(scan.n_whiskers, lag)
    found = []
    for sweep, less in zip(plain.sweeps, taken.sweeps, strict=True):
        signal = calibrated_moments(plain, sweep)
        load = np.nan_to_num(signal)
        begun = _plays(load / gain[:, None], lag, state, scan.sample_rate_hz)
        found.append(GaugeEffects((signal - calibrated_moments(taken, less)) / _SMALL_SHARE, begun, load))
    return found


def _plays(
    load_n_mm: NDArray[np.float64], memory: SensorMemory, state: SensorState, sample_rate_hz: float
) -> NDArray[np.float64]:
    """(passes, whiskers, plays) states of the plays at the start of each pass."""
    begun = []
    for load in load_n_mm:
        rest_gauges(memory, state, seconds=BETWEEN_S)
        begun.append(state.play_n_mm.copy())
        read_gauges(load, memory=memory, state=state, step_s=1.0 / sample_rate_hz)
    return np.array(begun)


def lag_response(
    load_n_mm: NDArray[np.float64], *, play_n_mm: NDArray[np.float64], largest_n_mm: float
) -> NDArray[np.float64]:
    """(lines, samples) contribution of a lag of 1 to passes whose plays have these states after lifting, N mm."""
    memory = _small_lag(load_n_mm.shape[0], largest_n_mm)
    state = SensorState.at_rest(load_n_mm.shape[0], memory)
    state.play_n_mm[...] = play_n_mm
    load = np.pad(load_n_mm, ((0, 0), (1, 0)))
    read = read_gauges(load, memory=memory, state=state, step_s=1.0)
    return np.asarray((read[:, 1:] - read[:, :1] - load_n_mm) / _SMALL_SHARE)


@lru_cache(maxsize=8)
def _small_lag(lines: int, largest_n_mm: float) -> SensorMemory:
    return gauges(np.repeat([[0.0], [_SMALL_SHARE]], lines, axis=1), largest_n_mm=largest_n_mm)
