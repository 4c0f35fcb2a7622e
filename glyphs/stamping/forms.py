"""Forms of bent plates: cylinders, saddles and bows. Along each axis the plate is an arc of a circle.

    radius > 0: the plate falls towards both edges           x_mm, y_mm: as seen from above (the plate frame)
    radius < 0: it rises towards them                        skin: along the surface, as a tape measures it
        ___-----___
      /      |      \\     s = R asin(x / R)        z = sqrt(R^2 - x^2) - R
             R

Marks are rolled onto the plate: they keep their size along the skin, so that marks near the edges look narrower from
above. The die follows the surface; depth is vertical.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.stamping.errors import StampError
from glyphs.surface.display import OneLine

MAX_SAG_MM = 3.0
"""Greatest rise or fall of a form from the middle to an edge: the limit of whiskers on a rail and of depth of field."""
_STEEPEST = 0.9
"""Greatest half width over the radius: slopes of up to 64 degrees at the edge."""


@dataclass(frozen=True, repr=False)
class PlateForm(OneLine):
    """Radii of a plate about its two axes; default: flat. Raises StampError.

    Attributes:
        radius_x_mm: radius of the arc that the plate follows along x (a line around a shaft), not zero; infinite: flat.
        radius_y_mm: the same along y (a line along a shaft). Equal signs make a bow or a dish, opposite signs a saddle.
    """

    radius_x_mm: float = math.inf
    radius_y_mm: float = math.inf

    def __post_init__(self) -> None:
        for name in ("radius_x_mm", "radius_y_mm"):
            if math.isnan(getattr(self, name)) or getattr(self, name) == 0.0:
                raise StampError(
                    f"{name} is {getattr(self, name)}", hint="give a radius, negative if the plate is hollow"
                )

    @property
    def flat(self) -> bool:
        return math.isinf(self.radius_x_mm) and math.isinf(self.radius_y_mm)

    def height_mm(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float32]:
        """Height (rows, cols) over the middle, mm, at x (cols,) and y (rows,) from there. Raises StampError."""
        across, down = _arc(x_mm, self.radius_x_mm), _arc(y_mm, self.radius_y_mm)
        return np.asarray(across[None, :] + down[:, None], dtype=np.float32)


def seen_mm(skin_mm: float, radius_mm: float) -> float:
    """Half width, seen from above, of a plate whose half width along the skin is `skin_mm`. Raises StampError."""
    if math.isinf(radius_mm):
        return skin_mm
    if skin_mm / abs(radius_mm) > math.asin(_STEEPEST):
        raise _too_far(skin_mm, radius_mm)
    return abs(radius_mm) * math.sin(skin_mm / abs(radius_mm))


def along_skin_mm(seen: NDArray[np.float64], radius_mm: float) -> NDArray[np.float64]:
    """Convert positions seen from above to positions along the skin, both mm from the middle."""
    return seen if math.isinf(radius_mm) else abs(radius_mm) * np.arcsin(seen / abs(radius_mm))


def _arc(at_mm: NDArray[np.float64], radius_mm: float) -> NDArray[np.float64]:
    if math.isinf(radius_mm):
        return np.zeros_like(at_mm)
    half = float(np.abs(at_mm).max())
    if half > _STEEPEST * abs(radius_mm):
        raise _too_far(half, radius_mm)
    z = math.copysign(1.0, radius_mm) * (np.sqrt(radius_mm**2 - at_mm**2) - abs(radius_mm))
    if np.abs(z).max() > MAX_SAG_MM:
        raise _too_far(half, radius_mm)
    return np.asarray(z)


def _too_far(half_mm: float, radius_mm: float) -> StampError:
    return StampError(
        f"a plate of {2 * half_mm:.3g} mm bent to a radius of {radius_mm:.3g} mm "
        f"rises or falls by more than {MAX_SAG_MM:g} mm",
        hint="use a larger radius or stamp less on it",
    )
