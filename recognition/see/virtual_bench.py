"""The virtual bench: the array that feels height maps where no stage does.

height map --mount: square, level--> VirtualBench --scan: the whole plan-----------------> Scan
             VirtualArray: whisker, sensors    '--open_session: pass by pass--> StageSession
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime

from glyphs.soiling.soil import Soil
from glyphs.surface.display import one_line
from glyphs.surface.maps import HeightMap
from recognition.see.levelling import level, square_to_plate
from recognition.see.virtual_array import USUAL_ARRAY, VirtualArray
from whisker_array.scan.mounting import VirtualBench as BenchOptions
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.simulated_session import SimulatedSession, bench_calibration
from whisker_array.whisker.array import SAFE_SPEED_MM_S, RasterPlan, default_plan
from whisker_array.whisker.touch import Touch, profiling_touch


@dataclass(frozen=True, eq=False)
class VirtualBench:
    """A part under the virtual array; the default friction is that of the soil, or the touch's nominal one."""

    height_map: HeightMap
    height_mm: float
    array: VirtualArray = USUAL_ARRAY
    soil: Soil | None = None
    friction: float | None = None
    part_id: str = ""

    __repr__ = one_line

    def mounted(self) -> VirtualBench:
        """The bench with its height map turned square to the plate, and levelled. Raises MapError."""
        squared, soil = square_to_plate(self.height_map, self.soil)
        return replace(self, height_map=level(squared), soil=soil)

    @property
    def whole(self) -> RasterPlan:
        region = (0.0, 0.0, *self.height_map.size_mm)
        return default_plan(region, character_height_mm=self.height_mm, speed_mm_s=self.array.speed_mm_s)

    def scan(self, plan: RasterPlan | None = None) -> Scan:
        """Simulate a scan of the whole part or by a plan; a second kind of whiskers are profilers. Raises MapError."""
        plan, touch = plan or self.whole, self.array.touch(self.height_mm)
        scan = trace_scan(
            self.height_map,
            touch=touch,
            plan=plan,
            part_id=self.part_id,
            others=(profiling_touch(self.height_mm),) if plan.array.kinds > 1 else (),
            **self._options(plan, touch),
        )
        return replace(scan, start_time=datetime.now(UTC).isoformat(timespec="seconds"))

    def open_session(self) -> SimulatedSession:
        """Open a session pass by pass, with the comb of the default plan and known gains. Raises MapError."""
        touch, usual = self.array.touch(self.height_mm), self.whole
        options, known = self._options(usual, touch), None
        chain, rng = options.get("sensor"), options.get("rng")
        if chain is not None and rng is not None:
            known = bench_calibration(chain, touch, sample_rate_hz=usual.sample_rate_hz, rng=rng)
        return SimulatedSession(
            self.height_map,
            touch=touch,
            array=usual.array,
            height_mm=self.height_mm,
            sample_pitch_mm=usual.sample_pitch_mm,
            calibration=known,
            part_id=self.part_id,
            speed_mm_s=self.array.speed_mm_s or SAFE_SPEED_MM_S,
            **options,
        )

    def _options(self, plan: RasterPlan, touch: Touch) -> BenchOptions:
        return {**self.array.draw(plan, touch), "friction": self.friction, "soil": self.soil}
