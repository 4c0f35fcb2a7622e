r"""The paper's test piece: a land, then a plane that falls away at the intersection angle alpha, then a floor.

  land_mm       run_mm     floor_mm         seen from the side, alike over the whole width;
------------.                               traced from left to right (0 deg, columns)
       edge  \ alpha
              \____________   depth_mm
             foot
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import require_positive, require_range
from glyphs.surface.maps import HeightMap, MapError


@dataclass(frozen=True)
class Wedge:
    """A test piece as in Fig. 5(c).

    Attributes:
        alpha_rad: intersection angle, rad, between 0 and pi/2; the paper's are pi/6, pi/4, pi/3.
        depth_mm: how far below the land the slope ends in a floor, mm.
        land_mm: length of the land ahead of the edge, mm.
        floor_mm: length of the floor, mm.

    Raises:
        MapError: an angle out of range, a length not positive.
    """

    alpha_rad: float
    depth_mm: float
    land_mm: float
    floor_mm: float

    def __post_init__(self) -> None:
        radians = "give radians between 0 and pi/2"
        require_range(MapError, 1e-6, math.pi / 2.0 - 1e-6, self, "alpha_rad", hint=radians)
        require_positive(MapError, self, "depth_mm", "land_mm", "floor_mm")

    @property
    def run_mm(self) -> float:
        """Length of the slope along the trace, mm."""
        return self.depth_mm / math.tan(self.alpha_rad)

    @property
    def length_mm(self) -> float:
        """Total length of land, slope and floor, mm."""
        return self.land_mm + self.run_mm + self.floor_mm

    def height_mm(self, x_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height over the land at places along the trace, mm, any shape; x = 0 is the edge."""
        return np.asarray(-np.clip(x_mm * math.tan(self.alpha_rad), 0.0, self.depth_mm))

    def height_map(self, *, pitch_mm: float, rows: int = 3) -> HeightMap:
        """The surface; x = 0 is the beginning of the land, so that the edge lies at x = land_mm.

        Raises:
            MapError: a pitch not positive or too fine, fewer than two rows.
        """
        require_positive(MapError, pitch_mm=pitch_mm)
        columns = round(self.length_mm / pitch_mm) + 1
        x = np.arange(columns, dtype=np.float64) * pitch_mm
        line = self.height_mm(np.asarray(x - self.land_mm, dtype=np.float64))
        return HeightMap(np.broadcast_to(line.astype(np.float32), (rows, columns)), pitch_mm)
