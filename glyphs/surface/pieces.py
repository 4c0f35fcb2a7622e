r"""Test pieces: plates of known relief, which serve to identify a whisker and its bench.

    pits     one pit per angle; its four walls fall at that angle to a floor        ___      ______
             (the paper's 30, 45 and 60 degrees, traced along x and along y)             \____/
    grooves  the same profile across the whole plate, constant along y
    ball     a cap of a ball of `radius_mm` that stands `depth_mm` above the land   _____,--.______
    step     part of the plate lies `depth_mm` lower, behind a wall of the first angle

The height of the land is 0. It extends `land_mm` beyond the outermost relief on all sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import Positive, Range, Validated, require_positive
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap, MapError

Length = Annotated[Positive, Range(0.0, 1000.0)]


class PieceKind(StrEnum):
    """Kinds of relief."""

    PITS = "pits"
    GROOVES = "grooves"
    BALL = "ball"
    STEP = "step"


@dataclass(frozen=True, repr=False)
class Piece(OneLine, Validated, error=MapError):
    """A test piece, in millimetres and degrees."""

    # pieces are read from files, where unknown keys are errors
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    kind: PieceKind = PieceKind.PITS
    # angles of the walls, each with its own pit or groove; a step has the first one
    angle_deg: tuple[float, ...] = (30.0, 45.0, 60.0)
    depth_mm: Length = 0.3
    floor_mm: Length = 1.5
    # width of the plate along y, for grooves and steps; otherwise it follows from the relief
    width_mm: Length = 12.0
    radius_mm: Length = 3.0
    land_mm: Length = 2.0

    def __post_init__(self) -> None:
        if not self.angle_deg or not all(0.0 < a < 90.0 for a in self.angle_deg):
            raise MapError(f"angle_deg is {list(self.angle_deg)}", hint="give walls of 0 to 90 degrees")
        super().__post_init__()
        if self.kind is PieceKind.BALL and self.depth_mm > self.radius_mm:
            raise MapError(
                f"a cap of {self.depth_mm} mm is more than half of a ball of radius {self.radius_mm} mm",
                hint="use a cap of at most the radius",
            )

    @property
    def size_mm(self) -> tuple[float, float]:
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
        """The relief on a grid. Raises MapError: the pitch is not positive, or the map is too large."""
        require_positive(MapError, pitch_mm=pitch_mm)
        x_mm, y_mm = (
            np.arange(int(side / pitch_mm) + 1, dtype=np.float64) * pitch_mm for side in self.size_mm
        )
        return HeightMap(self.height_mm(x_mm[None, :], y_mm[:, None]).astype(np.float32), pitch_mm)

    def height_mm(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height above the land at points of the plate frame; x and y are broadcast."""
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
