"""Plates by name: form and tool marks, relative to the size of the stamped text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from glyphs.stamping.forms import MAX_SAG_MM, PlateForm
from glyphs.stamping.textures import Grinding, Milling, Sand, Turning
from glyphs.stamping.variation import PlateVariation

_FALL, _MOST_FALL_MM = 0.2, 1.5
"""Fall of a form from the middle to the ends of a line: share of the height (1 mm at 5 mm), and limit in mm."""

_IRONING = 0.5
"""Coarse tool marks are ironed less than a fine lay, because they are as deep as the corners of some marks."""

PLATES: Final[dict[str, Callable[[float, float], PlateVariation]]] = {
    "machined": lambda *_: PlateVariation(),
    "cylinder": lambda height_mm, length_mm: PlateVariation(
        form=PlateForm(radius_y_mm=_shaft(height_mm, length_mm))
    ),
    "ring": lambda height_mm, length_mm: PlateVariation(
        form=PlateForm(radius_x_mm=_radius(height_mm, length_mm))
    ),
    "saddle": lambda height_mm, length_mm: PlateVariation(
        form=PlateForm(radius_x_mm=-_radius(height_mm, length_mm), radius_y_mm=12 * height_mm)
    ),
    "bow": lambda height_mm, length_mm: PlateVariation(
        form=PlateForm(radius_x_mm=1.5 * _radius(height_mm, length_mm), radius_y_mm=60 * height_mm)
    ),
    "milled": lambda *_: PlateVariation(texture=Milling(), ironing=_IRONING),
    "turned": lambda *_: PlateVariation(texture=Turning(), ironing=_IRONING),
    "faced": lambda height_mm, length_mm: PlateVariation(
        texture=Turning(ring_radius_mm=max(20.0, 0.6 * length_mm)), ironing=_IRONING
    ),
    "ground": lambda *_: PlateVariation(texture=Grinding(), ironing=_IRONING),
    "sand": lambda *_: PlateVariation(texture=Sand(), ironing=_IRONING),
}
"""Functions of character height and line length, mm, that return a plate. `machined` is the default."""


def _radius(height_mm: float, length_mm: float) -> float:
    fall = min(_FALL * height_mm, _MOST_FALL_MM)
    return max(15 * height_mm, ((length_mm / 2) ** 2 + fall**2) / (2 * fall))


def _shaft(height_mm: float, length_mm: float) -> float:
    half = 1.3 * height_mm + max(0.08 * length_mm, 0.75 * height_mm)
    return max(8 * height_mm, half**2 / (1.9 * MAX_SAG_MM))
