"""The virtual array: whiskers, sensors and stage that feel height maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glyphs.surface.display import one_line
from whisker_array.scan.mounting import VirtualBench as BenchOptions
from whisker_array.scan.sensor import Sensors, draw_sensor_chain
from whisker_array.scan.stage_play import draw_stage_play
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.touch import Touch, default_touch


@dataclass(frozen=True)
class VirtualArray:
    """Whiskers, sensors and stage that feel a height map."""

    whisker: Touch | None = None
    # real: gains, offsets, noise, drift and vibration as `draw_sensor_chain` draws them, 16 bits, a stage with play and
    # position errors, and whiskers that ring at its speed; ideal: none of these
    sensors: Sensors = Sensors.REAL
    fidelity: Fidelity = Fidelity.CONTACT
    # seed of sensors, noise and stage. It is the same for all parts, as they are felt by the same array: a
    # height map is always felt in the same way, whatever its name.
    seed: int = 0
    noise_seed: int | None = None
    # range of the converter in moments on the land; on edges it is up to twice that moment
    range_land_moments: float = 3.0
    # speed of the stage, and that for which the whisker is meant (default: that of the plan)
    given_speed_mm_s: float | None = None
    whisker_speed_mm_s: float | None = None

    __repr__ = one_line

    @property
    def speed_mm_s(self) -> float | None:
        """Speed of the stage; None: that of the plan."""
        return self.given_speed_mm_s or self.whisker_speed_mm_s

    def touch(self, height_mm: float) -> Touch:
        return self.whisker or default_touch(height_mm)

    def draw(self, plan: RasterPlan, touch: Touch) -> BenchOptions:
        """Draw sensors and stage for the whiskers of a plan; without any if they are ideal."""
        if self.sensors is Sensors.IDEAL:
            return {"fidelity": self.fidelity}
        rng = np.random.default_rng(self.seed)
        range_n_mm = self.range_land_moments * abs(touch.land_moment_n_mm())
        chain = draw_sensor_chain(
            plan.array.n_whiskers * plan.array.kinds, rng=rng, full_scale_n_mm=range_n_mm
        )
        stage = draw_stage_play(rng=rng.spawn(1)[0])
        noise = rng if self.noise_seed is None else np.random.default_rng(self.noise_seed)
        return {"fidelity": self.fidelity, "sensor": chain, "stage": stage, "at_speed": True, "rng": noise}


USUAL_ARRAY = VirtualArray()
