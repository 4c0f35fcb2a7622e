"""The grid for mud: no finer than films and drops need."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from glyphs.opencv import cv2
from glyphs.soiling import grids
from glyphs.soiling.coat import Coat
from glyphs.surface.noise import Field, smooth_noise


class Grid(NamedTuple):
    """Every `step`-th sample of a coat, with the character height and the depth of its marks."""

    step: int
    shape: tuple[int, int]
    pitch_mm: float
    height_mm: float
    depth_mm: float

    @property
    def size_mm(self) -> NDArray[np.float64]:
        return np.array(self.shape)[::-1] * self.pitch_mm

    def noise(self, x_mm: float, y_mm: float, rng: np.random.Generator) -> Field:
        """Smooth noise with different lengths in x and y, drawn on a coarser grid."""
        rows, cols = self.shape
        thin = [max(1.0, length / (2.5 * self.pitch_mm)) for length in (y_mm, x_mm)]
        small = (int(np.ceil(rows / thin[0])) + 2, int(np.ceil(cols / thin[1])) + 2)
        noise = smooth_noise(small, pitch_mm=1.0, length_mm=2.5, rng=rng)
        return grids.resize(noise, self.shape, how="cubic")

    def whole(self, field: Field, shape: tuple[int, int]) -> Field:
        """Interpolate a field of this grid linearly to all samples of the coat."""
        if self.step == 1:
            return field
        scale = np.array([[1.0 / self.step, 0.0, 0.0], [0.0, 1.0 / self.step, 0.0]])
        return np.asarray(
            cv2.warpAffine(
                np.ascontiguousarray(field, dtype=np.float32),
                scale,
                shape[::-1],
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )
        )


def thin_grid(coat: Coat) -> Grid:
    """A grid fine enough for films and drops; its mark depth is limited to 0.03 to 0.08 character heights."""
    step = max(1, int(coat.height_mm / (45.0 * coat.pitch_mm)))
    rows, cols = ((n + step - 1) // step for n in coat.shape)
    relief = float(np.percentile(np.abs(coat.clean_mm - coat.brim_mm)[::2, ::2], 97.0))
    depth = float(np.clip(relief, 0.03 * coat.height_mm, 0.08 * coat.height_mm))
    return Grid(step, (rows, cols), step * coat.pitch_mm, coat.height_mm, depth)


def blur(grid: Grid, field: Field, width_mm: float) -> Field:
    """Blur a field of the coat by a Gaussian of a given width."""
    thin = np.ascontiguousarray(field[:: grid.step, :: grid.step])
    smooth = grids.blur(thin, max(width_mm / grid.pitch_mm, 0.5))
    return grid.whole(smooth, (field.shape[0], field.shape[1]))
