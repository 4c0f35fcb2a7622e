"""A simulated session: a height map is mounted once and scanned pass by pass by the virtual array."""

from __future__ import annotations

from dataclasses import replace
from typing import Unpack

import numpy as np

from glyphs.signatures import lists_options
from glyphs.surface.maps import HeightMap
from whisker_array.scan.calibration import MIN_LEAD_IN_SAMPLES, Calibration, calibrate_lead_in
from whisker_array.scan.mounting import Mounted, VirtualBench, mount
from whisker_array.scan.sensor import SensorChain, measure
from whisker_array.scan.sensor_memory import (
    CREEP,
    HOLD_S,
    ZERO_SHIFT,
    SensorMemory,
    SensorState,
    fit_memory,
    read_gauges,
)
from whisker_array.scan.session import Fitting
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.array import WhiskerArray
from whisker_array.whisker.passes import Pass
from whisker_array.whisker.touch import Touch

_BENCH_SAMPLES = 16 * MIN_LEAD_IN_SAMPLES
_MOMENT_SAMPLES = 16
"""Number of samples of one reading on the bench: too short for creep."""
_BEYOND_HEIGHTS = 0.5
"""Greatest run of whiskers beyond the part, character heights."""


def bench_calibration(
    chain: SensorChain, touch: Touch, *, sample_rate_hz: float, rng: np.random.Generator
) -> Calibration:
    """Measure gains and offsets of an array in air and then on a reference plate.

    Creep and hysteresis, if the chain has them, are measured by holding and removing one load.
    """
    air = np.zeros((chain.n_whiskers, _BENCH_SAMPLES))
    land_n_mm = touch.land_moment_n_mm()
    (raw_air, _), (raw_land, _) = (
        measure(one, chain=chain, sample_rate_hz=sample_rate_hz, rng=rng) for one in (air, air + land_n_mm)
    )
    found = calibrate_lead_in(raw_air, raw_land, expected_land_moment_n_mm=land_n_mm)
    if chain.memory is None:
        return found
    memory = _bench_memory(chain, chain.memory.largest_n_mm, sample_rate_hz=sample_rate_hz, rng=rng)
    rest = SensorState.at_rest(chain.n_whiskers, memory)
    read = read_gauges(air + land_n_mm, memory=memory, state=rest, step_s=1.0 / sample_rate_hz)
    # convert to the gain of a gauge without memory, which the plate does not show
    return replace(found, gain=found.gain * land_n_mm / read.mean(axis=1), memory=memory)


def _bench_memory(
    chain: SensorChain, largest_n_mm: float, *, sample_rate_hz: float, rng: np.random.Generator
) -> SensorMemory:
    """Fit the memory to the gauges' response to holding and removing the largest load; it includes their drift."""
    air, hold = np.zeros((chain.n_whiskers, _MOMENT_SAMPLES)), round(HOLD_S * sample_rate_hz)
    load = np.concatenate([air, np.full((chain.n_whiskers, hold), -largest_n_mm), air], axis=1)
    # the bench's own converter, whose range covers the largest load and its creep
    wide = replace(chain, adc_range_n_mm=2.0 * chain.adc_range_n_mm)
    raw, _ = measure(load, chain=wide, sample_rate_hz=sample_rate_hz, rng=rng)
    n = _MOMENT_SAMPLES
    zero, first, last, after = (
        raw[:, at : at + n].mean(axis=1, dtype=np.float64) for at in (0, n, hold, n + hold)
    )
    shift = np.clip((after - zero) / (first - zero), *ZERO_SHIFT)
    crept = np.clip((last - first) / (first - zero), CREEP[0], shift)
    return fit_memory(crept, shift, largest_n_mm=largest_n_mm)


class SimulatedSession:
    """A `StageSession` over a height map.

    Attributes:
        fitting: whiskers, field and calibration.
        felt_s: stage seconds of the passes so far.
    """

    @lists_options(mount, VirtualBench.__annotations__)
    def __init__(
        self,
        height_map: HeightMap,
        *,
        touch: Touch,
        array: WhiskerArray,
        height_mm: float,
        sample_pitch_mm: float,
        calibration: Calibration | None = None,
        part_id: str = "",
        **bench: Unpack[VirtualBench],
    ) -> None:
        """Mount the part.

        Args:
            height_map: the surface, level, with its land about at zero.
            touch: whisker, usual preload, tip.
            array: the comb, of one row.
            height_mm: character height that the whiskers are built for.
            sample_pitch_mm: finest sample pitch that will be used.
            calibration: calibration of the sensor, if known; ignored for ideal sensors.
            part_id: name of the part.
            bench: fidelity, friction, soil, sensor, stage and rng, as in `trace_scan`.

        Raises:
            MapError: a friction map or soil that does not fit.
            ValueError: a sensor or a stage without `rng`.
        """
        part = mount(
            height_map,
            touches=(touch,),
            sample_pitch_mm=sample_pitch_mm,
            beyond_mm=_BEYOND_HEIGHTS * height_mm + 2.0 * sample_pitch_mm,
            **bench,
        )
        if part.sensor is None:
            # gains of an ideal sensor are known; lines that are far apart cannot show them
            whiskers = array.n_whiskers * array.rows
            calibration = Calibration(np.ones(whiskers), np.zeros(whiskers))
        self.fitting = Fitting(
            touch=touch,
            array=array,
            height_mm=height_mm,
            field_mm=(0.0, 0.0, *height_map.size_mm),
            calibration=calibration,
            fidelity=part.fidelity.value,
            part_id=part_id,
        )
        self.felt_s = 0.0
        self._part: Mounted | None = part

    def feel(self, order: Pass) -> Sweep:
        """Feel one pass.

        Raises:
            StageError: the session is closed, or the pass is meant for another array.
        """
        if self._part is None:
            raise StageError("the part is no longer on the stage", "open a new session for every part")
        whiskers = self.fitting.array.n_whiskers * self.fitting.array.kinds
        if len(order.line_mm) != whiskers:
            raise StageError(
                f"a pass of {len(order.line_mm)} whiskers for an array of {whiskers}",
                "plan it for this array",
            )
        self.felt_s += order.stage_s
        return self._part.feel(
            order.sweep_plan(),
            air_samples=order.air_samples,
            sample_rate_hz=order.sample_rate_hz,
            pause_s=order.turnaround_s,
            preload_mm=order.preload_mm,
        )

    def close(self) -> None:
        """Release the part."""
        self._part = None
