"""Perturb a part by small changes that should not matter, as if it were measured again.

    shift  the traced lines lie half a line pitch beside the original ones
    noise  realistic touch sensors in place of ideal ones; the camera's sensor a little noisier
    light  the photograph 6 % brighter or darker
    scale  the part 1 % larger or smaller: a scale error of stage or lens
    order  directions and passes stored the other way round

The signs and the noise are drawn from a seed, so that every process perturbs a part in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from recognition.find.first_pass import Feel
    from recognition.see.virtual_array import VirtualArray
    from whisker_array.scan.scan import Scan
    from whisker_array.scan.sweep import Sweep

# standard deviation of the noise added to a photograph, besides its own, as a share of full scale
CAMERA_NOISE = 0.01
_UNKNOWN_NOISE = 1e-3  # added to a recording without air samples, as a share of the median moment


@dataclass(frozen=True)
class Perturbation:
    """A kind of perturbation and its size."""

    name: str
    shift: float = 0.0  # of the traced lines, in line pitches, along x and y
    noise: bool = False
    light: float = 0.0  # share by which the photograph is brighter or darker
    scale: float = 0.0  # share by which the part is larger or smaller
    reordered: bool = False  # directions and passes are in reverse order
    drawn: bool = False  # shift, light and scale are drawn at random, with these as the largest values

    def reaches(self, senses: Sequence[str]) -> bool:
        """Whether it changes anything for these senses: "touch" or "felt", "vision" or "lights" (default: all)."""
        wanted = set(senses) or {"touch", "vision"}
        both = self.noise or self.scale
        of_touch = both or self.shift or self.reordered
        return bool(
            (of_touch and wanted & {"touch", "felt"})
            or ((both or self.light) and wanted & {"vision", "lights"})
        )


PERTURBATIONS = (
    Perturbation("shift", shift=0.5),
    Perturbation("noise", noise=True),
    Perturbation("light", light=0.06),
    Perturbation("scale", scale=0.01),
    Perturbation("order", reordered=True),
)
"""Perturbations of `benchmark --perturb`."""
REMOUNTED = Perturbation("remounted", shift=1.0, noise=True, light=0.06, scale=0.01, drawn=True)
"""A part put on the stage again: `study --repeats`."""


@dataclass(frozen=True)
class Retake:
    """A simulated second measurement; `array` is the seed of gains and offsets if one array measures several times."""

    how: Perturbation
    seed: int
    array: int | None = None

    @property
    def grown(self) -> float:
        return 1.0 + self._either_way(0) * self.how.scale

    def surface(self, height_map: HeightMap) -> HeightMap:
        """Scale the part; depths are unchanged."""
        return replace(height_map, pitch_mm=height_map.pitch_mm * self.grown)

    def photo(self, photo: Photo) -> Photo:
        pixels, centre, how = photo.eight_bit, photo.centre_mm, self.how
        if how.scale:
            from glyphs.opencv import cv2

            rows, cols = photo.shape
            size = (round(cols * self.grown), round(rows * self.grown))
            method = cv2.INTER_AREA if self.grown < 1.0 else cv2.INTER_LINEAR
            pixels = np.asarray(cv2.resize(pixels, size, interpolation=method), dtype=np.uint8)
            centre = None if centre is None else (centre[0] * self.grown, centre[1] * self.grown)
        if how.light or how.noise:
            bright = pixels.astype(np.float32) * np.float32(1.0 + self._either_way(1) * how.light)
            if how.noise:
                bright += np.float32(255.0 * CAMERA_NOISE) * _normal(self.seed, bright.shape)
            pixels = np.clip(np.rint(bright), 0.0, 255.0).astype(np.uint8)
        others = tuple(self.photo(other) for other in photo.others)
        return replace(photo, pixels=pixels, centre_mm=centre, others=others)

    def feel(self, array: VirtualArray, *, soil: Soil | None, part_id: str) -> Feel:
        from recognition.see.virtual_bench import VirtualBench
        from whisker_array.scan.sensor import Sensors

        if self.how.noise:
            seed = self.seed if self.array is None else self.array
            array = replace(array, sensors=Sensors.REAL, seed=seed, noise_seed=self.seed)

        def scan(surface: HeightMap, height_mm: float) -> Scan:
            bench = VirtualBench(surface, height_mm, array, soil=soil, part_id=part_id).mounted()
            x0, y0, x1, y1 = bench.whole.region_mm
            right, down = self._shift_mm(bench.whole.line_pitch_mm)
            plan = replace(bench.whole, region_mm=(x0 + right, y0 + down, x1, y1))
            felt = bench.scan(plan)
            return reverse_order(felt) if self.how.reordered else felt

        return scan

    def recorded(self, scan: Scan) -> Scan:
        """Perturb a recording: noisier, larger or smaller, reordered; its lines stay in place."""
        sweeps = tuple(self._perturb_sweep(k, s) for k, s in enumerate(scan.sweeps))
        again = replace(scan, sweeps=sweeps, line_pitch_mm=scan.line_pitch_mm * self.grown, log=None)
        return reverse_order(again) if self.how.reordered else again

    def _perturb_sweep(self, number: int, sweep: Sweep) -> Sweep:
        plan, moment = sweep.plan, sweep.moment_n_mm
        if self.how.noise:
            air = sweep.air_n_mm
            still = float(np.median(air.std(axis=-1))) if air.shape[-1] > 1 else 0.0
            rms = still or _UNKNOWN_NOISE * float(np.nanmedian(np.abs(moment)))
            moment = moment + np.float32(rms) * _normal((self.seed, number), moment.shape)
        placed = replace(
            plan,
            line_mm=plan.line_mm * self.grown,
            start_mm=plan.start_mm * self.grown,
            step_mm=plan.step_mm * self.grown,
            offset_mm=tuple(v * self.grown for v in plan.offset_mm),
        )
        return replace(sweep, plan=placed, moment_n_mm=moment)

    def _either_way(self, number: int) -> float:
        """From -1 to 1: random, or the whole change in one direction."""
        if self.how.drawn:
            return float(np.random.default_rng((self.seed, number)).uniform(-1.0, 1.0))
        return 1.0 if self.seed % 2 else -1.0

    def _shift_mm(self, line_pitch_mm: float) -> tuple[float, float]:
        whole = self.how.shift * line_pitch_mm
        if not self.how.drawn:
            return whole, whole
        right, down = np.random.default_rng((self.seed, 2)).uniform(0.0, whole, size=2)
        return float(right), float(down)


def reverse_order(scan: Scan) -> Scan:
    """The scan with its directions, and the passes of each, in reverse order."""
    return replace(
        scan,
        sweeps=tuple(
            replace(
                s,
                plan=replace(s.plan, line_mm=s.plan.line_mm[::-1]),
                moment_n_mm=s.moment_n_mm[::-1],
                flags=s.flags[::-1],
                air_n_mm=s.air_n_mm[::-1],
            )
            for s in reversed(scan.sweeps)
        ),
        log=None,
    )


def _normal(seed: int | tuple[int, ...], shape: tuple[int, ...]) -> NDArray[np.float32]:
    return np.random.default_rng(seed).standard_normal(shape, dtype=np.float32)
