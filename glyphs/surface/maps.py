"""Value types of a surface and of its edge map.

The *plate frame*, used for all surfaces::

      +----------> x_mm   (columns; trace direction 0 deg runs this way)
      |
      |    row 0 is the top of the part as a reader sees it
      v
     y_mm                 (rows;    trace direction 90 deg runs this way)

    z_mm points out of the plate, towards the reader; a sunk groove is negative, the land is about zero.

Pixel (row r, column c) has its centre at x = c * pitch, y = r * pitch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import DTypeLike, NDArray

from glyphs.errors import MarksError
from glyphs.ranges import Range, Validated
from glyphs.surface.display import OneLine, picture_html

MAX_PIXELS = 64_000_000
"""Largest map accepted anywhere: 8000 x 8000, a quarter of a gigabyte as float32."""


class MapError(MarksError):
    """An invalid map."""


class TraceDirection(IntEnum):
    """Direction in which a whisker is dragged, in degrees of the plate frame (0 = +x, 90 = +y)."""

    FORWARD_X = 0
    FORWARD_Y = 90
    BACK_X = 180
    BACK_Y = 270

    @property
    def along_x(self) -> bool:
        return self in (TraceDirection.FORWARD_X, TraceDirection.BACK_X)

    @property
    def backward(self) -> bool:
        return self in (TraceDirection.BACK_X, TraceDirection.BACK_Y)

    @property
    def sign(self) -> float:
        """-1 if positions decrease along the trace, otherwise 1."""
        return -1.0 if self.backward else 1.0


OPPOSITE_DIRECTIONS = (
    (TraceDirection.FORWARD_X, TraceDirection.BACK_X),
    (TraceDirection.FORWARD_Y, TraceDirection.BACK_Y),
)


def read_only_copy(array: NDArray[np.generic], dtype: DTypeLike) -> NDArray[np.generic]:
    """Return a contiguous read-only array of a dtype; copied only if necessary."""
    out: NDArray[np.generic] = np.ascontiguousarray(array, dtype=dtype)
    if out.flags.writeable:
        out = out.copy() if out is array else out
        out.flags.writeable = False
    return out


Pitch = Annotated[float, Range(1e-7, math.inf, "it must be positive and finite")]
"""Pitch of at least a tenth of a nanometre: no instrument samples more finely."""


@dataclass(frozen=True, eq=False, repr=False)
class HeightMap(OneLine, Validated, error=MapError):
    """Heights on a square grid: (rows, cols) float32, mm, read-only; NaN is a dropout. Raises MapError."""

    z_mm: NDArray[np.float32]
    pitch_mm: Pitch

    def _repr_html_(self) -> str:
        return picture_html(self, self.z_mm)

    def __post_init__(self) -> None:
        array = np.asarray(self.z_mm)
        if array.dtype.kind not in "fiu":
            raise MapError(f"heights are of type {array.dtype}", hint="they must be real numbers in mm")
        if array.ndim != 2 or min(array.shape) < 2:
            raise MapError(
                f"heights have shape {array.shape}", hint="a map has rows and columns, at least 2 x 2"
            )
        if array.size > MAX_PIXELS:
            raise MapError(
                f"{array.shape[0]} x {array.shape[1]} samples exceed the limit of {MAX_PIXELS:,}",
                hint="crop or thin the map",
            )
        z = read_only_copy(array, np.float32)
        if np.isinf(z).any():
            raise MapError("heights contain infinities", hint="mark bad points as NaN")
        if not np.isfinite(z).any():
            raise MapError("no finite height in the map", hint="give at least one height that is not NaN")
        super().__post_init__()
        object.__setattr__(self, "z_mm", z)
        object.__setattr__(self, "pitch_mm", float(self.pitch_mm))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        return (self.z_mm.shape[0], self.z_mm.shape[1])

    @property
    def mirrored(self) -> HeightMap:
        return HeightMap(self.z_mm[::-1], self.pitch_mm)

    @property
    def size_mm(self) -> tuple[float, float]:
        """Extent (width along x, height along y), mm, from first to last sample."""
        rows, cols = self.shape
        return ((cols - 1) * self.pitch_mm, (rows - 1) * self.pitch_mm)


@dataclass(frozen=True, eq=False, repr=False)
class EdgeMap(OneLine, Validated, error=MapError):
    """Signed edge enhancement, one layer per trace direction: m / m_land - 1 on a square grid. Raises MapError.

    A land sample is 0; +0.16 means that the moment was 16 % above the land's. By docs/pages/physics.md the value is
    (1 + h/d0) * F(slope, mu) - 1: the profile and the step of the paper's eq. (16) together.

    Attributes:
        enhancement: (directions, rows, cols) float32, dimensionless, read-only; 0 where not valid.
        valid: (rows, cols) bool: whether every layer was measured here.
        origin_mm: plate-frame (x, y) of pixel (0, 0), mm.
    """

    enhancement: NDArray[np.float32]
    directions: tuple[TraceDirection, ...]
    valid: NDArray[np.bool_]
    pitch_mm: Pitch
    origin_mm: tuple[float, float] = (0.0, 0.0)

    def _repr_html_(self) -> str:
        return picture_html(self, self.enhancement[0])

    def __post_init__(self) -> None:
        e = read_only_copy(np.asarray(self.enhancement), np.float32)
        valid = read_only_copy(np.asarray(self.valid), np.bool_)
        directions = tuple(TraceDirection(d) for d in self.directions)
        if e.ndim != 3 or e.shape[0] != len(directions) or e.shape[1:] != valid.shape:
            raise MapError(
                f"enhancement {e.shape}, {len(directions)} directions and validity {valid.shape} do not agree"
            )
        if len(set(directions)) != len(directions) or not directions:
            raise MapError("an edge map has at least one trace direction, each at most once")
        if not np.isfinite(e).all():
            raise MapError("enhancement must be finite", hint="clear `valid` where nothing was measured")
        object.__setattr__(self, "enhancement", e)
        object.__setattr__(self, "valid", valid)
        object.__setattr__(self, "directions", directions)
        super().__post_init__()
        object.__setattr__(self, "pitch_mm", float(self.pitch_mm))
        object.__setattr__(self, "origin_mm", (float(self.origin_mm[0]), float(self.origin_mm[1])))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols) of one layer."""
        return (self.valid.shape[0], self.valid.shape[1])
