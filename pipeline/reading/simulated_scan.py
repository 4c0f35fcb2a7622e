"""A height map under the virtual array: mounted level, scanned whole, with sensors as from the bench."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from glyphs.errors import MarksError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from recognition.decision.decide import Decision
from recognition.reader import Reader
from recognition.views.levelling import level
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, draw_sensor_chain
from whisker_array.scan.simulated_session import SimulatedSession, bench_calibration
from whisker_array.scan.stage_play import StagePlay, draw_stage_play
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, default_plan
from whisker_array.whisker.touch import Touch, default_touch, profiling_touch

_RANGE_LAND_MOMENTS = 3.0


def find_height_mm(height_map: HeightMap, *, soil: Soil | None = None) -> float:
    """The character height that reading the part finds.

    Dirt shows bands of its own, so that only a reading finds which of them is the line.

    Raises:
        MarksError: nothing to be read.
    """
    reading = Reader().read(height_map, soil=soil)
    if not reading.characters or reading.decision is Decision.REJECT:
        raise MarksError("no characters were found, so the scale is unknown", hint="give --height-mm")
    return float(f"{reading.height_mm:.3g}")


def feel(
    height_map: HeightMap,
    *,
    plan: RasterPlan,
    height_mm: float,
    fidelity: Fidelity = Fidelity.CONTACT,
    noise: bool = True,
    memory: bool = True,
    sensor_seed: int = 0,
    noise_seed: int | None = None,
    part_id: str = "",
    touch: Touch | None = None,
    friction: float | None = None,
    soil: Soil | None = None,
) -> Scan:
    """Simulate a scan of the map; with noise, sensors and stage have realistic small errors.

    Args:
        height_map: the part.
        plan: the raster; of two kinds of whiskers the second are profilers.
        height_mm: character height.
        fidelity: how touch is simulated.
        noise: simulate gains, offsets, drift, vibration and a 16 bit converter; sensors are ideal otherwise.
        memory: with noise, simulate creep and hysteresis, and play and errors of the stage as well.
        sensor_seed: seed of gains, offsets, noise and everything else on the bench.
        noise_seed: seed of the noise, if the same sensors measure again.
        part_id: name of the part.
        touch: whisker of the first row (default: the default one for the height).
        friction: true friction of the part (default: that of the soil; without soil, the touch's nominal one).
        soil: dirt on the part, whose top surface is the map (default: no dirt).

    Raises:
        MapError: the map cannot be scanned, or soil on another grid.
    """
    touch = touch if touch is not None else default_touch(height_mm)
    n_whiskers = plan.array.n_whiskers * plan.array.kinds
    rng, chain, stage = _bench(n_whiskers, touch, noise=noise, memory=memory, seed=sensor_seed)
    drawn = rng if noise_seed is None else np.random.default_rng(noise_seed)
    scan = trace_scan(
        level(height_map),
        touch=touch,
        plan=plan,
        fidelity=fidelity,
        sensor=chain,
        stage=stage,
        rng=drawn if noise else None,
        part_id=part_id,
        friction=friction,
        soil=soil,
        others=(profiling_touch(height_mm),) if plan.array.kinds > 1 else (),
    )
    return replace(scan, start_time=datetime.now(UTC).isoformat(timespec="seconds"))


def _bench(
    n_whiskers: int, touch: Touch, *, noise: bool, memory: bool, seed: int
) -> tuple[np.random.Generator, SensorChain | None, StagePlay | None]:
    """Draw the sensors and the stage of one bench; without memory the stage has no play either."""
    rng = np.random.default_rng(seed)
    if not noise:
        return rng, None, None
    full_scale = _RANGE_LAND_MOMENTS * abs(touch.land_moment_n_mm())
    chain = draw_sensor_chain(n_whiskers, rng=rng, full_scale_n_mm=full_scale, memory=memory)
    return rng, chain, draw_stage_play(rng=rng.spawn(1)[0]) if memory else None


def open_session(
    height_map: HeightMap,
    *,
    height_mm: float,
    fidelity: Fidelity = Fidelity.CONTACT,
    noise: bool = True,
    memory: bool = True,
    sensor_seed: int = 0,
    part_id: str = "",
    friction: float | None = None,
    soil: Soil | None = None,
) -> SimulatedSession:
    """Mount the part on the simulated stage, to be felt pass by pass; the comb is that of the default plan.

    With noise, sensors and stage are drawn as in `feel`, and the gains are known as on a bench.

    Args:
        height_map: the part.
        height_mm: character height that the whiskers are built for.
        fidelity: how touch is simulated.
        noise: simulate gains, offsets, drift, vibration and a 16 bit converter; sensors are ideal otherwise.
        memory: with noise, simulate creep and hysteresis, and play and errors of the stage as well.
        sensor_seed: seed of gains, offsets, noise and everything else on the bench.
        part_id: name of the part.
        friction: true friction of the part (default: that of the soil; without soil, the touch's nominal one).
        soil: dirt on the part, whose top surface is the map (default: no dirt).

    Raises:
        MapError: the map cannot be felt, or soil on another grid.
    """
    touch = default_touch(height_mm)
    usual = default_plan((0.0, 0.0, *height_map.size_mm), character_height_mm=height_mm)
    rng, chain, stage = _bench(usual.array.n_whiskers, touch, noise=noise, memory=memory, seed=sensor_seed)
    rate = usual.sample_rate_hz
    known = None if chain is None else bench_calibration(chain, touch, sample_rate_hz=rate, rng=rng)
    return SimulatedSession(
        level(height_map),
        touch=touch,
        array=usual.array,
        height_mm=height_mm,
        sample_pitch_mm=usual.sample_pitch_mm,
        fidelity=fidelity,
        friction=friction,
        soil=soil,
        sensor=chain,
        stage=stage,
        calibration=known,
        rng=rng if noise else None,
        part_id=part_id,
    )
