"""Pose of a camera over a plate, and its optical errors: nominally its axis meets the middle of the plate and its rows
run along x; in fact the part is slightly shifted, rotated and tilted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.ranges import Finite, NotNegative, Positive, Range, Share, Validated
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError

DEFAULT_PIXEL_MM = 0.06


@dataclass(frozen=True, repr=False)
class Camera(OneLine, Validated, error=MapError):
    """A camera straight above a plate. Raises MapError.

    Attributes:
        shift_mm: (x, y) offset of the part from its nominal position.
        rotation_deg: rotation of the part, from +x towards +y (clockwise as seen), about the middle.
        perspective_per_mm: (x, y) relative change of scale per mm, caused by tilt of the part.
        exposure_ev: over-exposure in stops (powers of two); 0 brings the mean of the picture to a medium grey.
        noise: standard deviation of the sensor's noise at full brightness, share of full scale; it is proportional
            to the square root of the light.
        bloom: share of a glint's light that spreads around it, 0..1.
    """

    pitch_mm: Positive = DEFAULT_PIXEL_MM
    shift_mm: tuple[Finite, Finite] = (0.0, 0.0)
    rotation_deg: Finite = 0.0
    perspective_per_mm: Annotated[tuple[float, float], Range(-0.01, 0.01)] = (0.0, 0.0)
    defocus_mm: NotNegative = 0.04
    exposure_ev: Finite = 0.0
    noise: NotNegative = 0.02
    dark_noise: NotNegative = 0.004
    vignetting: Share = 0.15
    bloom: Share = 0.04

    def frame(self, height_map: HeightMap) -> tuple[tuple[int, int], tuple[float, float]]:
        """Shape (rows, cols) of a picture of the whole plate, and the nominal (x, y) of its middle, mm."""
        width, height = height_map.size_mm
        shape = (max(8, round(height / self.pitch_mm) + 1), max(8, round(width / self.pitch_mm) + 1))
        return shape, (width / 2, height / 2)

    def to_plate(self, height_map: HeightMap) -> NDArray[np.float64]:
        """Homography (3, 3) from (column, row, 1) of the picture to plate (x, y, 1), mm, up to scale.

        ::

            pixel -> nominal mm about the middle -> perspective -> shift back -> turn back -> plate
        """
        (rows, cols), (mx, my) = self.frame(height_map)
        p = self.pitch_mm
        nominal = np.array([[p, 0, -p * (cols - 1) / 2], [0, p, -p * (rows - 1) / 2], [0, 0, 1.0]])
        px, py = self.perspective_per_mm
        tilt = np.array([[1.0, 0, 0], [0, 1.0, 0], [px, py, 1.0]])
        c, s = math.cos(math.radians(self.rotation_deg)), math.sin(math.radians(self.rotation_deg))
        back = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        shift = np.array([[1.0, 0, -self.shift_mm[0]], [0, 1.0, -self.shift_mm[1]], [0, 0, 1.0]])
        middle = np.array([[1.0, 0, mx], [0, 1.0, my], [0, 0, 1.0]])
        return np.asarray(middle @ back @ shift @ tilt @ nominal)


def apply_homography(
    homography: NDArray[np.float64], x: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Apply a homography to points."""
    h = homography
    u, v = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    w = h[2, 0] * u + h[2, 1] * v + h[2, 2]
    return (h[0, 0] * u + h[0, 1] * v + h[0, 2]) / w, (h[1, 0] * u + h[1, 1] * v + h[1, 2]) / w


def draw_camera(rng: np.random.Generator, *, pitch_mm: float = DEFAULT_PIXEL_MM) -> Camera:
    """Draw a camera as set up in a workshop: within 0.5 mm and 1.5 degrees of the part, mostly in focus."""
    n = np.clip(rng.standard_normal(6), -2.5, 2.5)
    return Camera(
        pitch_mm=pitch_mm,
        shift_mm=(0.2 * float(n[0]), 0.2 * float(n[1])),
        rotation_deg=0.6 * float(n[2]),
        perspective_per_mm=(3e-4 * float(n[3]), 5e-4 * float(n[4])),
        defocus_mm=float(rng.uniform(0.02, 0.09)),
        exposure_ev=0.35 * float(n[5]),
        noise=float(rng.uniform(0.01, 0.035)),
        dark_noise=float(rng.uniform(0.002, 0.01)),
        vignetting=float(rng.uniform(0.05, 0.3)),
        bloom=float(rng.uniform(0.02, 0.08)),
    )
