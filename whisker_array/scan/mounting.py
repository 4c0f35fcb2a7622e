"""Mount a part under the virtual array: its surface is prepared once for any number of passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import TypedDict

import numpy as np

from glyphs.soiling.soil import Soil
from glyphs.surface.maps import MAX_PIXELS, HeightMap, MapError
from whisker_array.scan.sensor import SensorChain, measure
from whisker_array.scan.stage_play import StagePlay, apply_screw_wave, displace_plan
from whisker_array.scan.stagger import to_instants, to_places
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.regrid import fit_pitch, fit_soil, pad_soil
from whisker_array.simulation.surface import (
    Friction,
    check_friction,
    check_soil,
    orient,
    prepare_surface,
)
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.simulation.tracing import trace_sweep
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.touch import Touch


class VirtualBench(TypedDict, total=False):
    """Keyword arguments of `Mounted` that describe surface, simulation and bench."""

    fidelity: Fidelity
    friction: Friction | None
    soil: Soil | None
    sensor: SensorChain | None
    stage: StagePlay | None
    at_speed: bool
    rng: np.random.Generator | None


class Mounted:
    """A part on the virtual bench, prepared for passes. Raises MapError; ValueError: a sensor or stage lacks `rng`."""

    def __init__(
        self,
        height_map: HeightMap,
        *,
        touches: Sequence[Touch],
        sample_pitch_mm: float,
        beyond_mm: float,
        friction: Friction | None = None,
        soil: Soil | None = None,
        fidelity: Fidelity = Fidelity.CONTACT,
        sensor: SensorChain | None = None,
        stage: StagePlay | None = None,
        at_speed: bool = False,
        rng: np.random.Generator | None = None,
    ) -> None:
        if rng is None and (sensor is not None or stage is not None):
            raise ValueError(
                "a sensor chain or stage draws noise: give it a random generator, rng=numpy.random.default_rng(seed)"
            )
        if friction is None:
            friction = touches[0].friction if soil is None else soil.friction
        mu = check_friction(friction, height_map.shape)
        # pad by repeated edges for lead-in and outermost lines, then make the grid as fine as the steps
        pad = int(np.ceil(beyond_mm / height_map.pitch_mm)) + 1
        (width, height), (rows, cols) = height_map.size_mm, height_map.shape
        if (rows + 2 * pad) * (cols + 2 * pad) > MAX_PIXELS:
            raise MapError(
                f"the map is {width:.2g} x {height:.2g} mm with samples {height_map.pitch_mm:.2g} mm apart: with the "
                f"{beyond_mm:.2g} mm beyond its edges that the whiskers need, it exceeds {MAX_PIXELS:,} samples",
                hint="check the unit of its lengths, or crop or thin the map",
            )
        padded = HeightMap(np.pad(height_map.z_mm, pad, mode="edge"), height_map.pitch_mm)
        if isinstance(mu, np.ndarray):
            mu = np.pad(mu, pad, mode="edge")
        fitted, mu = fit_pitch(padded, mu, target_mm=sample_pitch_mm)
        if soil is not None:
            check_soil(soil, height_map.shape)
            soil = fit_soil(pad_soil(soil, pad), padded, fitted, target_mm=sample_pitch_mm)
        surfaces = {
            radius: prepare_surface(fitted, tip_radius_mm=radius, friction=mu, soil=soil)
            for radius in dict.fromkeys(touch.tip_radius_mm for touch in touches)
        }
        self._surface = cache(lambda radius, direction: orient(surfaces[radius], direction))
        self.origin_mm, self.size_mm = -pad * height_map.pitch_mm, height_map.size_mm
        self.touches, self.fidelity, self.sensor, self.stage = touches, fidelity, sensor, stage
        self.at_speed, self.rng = at_speed, rng
        # zeros of the whiskers, which drift
        self.drift_n_mm = np.zeros(0 if sensor is None else sensor.n_whiskers)

    def feel(
        self,
        sweep: SweepPlan,
        *,
        air_samples: int,
        sample_rate_hz: float,
        pause_s: float = 0.0,
        preload_mm: float | None = None,
    ) -> Sweep:
        stage, sensor, rng, touches = self.stage, self.sensor, self.rng, tuple(self.touches)
        if preload_mm is not None:
            touches = tuple(replace(touch, preload_mm=preload_mm) for touch in touches)
        ran = sweep
        if stage is not None and rng is not None:
            # a separate generator, so that the same seed gives the same noise with and without play
            ran = displace_plan(sweep, stage, rng=rng.spawn(1)[0])
        n, kinds = sweep.line_mm.shape[1] // len(touches), []
        for i, touch in enumerate(touches):
            whiskers = slice(i * n, (i + 1) * n)
            commanded, traced = sweep.of(whiskers), ran.of(whiskers)
            surface = self._surface(touch.tip_radius_mm, sweep.direction)
            traces = trace_sweep(
                surface,
                traced,
                touch=touch,
                fidelity=self.fidelity,
                origin_mm=self.origin_mm,
                size_mm=self.size_mm,
                commanded=commanded,
                sample_rate_hz=sample_rate_hz if self.at_speed else None,
            )
            moment, flags = traces.moment_n_mm, traces.flags
            if stage is not None:
                moment, flags = apply_screw_wave(moment, flags, commanded, stage)
            air = np.zeros((*traced.line_mm.shape, air_samples), dtype=np.float32)
            if sensor is not None and rng is not None:
                # one kind at a time: kinds reach a position one after the other, so the base shakes them
                # differently
                several = len(touches) > 1
                chain = sensor.of(range(i * n, (i + 1) * n)) if several else sensor
                # rows of one comb are shaken together, each at its own position
                behind = commanded.behind - commanded.behind.min(initial=0)
                raw, saturated = measure(
                    np.concatenate([air, to_instants(moment, behind)], axis=2),
                    chain=chain,
                    sample_rate_hz=sample_rate_hz,
                    rng=rng,
                    drift_n_mm=self.drift_n_mm[whiskers],
                    pause_s=pause_s,
                )
                air, moment = raw[..., :air_samples], to_places(raw[..., air_samples:], behind)
                clipped = to_places(saturated[..., air_samples:], behind)
                flags = flags | np.where(clipped, np.uint8(SampleFlag.OUT_OF_RANGE), np.uint8(0))
            kinds.append((moment, flags, air))
        moment, flags, air = (np.concatenate(parts, axis=1) for parts in zip(*kinds, strict=True))
        return Sweep(plan=sweep, moment_n_mm=moment, flags=flags, air_n_mm=air)
