"""Creep and lag as parts of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from glyphs.surface.pieces import Piece
from tests.support.benches import recorded
from whisker_array.estimation.edges import calibrated_moments
from whisker_array.identification.gauge_memory import gauge_effects, gauges, lag_response
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor_memory import SensorMemory, SensorState, read_gauges, rest_gauges
from whisker_array.whisker.array import RasterPlan

PIECE = Piece(angle_deg=(45.0, 30.0), floor_mm=1.0, land_mm=1.0)
CREEP, LAG = 0.012, 0.008


def with_memory(scan: Scan, memory: SensorMemory) -> Scan:
    """The scan as gauges with that memory would have recorded it, pass after pass."""
    state = SensorState.at_rest(scan.n_whiskers, memory)
    sweeps = []
    for sweep in scan.sweeps:
        moment, air = sweep.moment_n_mm.copy(), sweep.air_n_mm.copy()
        for i in range(moment.shape[0]):
            rest_gauges(memory, state, seconds=RasterPlan.turnaround_s)
            zero = np.median(air[i], axis=1)[:, None]
            load = np.concatenate([air[i] - zero, moment[i] - zero], axis=1)
            read = read_gauges(load, memory=memory, state=state, step_s=1.0 / scan.sample_rate_hz) + zero
            air[i], moment[i] = read[:, : air.shape[2]], read[:, air.shape[2] :]
        sweeps.append(replace(sweep, moment_n_mm=moment.astype(np.float32), air_n_mm=air.astype(np.float32)))
    return replace(scan, sweeps=tuple(sweeps))


def test_what_memory_adds_is_creep_and_lag_and_loads_are_the_recording_without_it() -> None:
    """Left over of what was added: a tenth, half of it noise, to which a lag answers too; of loads, a twentieth."""
    plain = recorded(PIECE)
    n, largest = plain.n_whiskers, 3.0 * abs(plain.touch.land_moment_n_mm())
    memory = np.repeat([[CREEP], [LAG]], n, axis=1)
    held = with_memory(plain, gauges(memory, largest_n_mm=largest))
    told = gauge_effects(held, gain=np.ones(n), memory=memory, largest_n_mm=largest)
    for sweep, before, found in zip(held.sweeps, plain.sweeps, told, strict=True):
        pressed = calibrated_moments(plain, before)
        added = calibrated_moments(held, sweep) - pressed
        lags = [
            lag_response(one, play_n_mm=begun, largest_n_mm=largest)
            for one, begun in zip(pressed, found.play_n_mm, strict=True)
        ]
        answer = CREEP * found.crept_n_mm + LAG * np.array(lags)
        whole = np.sqrt(np.nanmean(added**2))
        assert np.sqrt(np.nanmean((added - answer) ** 2)) < 0.1 * whole
        assert np.sqrt(np.nanmean((found.load_n_mm - pressed) ** 2)) < 0.05 * whole
