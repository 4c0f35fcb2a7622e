"""Creep and lag as parts of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glyphs.surface.pieces import Piece
from tests.support.benches import recorded
from whisker_array.estimation.edges import calibrated_moments
from whisker_array.identification.fit import identify
from whisker_array.identification.remembered import creeping, crept, lagged, lagging
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import SensorMemory, SensorState, lifted, reading_of
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.touch import default_touch

PIECE = Piece(angle_deg=(45.0, 30.0), floor_mm=1.0, land_mm=1.0)
CREEP, LAG = 0.012, 0.008


def with_memory(scan: Scan, memory: SensorMemory) -> Scan:
    """The scan as gauges with that memory would have recorded it, pass after pass."""
    state = SensorState.at_rest(scan.n_whiskers, memory)
    sweeps = []
    for sweep in scan.sweeps:
        moment, air = sweep.moment_n_mm.copy(), sweep.air_n_mm.copy()
        for i in range(moment.shape[0]):
            lifted(memory, state, seconds=RasterPlan.turnaround_s)
            zero = np.median(air[i], axis=1)[:, None]
            load = np.concatenate([air[i] - zero, moment[i] - zero], axis=1)
            read = reading_of(load, memory=memory, state=state, step_s=1.0 / scan.sample_rate_hz) + zero
            air[i], moment[i] = read[:, : air.shape[2]], read[:, air.shape[2] :]
        sweeps.append(replace(sweep, moment_n_mm=moment.astype(np.float32), air_n_mm=air.astype(np.float32)))
    return replace(scan, sweeps=tuple(sweeps))


def test_what_memory_adds_is_creep_and_lag_of_what_is_told() -> None:
    """Left over: a tenth of what was added; half of it noise, to which a lag answers too, then shares of a share.

    But for the very first pass, which follows none.
    """
    plain = recorded(PIECE)
    n, largest = plain.n_whiskers, 3.0 * abs(plain.touch.land_moment_n_mm())
    lag = lagging(LAG, largest_n_mm=largest)
    memory = replace(
        creeping(CREEP, n_whiskers=n),
        play_weight=np.repeat(lag.play_weight, n, axis=0),
        play_n_mm=lag.play_n_mm,
        largest_n_mm=largest,
    )
    held = with_memory(plain, memory)
    for sweep, before, creep in zip(held.sweeps, plain.sweeps, crept(held), strict=True):
        pressed = calibrated_moments(plain, before)
        added = calibrated_moments(held, sweep) - pressed
        lags = [lagged(line, largest_n_mm=largest) for line in pressed.reshape(-1, pressed.shape[2])]
        told = CREEP * creep + LAG * np.reshape(lags, pressed.shape)
        assert np.sqrt(np.nanmean((added - told)[1:] ** 2)) < 0.1 * np.sqrt(np.nanmean(added**2))


def test_a_gauge_without_memory_is_found_to_have_none() -> None:
    found = identify(recorded(PIECE), PIECE.height_mm, whisker=default_touch(5.0))
    # of a short recording; gauges of whiskers show 0.016 and more of both together
    assert found.bench.memory == pytest.approx(np.zeros((2, 2)), abs=0.006)
