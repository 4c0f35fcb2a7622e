r"""Test pieces: plates of known relief, over which a whisker and its bench are identified.

    pits     one pit an angle, its four walls falling at that angle to a floor      ___      ______
             (the paper's 30, 45 and 60 degrees, felt along x and along y)             \____/
    grooves  the same across the whole plate, alike along y
    ball     a cap of a ball of `radius_mm` that stands `depth_mm` over the land    _____,--.______
    step     half of the plate lies `depth_mm` lower, behind a wall of the first angle

The land is at 0; it reaches `land_mm` beyond the outermost relief, all around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import require_positive, require_range
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError


class PieceKind(StrEnum):
    """Kinds of relief."""

    PITS = "pits"
    GROOVES = "grooves"
    BALL = "ball"
    STEP = "step"


@dataclass(frozen=True, repr=False)
class Piece(OneLine):
    """A test piece, in millimetres and degrees.

    Attributes:
        kind: which relief.
        angle_deg: of the walls, one pit or groove each; a step has the first one.
        depth_mm: of floors below the land; how high a ball's cap stands.
        floor_mm: length and width of a floor.
        width_mm: of the plate along y, where the relief does not settle it: grooves and steps.
        radius_mm: of a ball.
        land_mm: land between pieces of relief, and around them.

    Raises:
        MapError: an angle out of range, a length not positive, a cap higher than its ball.
    """

    # read from files as it is: unknown keys are errors
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    kind: PieceKind = PieceKind.PITS
    angle_deg: tuple[float, ...] = (30.0, 45.0, 60.0)
    depth_mm: float = 0.3
    floor_mm: float = 1.5
    width_mm: float = 12.0
    radius_mm: float = 3.0
    land_mm: float = 2.0

    def __post_init__(self) -> None:
        if not self.angle_deg or not all(0.0 < a < 90.0 for a in self.angle_deg):
            raise MapError(f"angle_deg is {list(self.angle_deg)}", hint="walls fall at 0 to 90 degrees")
        lengths = "depth_mm", "floor_mm", "width_mm", "radius_mm", "land_mm"
        require_positive(MapError, self, *lengths)
        require_range(MapError, 0.0, 1000.0, self, *lengths)
        if self.kind is PieceKind.BALL and self.depth_mm > self.radius_mm:
            raise MapError(
                f"a cap {self.depth_mm} mm high of a ball of {self.radius_mm} mm", hint="half at most"
            )

    @property
    def size_mm(self) -> tuple[float, float]:
        """Along x and y."""
        if self.kind is PieceKind.BALL:
            side = 2.0 * (math.sqrt(2.0 * self.radius_mm * self.depth_mm - self.depth_mm**2) + self.land_mm)
            return side, side
        if self.kind is PieceKind.STEP:
            return 2.0 * self.land_mm + self._run_mm(self.angle_deg[0]) + self.floor_mm, self.width_mm
        spans = [self.floor_mm + 2.0 * self._run_mm(angle) for angle in self.angle_deg]
        along = sum(spans) + (len(spans) + 1) * self.land_mm
        across = max(spans) + 2.0 * self.land_mm if self.kind is PieceKind.PITS else self.width_mm
        return along, across

    def _run_mm(self, angle_deg: float) -> float:
        return self.depth_mm / math.tan(math.radians(angle_deg))

    def height_map(self, pitch_mm: float) -> HeightMap:
        """The relief on a grid.

        Raises:
            MapError: a pitch that is not positive, or a map too large.
        """
        require_positive(MapError, pitch_mm=pitch_mm)
        x_mm, y_mm = (
            np.arange(int(side / pitch_mm) + 1, dtype=np.float64) * pitch_mm for side in self.size_mm
        )
        return HeightMap(self.height_mm(x_mm[None, :], y_mm[:, None]).astype(np.float32), pitch_mm)

    def height_mm(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height over the land at places of the plate frame, which are broadcast."""
        x_mm, y_mm = np.broadcast_arrays(x_mm, y_mm)
        if self.kind is PieceKind.BALL:
            middle = 0.5 * self.size_mm[0]
            square = self.radius_mm**2 - (x_mm - middle) ** 2 - (y_mm - middle) ** 2
            cap = np.sqrt(np.maximum(square, 0.0)) - (self.radius_mm - self.depth_mm)
            return np.asarray(np.maximum(cap, 0.0))
        if self.kind is PieceKind.STEP:
            fall = (x_mm - self.land_mm) * math.tan(math.radians(self.angle_deg[0]))
            return np.asarray(-np.clip(fall, 0.0, self.depth_mm))
        height = np.zeros(x_mm.shape)
        edge_mm = self.land_mm
        for angle in self.angle_deg:
            half = 0.5 * self.floor_mm + self._run_mm(angle)
            inside = half - np.abs(x_mm - (edge_mm + half))  # from the edge towards the middle
            if self.kind is PieceKind.PITS:
                inside = np.minimum(inside, half - np.abs(y_mm - 0.5 * self.size_mm[1]))
            height -= np.clip(inside * math.tan(math.radians(angle)), 0.0, self.depth_mm)
            edge_mm += 2.0 * half + self.land_mm
        return height
