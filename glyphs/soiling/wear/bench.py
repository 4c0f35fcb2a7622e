"""A surface under stiff tools: the level at which they touch it, and the depth of the marks below that level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glyphs.soiling.coat import Coat
from glyphs.soiling.grids import blur, resize
from glyphs.surface.display import OneLine
from glyphs.surface.noise import Field, ramp, share, smooth_noise


@dataclass(frozen=True, eq=False, repr=False)
class Bench(OneLine):
    """A surface under the tools: `level_mm` is that of a stiff tool that rests on it and spans the strokes."""

    coat: Coat
    level_mm: Field
    deep_mm: float

    def low(self, z_mm: Field) -> Field:
        """0 where a tool touches, 1 in the hollows."""
        return rise(self.level_mm - z_mm - np.float32(0.25 * self.deep_mm), 0.5 * self.deep_mm)


def on_bench(coat: Coat) -> Bench:
    """Rest a stiff tool on the surface: on the land if the marks are sunk, on the marks if they are raised."""
    from glyphs.opencv import cv2

    rows, cols = coat.shape
    step = max(1, int(0.03 * coat.height_mm / coat.pitch_mm))
    cell = coat.height_mm / (coat.pitch_mm * step)
    thin = resize(coat.z_mm, (-(-rows // step), -(-cols // step)), how="area")
    stroke, line, held = (np.ones((2 * round(r * cell) + 1,) * 2, dtype=np.uint8) for r in (0.25, 0.7, 1.0))
    # closing spans sunk strokes, opening then removes raised lines; both keep tilt and bow of the plate
    top = cv2.morphologyEx(thin, cv2.MORPH_CLOSE, stroke)
    land = cv2.morphologyEx(top, cv2.MORPH_OPEN, line)
    stands = blur(cv2.dilate(top - land, held), 0.2 * cell)
    level = resize(blur(land, 0.08 * cell) + stands, coat.shape)
    deep = float(np.percentile((level - coat.z_mm)[::3, ::3], 98.0))
    return Bench(coat, level, max(deep, 0.01 * coat.height_mm))


def rise(values_mm: Field, full_mm: float) -> Field:
    """Smooth step from 0 at 0 to 1 at `full_mm`, float32."""
    return ramp(values_mm, np.zeros((), np.float32), np.asarray(full_mm, np.float32))


def patches(coat: Coat, length_mm: float, rng: np.random.Generator) -> Field:
    """Broad patches, uniform from 0 to 1, drawn on a coarse grid."""
    step = max(1, int(length_mm / (8.0 * coat.pitch_mm)))
    thin = (-(-coat.shape[0] // step), -(-coat.shape[1] // step))
    noise = smooth_noise(thin, pitch_mm=step * coat.pitch_mm, length_mm=length_mm, rng=rng)
    return resize(share(noise), coat.shape)
