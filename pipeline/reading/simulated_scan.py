"""Simulate a scan of a height map: mounted level, scanned whole, with realistic sensors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from glyphs.errors import MarksError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from recognition.decide.decision import Decision
from recognition.reader import Reader
from recognition.see.levelling import level, square_to_plate
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, draw_sensor_chain
from whisker_array.scan.simulated_session import SimulatedSession, bench_calibration
from whisker_array.scan.stage_play import StagePlay, draw_stage_play
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, default_plan
from whisker_array.whisker.touch import Touch, default_touch, profiling_touch

_RANGE_LAND_MOMENTS = 3.0


def find_height_mm(height_map: HeightMap, *, soil: Soil | None = None) -> float:
    """Find the character height by reading the part.

    Dirt makes bands of its own, and only a reading finds the band that is the line.

    Raises:
        MarksError: no characters were found.
    """
    reading = Reader().read(height_map, soil=soil)
    if not reading.characters or reading.decision is Decision.REJECT:
        raise MarksError("no characters were found, so the scale is unknown", hint="give --height-mm")
    return float(f"{reading.height_mm:.3g}")


@dataclass(frozen=True, eq=False)
class VirtualBench:
    """A part mounted under the virtual array, optionally with small realistic errors of sensors and stage.

    Attributes:
        height_map: the part, turned square to the plate; it is levelled before a scan.
        height_mm: character height that the whiskers are built for.
        fidelity: fidelity of the simulated touch.
        noise: whether to simulate gains, offsets, drift, vibration and a 16 bit converter; else sensors are ideal.
        memory: whether noise includes creep, hysteresis, and play and errors of the stage.
        sensor_seed: seed of gains, offsets, noise and everything else on the bench.
        part_id: name of the part.
        friction: true friction of the part (default: that of the soil; without soil, the touch's nominal one).
        soil: dirt on the part, whose top surface is the map (default: no dirt).
    """

    height_map: HeightMap
    height_mm: float
    fidelity: Fidelity = Fidelity.CONTACT
    noise: bool = True
    memory: bool = True
    sensor_seed: int = 0
    part_id: str = ""
    friction: float | None = None
    soil: Soil | None = None

    def __post_init__(self) -> None:
        height_map, soil = square_to_plate(self.height_map, self.soil)
        object.__setattr__(self, "height_map", height_map)
        object.__setattr__(self, "soil", soil)

    @property
    def whole(self) -> RasterPlan:
        """The default plan of the whole part."""
        return default_plan((0.0, 0.0, *self.height_map.size_mm), character_height_mm=self.height_mm)

    def scan(
        self, plan: RasterPlan | None = None, *, touch: Touch | None = None, noise_seed: int | None = None
    ) -> Scan:
        """Simulate a scan.

        Args:
            plan: the raster (default: the whole part); if its array has two kinds of whiskers, the second are
                profilers.
            touch: whisker of the first row (default: the usual one for the height).
            noise_seed: seed of the noise, if the same sensors measure again.

        Raises:
            MapError: the map cannot be scanned, or the soil is on another grid.
        """
        plan, touch = plan or self.whole, touch or default_touch(self.height_mm)
        rng, chain, stage = self._drawn(plan, touch)
        drawn = rng if noise_seed is None else np.random.default_rng(noise_seed)
        scan = trace_scan(
            level(self.height_map),
            touch=touch,
            plan=plan,
            fidelity=self.fidelity,
            sensor=chain,
            stage=stage,
            rng=drawn if self.noise else None,
            part_id=self.part_id,
            friction=self.friction,
            soil=self.soil,
            others=(profiling_touch(self.height_mm),) if plan.array.kinds > 1 else (),
        )
        return replace(scan, start_time=datetime.now(UTC).isoformat(timespec="seconds"))

    def open_session(self) -> SimulatedSession:
        """Open a session that scans pass by pass, with the comb of the default plan and known gains.

        Raises:
            MapError: the map cannot be scanned, or the soil is on another grid.
        """
        touch, usual = default_touch(self.height_mm), self.whole
        rng, chain, stage = self._drawn(usual, touch)
        rate = usual.sample_rate_hz
        known = None if chain is None else bench_calibration(chain, touch, sample_rate_hz=rate, rng=rng)
        return SimulatedSession(
            level(self.height_map),
            touch=touch,
            array=usual.array,
            height_mm=self.height_mm,
            sample_pitch_mm=usual.sample_pitch_mm,
            fidelity=self.fidelity,
            friction=self.friction,
            soil=self.soil,
            sensor=chain,
            stage=stage,
            calibration=known,
            rng=rng if self.noise else None,
            part_id=self.part_id,
        )

    def _drawn(
        self, plan: RasterPlan, touch: Touch
    ) -> tuple[np.random.Generator, SensorChain | None, StagePlay | None]:
        """Draw the sensors and the stage; without memory the stage has no play either."""
        rng = np.random.default_rng(self.sensor_seed)
        if not self.noise:
            return rng, None, None
        whiskers, range_n_mm = plan.array.n_whiskers * plan.array.kinds, abs(touch.land_moment_n_mm())
        chain = draw_sensor_chain(
            whiskers, rng=rng, full_scale_n_mm=_RANGE_LAND_MOMENTS * range_n_mm, memory=self.memory
        )
        return rng, chain, draw_stage_play(rng=rng.spawn(1)[0]) if self.memory else None
