"""A simulated session: a height map is mounted once and scanned pass by pass by the virtual array."""

from __future__ import annotations

from typing import Unpack

import numpy as np

from glyphs.signatures import lists_options
from glyphs.surface.maps import HeightMap
from whisker_array.scan.calibration import MIN_LEAD_IN_SAMPLES, Calibration, calibrate_lead_in
from whisker_array.scan.mounting import Mounted, VirtualBench
from whisker_array.scan.sensor import SensorChain, measure
from whisker_array.scan.session import Fitting
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.array import SAFE_SPEED_MM_S
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.passes import Pass
from whisker_array.whisker.touch import Touch

_BENCH_SAMPLES = 16 * MIN_LEAD_IN_SAMPLES
_BEYOND_HEIGHTS = 0.5
"""Greatest run of whiskers beyond the part, character heights."""


def bench_calibration(
    chain: SensorChain, touch: Touch, *, sample_rate_hz: float, rng: np.random.Generator
) -> Calibration:
    """Measure gains and offsets of an array in air and then on a reference plate."""
    air = np.zeros((chain.n_whiskers, _BENCH_SAMPLES))
    land_n_mm = touch.land_moment_n_mm()
    (raw_air, _), (raw_land, _) = (
        measure(moment, chain=chain, sample_rate_hz=sample_rate_hz, rng=rng)
        for moment in (air, air + land_n_mm)
    )
    return calibrate_lead_in(raw_air, raw_land, expected_land_moment_n_mm=land_n_mm)


class SimulatedSession:
    """A `StageSession` over a height map, its stage seconds counted. Raises MapError or ValueError."""

    @lists_options(Mounted, VirtualBench.__annotations__)
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
        speed_mm_s: float = SAFE_SPEED_MM_S,
        **bench: Unpack[VirtualBench],
    ) -> None:
        part = Mounted(
            height_map,
            touches=(touch,),
            sample_pitch_mm=sample_pitch_mm,
            beyond_mm=_BEYOND_HEIGHTS * height_mm + 2.0 * sample_pitch_mm,
            **bench,
        )
        if part.sensor is None:
            # gains of an ideal sensor are known; lines that are far apart cannot show them
            calibration = Calibration(np.ones(array.n_whiskers), np.zeros(array.n_whiskers))
        self.fitting = Fitting(
            touch=touch,
            array=array,
            height_mm=height_mm,
            field_mm=(0.0, 0.0, *height_map.size_mm),
            calibration=calibration,
            fidelity=part.fidelity.value,
            part_id=part_id,
            speed_mm_s=speed_mm_s,
        )
        self.felt_s = 0.0
        self._part: Mounted | None = part

    def feel(self, order: Pass) -> Sweep:
        """Feel one pass. Raises StageError: the session is closed, or the pass is meant for another array."""
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
        self._part = None
