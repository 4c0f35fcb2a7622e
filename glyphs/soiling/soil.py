"""What lies on a part: dirt that yields under the tip, and the friction of what is touched.

The height map of a soiled part is its *top*, as an instrument or a camera sees it. Under it::

      top  ____          thickness_mm of yielding dirt between top and bottom;
          /////\\____     a ball of radius r pressed on with force f sinks in until the dirt carries it,
      ____\\////  bottom      f = 2 pi r H * depth      (H: hardness, as in a ball indentation test),
           ----              or until it stands on the bottom
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import one_line
from glyphs.surface.maps import MapError


@dataclass(frozen=True, eq=False)
class Soil:
    """Dirt and friction of a part, on the grid of its height map.

    Attributes:
        thickness_mm: (rows, cols) float32, >= 0: of the dirt that yields; 0 where there is none.
        hardness_mpa: (rows, cols) float32, > 0: mean pressure at which it yields (grease 0.1, caked grime some 10).
        friction: (rows, cols) float32, >= 0: Coulomb coefficient of what is touched.

    Raises:
        MapError: shapes that differ, numbers out of range or not finite.
    """

    thickness_mm: NDArray[np.float32]
    hardness_mpa: NDArray[np.float32]
    friction: NDArray[np.float32]

    __repr__ = one_line

    def __post_init__(self) -> None:
        shape = np.shape(self.thickness_mm)
        if len(shape) != 2:
            raise MapError(f"thickness_mm has shape {shape}", hint="it must be rows x columns")
        for name, least in (("thickness_mm", 0.0), ("hardness_mpa", 1e-6), ("friction", 0.0)):
            given = np.asarray(getattr(self, name), dtype=np.float32)
            if given.ndim and given.shape != shape:
                raise MapError(
                    f"{name} {given.shape} does not fit thickness_mm {shape}", hint="give one grid for all"
                )
            values = np.array(np.broadcast_to(given, shape), dtype=np.float32)
            if not np.isfinite(values).all() or float(values.min()) < least:
                raise MapError(f"{name} must be finite and at least {least:g} everywhere")
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def mirrored(self) -> Soil:
        """The soil with its rows in the other order."""
        return Soil(self.thickness_mm[::-1], self.hardness_mpa[::-1], self.friction[::-1])

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return (self.thickness_mm.shape[0], self.thickness_mm.shape[1])
