"""Layouts of a line: straight or on an arc, alone or with another line above or below."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.ranges import Finite, NotNegative, Validated
from glyphs.stamping.errors import StampError
from glyphs.surface.display import OneLine

MOST_TURNED_DEG = 5.0
_TIGHTEST = 0.9  # longest line, as a share of the half circle that it follows


@dataclass(frozen=True, repr=False)
class Layout(OneLine, Validated, error=StampError):
    """Layout of a line on the plate; default: straight and alone. Raises StampError.

    Attributes:
        turned_deg: rotation of the whole line, clockwise as seen, added to the rotation that the caller requests.
        radius_mm: radius of the baseline's arc, not zero. Positive: its centre lies below the text; negative: above it.
        other_above: whether the second line stands above the requested one; otherwise it stands below.
        gap: land between the two lines, cap heights, >= 0.
    """

    turned_deg: Finite = 0.0
    radius_mm: float = math.inf
    other_text: str = ""
    other_above: bool = False
    gap: NotNegative = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.isnan(self.radius_mm) or self.radius_mm == 0.0:
            raise StampError(f"radius_mm is {self.radius_mm}", hint="give the radius of an arc, or infinity")

    def place(self, along_mm: float, up_mm: float, *, length_mm: float) -> tuple[float, float, float]:
        """(x, y, turn) of a point of a line: x right and y up, mm, turn clockwise, degrees. Raises StampError."""
        if math.isinf(self.radius_mm):
            return along_mm, up_mm, 0.0
        half = length_mm / 2
        if half > _TIGHTEST * math.pi / 2 * abs(self.radius_mm):
            raise StampError(
                f"a line of {length_mm:.3g} mm does not fit an arc of radius {abs(self.radius_mm):.3g} mm",
                hint="use a larger radius",
            )
        angle = (along_mm - half) / self.radius_mm
        reach = self.radius_mm + up_mm
        return (
            half + reach * math.sin(angle),
            reach * math.cos(angle) - self.radius_mm,
            math.degrees(angle),
        )


def _arc(rng: np.random.Generator, height_mm: float, length_mm: float, font: Font, text: str) -> Layout:
    side = 1.0 if rng.uniform() < 0.5 else -1.0
    return Layout(radius_mm=side * max(6.0 * height_mm, float(rng.uniform(0.8, 1.4)) * length_mm))


def _two_lines(rng: np.random.Generator, height_mm: float, length_mm: float, font: Font, text: str) -> Layout:
    serial = [c for c in sorted(font.glyphs) if c.isascii() and (c.isdigit() or c.isupper())]
    # a different length, so that the format of the requested line does not match both lines
    count = len(text) - 2 if len(text) > 4 else len(text) + 2
    other = "".join(serial[int(k)] for k in rng.integers(len(serial), size=count))
    return Layout(other_text=other, other_above=bool(rng.uniform() < 0.5))


LAYOUTS: Final[dict[str, Callable[[np.random.Generator, float, float, Font, str], Layout]]] = {
    "straight": lambda *_: Layout(),
    "turned": lambda rng, *_: Layout(turned_deg=float(rng.uniform(-MOST_TURNED_DEG, MOST_TURNED_DEG))),
    "arc": _arc,
    "two-lines": _two_lines,
}
"""Layouts by name: a straight line (the default), a line turned by up to 5 degrees either way, a line on an arc that
bends up or down, and a line with a second one of another length above or below it."""
