"""Small changes that should not matter: a part measured again is the same part.

    shift  the traced lines lie half a line pitch beside those of before
    noise  sensors as from the bench, in place of ideal ones; the camera's sensor a little noisier
    light  the photograph 6 % brighter or darker
    scale  the part 1 % larger or smaller: a stage or a lens that is out by so much
    order  directions and passes stored the other way round

Each reaches touch, the camera or both. The signs and the noise are drawn from a seed, so that a part is perturbed in
the same way whoever does it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from recognition.senses.touch import Feel
    from whisker_array.scan.scan import Scan
    from whisker_array.simulation.traces import Fidelity

CAMERA_NOISE = 0.01
"""Standard deviation of the noise that is added to a photograph, of full scale; it has its own already."""


@dataclass(frozen=True)
class Perturbation:
    """What is changed, and by how much.

    Attributes:
        name: one word.
        shift: of the traced lines, in line pitches, along x and y.
        noise: whether sensors are noisy.
        light: share by which the photograph is brighter or darker.
        scale: share by which the part is larger or smaller.
        reordered: whether directions and passes come the other way round.

    Raises:
        ValueError: it changes nothing, a shift below 0, or a share that is not below 1.
    """

    name: str
    shift: float = 0.0
    noise: bool = False
    light: float = 0.0
    scale: float = 0.0
    reordered: bool = False

    def __post_init__(self) -> None:
        if not (self.shift >= 0.0 and 0.0 <= self.light < 1.0 and 0.0 <= self.scale < 1.0):
            raise ValueError(f"the perturbation {self.name!r} is out of range")
        if not (self.shift or self.noise or self.light or self.scale or self.reordered):
            raise ValueError(f"the perturbation {self.name!r} changes nothing")

    def reaches(self, senses: Sequence[str]) -> bool:
        """Whether it changes anything for some senses ("touch" or "felt", "vision"); of none all may be used."""
        touched = self.shift or self.noise or self.scale or self.reordered
        seen = self.light or self.noise or self.scale
        wanted = set(senses) or {"touch", "vision"}
        return bool((touched and wanted & {"touch", "felt"}) or (seen and "vision" in wanted))

    def grown(self, seed: int) -> float:
        """How many times as large the part is."""
        return 1.0 + _sign(seed) * self.scale

    def surface(self, height_map: HeightMap, *, seed: int) -> HeightMap:
        """The part larger or smaller; depths stay."""
        return (
            replace(height_map, pitch_mm=height_map.pitch_mm * self.grown(seed)) if self.scale else height_map
        )

    def photo(self, photo: Photo, *, seed: int) -> Photo:
        """The photograph taken again."""
        pixels, centre = photo.pixels, photo.centre_mm
        if self.scale:
            from glyphs.opencv import cv2

            grown = self.grown(seed)
            rows, cols = photo.shape
            size = (round(cols * grown), round(rows * grown))
            method = cv2.INTER_AREA if grown < 1.0 else cv2.INTER_LINEAR
            pixels = np.asarray(cv2.resize(pixels, size, interpolation=method), dtype=np.uint8)
            centre = None if centre is None else (centre[0] * grown, centre[1] * grown)
        if self.light or self.noise:
            bright = pixels.astype(np.float32) * np.float32(1.0 + _sign(seed) * self.light)
            if self.noise:
                drawn = np.random.default_rng(seed).standard_normal(bright.shape, dtype=np.float32)
                bright += np.float32(255.0 * CAMERA_NOISE) * drawn
            pixels = np.clip(np.rint(bright), 0.0, 255.0).astype(np.uint8)
        return replace(photo, pixels=pixels, centre_mm=centre)

    def feel(self, *, fidelity: Fidelity, soil: Soil | None, part_id: str, seed: int) -> Feel:
        """How touch scans the surface again."""
        from pipeline.reading.simulated_scan import feel
        from whisker_array.whisker.array import default_plan

        def scan(surface: HeightMap, height_mm: float) -> Scan:
            whole = default_plan((0.0, 0.0, *surface.size_mm), character_height_mm=height_mm)
            x0, y0, x1, y1 = whole.region_mm
            by = self.shift * whole.line_pitch_mm
            felt = feel(
                surface,
                plan=replace(whole, region_mm=(x0 + by, y0 + by, x1, y1)),
                height_mm=height_mm,
                fidelity=fidelity,
                noise=self.noise,
                sensor_seed=seed,
                part_id=part_id,
                soil=soil,
            )
            return reordered(felt) if self.reordered else felt

        return scan


HALF_PITCH = Perturbation("shift", shift=0.5)
PERTURBATIONS = (
    HALF_PITCH,
    Perturbation("noise", noise=True),
    Perturbation("light", light=0.06),
    Perturbation("scale", scale=0.01),
    Perturbation("order", reordered=True),
)
"""Those of `benchmark --perturb`."""


def reordered(scan: Scan) -> Scan:
    """The scan with its directions, and the passes of each, stored the other way round."""
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
    )


def _sign(seed: int) -> float:
    return 1.0 if seed % 2 else -1.0
