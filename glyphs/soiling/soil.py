"""Soil: dirt that yields under the tip, and the friction of the surface.

The height map of a soiled part is its *top*, as an instrument or a camera sees it. Under it::

      top  ____          thickness_mm of yielding dirt between top and bottom;
          /////\\____     a ball of radius r pressed with force f sinks in until the dirt carries it,
      ____\\////  bottom      f = 2 pi r H * depth      (H: hardness, as in a ball indentation test),
           ----              or until it rests on the bottom
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import Range, freeze_arrays, require_range
from glyphs.surface.display import OneLine
from glyphs.surface.maps import MapError


@dataclass(frozen=True, eq=False, repr=False)
class Soil(OneLine):
    """Dirt and friction of a part, on the grid of its height map. Raises MapError.

    Attributes:
        thickness_mm: (rows, cols) float32, >= 0: thickness of the soft dirt; 0 where there is none.
        hardness_mpa: (rows, cols) float32, > 0: mean pressure at which it yields (grease 0.1, caked grime about
            10).
        friction: (rows, cols) float32, >= 0: Coulomb coefficient of the surface touched.
    """

    thickness_mm: NDArray[np.float32]
    hardness_mpa: NDArray[np.float32]
    friction: NDArray[np.float32]

    def __post_init__(self) -> None:
        for name in ("hardness_mpa", "friction"):
            if np.ndim(getattr(self, name)) == 0:
                everywhere = np.broadcast_to(getattr(self, name), np.shape(self.thickness_mm))
                object.__setattr__(self, name, everywhere)
        grid = ("rows", "cols")
        shapes = {"thickness_mm": grid, "hardness_mpa": grid, "friction": grid}
        freeze_arrays(MapError, self, shapes, least=0.0, dtype=np.float32)
        require_range(
            MapError, Range(1e-6, math.inf), least_hardness_mpa=float(self.hardness_mpa.min(initial=1.0))
        )

    @property
    def mirrored(self) -> Soil:
        return Soil(self.thickness_mm[::-1], self.hardness_mpa[::-1], self.friction[::-1])

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return (self.thickness_mm.shape[0], self.thickness_mm.shape[1])
