"""A line of known letters as the templates' engine has found it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.vision_chain import Settled
from recognition.vision_frame import LinePlace
from recognition.vision_templates import VisionBasis

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Supposed:
    """One way the line may lie.

    Attributes:
        height_mm: of the characters.
        rotation_deg: of the line.
    """

    height_mm: float
    rotation_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class VisionFit:
    """What a supposition explains.

    Attributes:
        supposed: height and rotation.
        basis: of the font.
        settled: posteriors of the places.
        light: (3,) weights of the pictures.
        trust: (places,) probability that anything of the font stands there at all.
        column, row: (places,) where the best character stands, line frame pixels.
        origin_mm: photo frame (x, y) about which the line frame is turned.
        middle_px: (column, row) of that point in the line frame.
    """

    supposed: Supposed
    basis: VisionBasis
    settled: Settled
    light: Floats
    trust: Floats
    column: NDArray[np.int64]
    row: NDArray[np.int64]
    origin_mm: tuple[float, float]
    middle_px: tuple[float, float]

    @property
    def value(self) -> float:
        """Log Bayes factor of the line against none."""
        return self.settled.log_evidence

    @property
    def text(self) -> str:
        """Best character at every place."""
        return "".join(self.basis.chars[t] for t in self.settled.log_belief.argmax(axis=1))

    def slope_deg(self) -> float:
        """Rotation that is left, from the rows of the characters."""
        if self.row.size < 3 or np.ptp(self.column) == 0:
            return 0.0
        return math.degrees(math.atan(float(np.polyfit(self.column, self.row, 1)[0])))

    def frame_mm(self, column: float, row: float) -> tuple[float, float]:
        """Photo frame of a place in the line frame."""
        size = self.supposed.height_mm / self.basis.look.pixels
        u, v = (column - self.middle_px[0]) * size, (row - self.middle_px[1]) * size
        angle = math.radians(self.supposed.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        return (self.origin_mm[0] + cos * u - sin * v, self.origin_mm[1] + sin * u + cos * v)

    def character(self, k: int) -> LinePlace:
        """Where a character lies."""
        best = int(self.settled.log_belief[k].argmax())
        height = self.supposed.height_mm
        return LinePlace(
            self.frame_mm(float(self.column[k]), float(self.row[k])),
            2.0 * float(self.basis.half_width[best]) * height,
            height,
            self.supposed.rotation_deg,
        )

    def place(self) -> LinePlace:
        """Where the whole line lies."""
        half = self.basis.half_width[self.settled.log_belief.argmax(axis=1)] * self.basis.look.pixels
        left, right = float((self.column - half).min()), float((self.column + half).max())
        middle = self.frame_mm(0.5 * (left + right), float(np.median(self.row)))
        height = self.supposed.height_mm
        return LinePlace(
            middle, (right - left) / self.basis.look.pixels * height, height, self.supposed.rotation_deg
        )
