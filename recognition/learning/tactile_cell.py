"""The relief about one place of a line: sampled upright at one size, over its own land."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import RELIEF_PIXELS
from whisker_array.estimation.relief import Relief

HALF_ROWS_HEIGHTS, HALF_COLUMNS_HEIGHTS = 0.66, 0.8
"""Half the size of a cut, in character heights: a W of a wide font and some land."""
INK_SHARE = 0.5
"""Share of a character's depth from which a sample is ink."""
DEPTH_PERCENTILE = 97.0
LAND_SHARE, LAND_ROUNDS, LEAST_LAND = 0.35, 4, 60
"""Share of a mark's depth down to which a sample is land; rounds of separation; samples of land needed."""

Layer = NDArray[np.float64]


@dataclass(frozen=True)
class LineFrame:
    """The plate's frame turned about its origin, so that a line runs along +u.

    Attributes:
        rotation_deg: of the line.
    """

    rotation_deg: float

    def from_plate(self, places: Layer) -> Layer:
        """(n, 2) u, v of places x, y of the plate."""
        angle = math.radians(self.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        x, y = places.T
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=1)


def cell_grid(height_mm: float) -> tuple[Layer, Layer]:
    """Offsets (u, v) of a cut's pixels from its middle, mm."""
    pitch = height_mm / RELIEF_PIXELS
    rows, cols = round(HALF_ROWS_HEIGHTS * RELIEF_PIXELS), round(HALF_COLUMNS_HEIGHTS * RELIEF_PIXELS)
    v, u = np.meshgrid(np.arange(-rows, rows + 1) * pitch, np.arange(-cols, cols + 1) * pitch, indexing="ij")
    return u, v


def plate_of_cell(frame: LineFrame, place: tuple[float, float], height_mm: float) -> tuple[Layer, Layer]:
    """Plate coordinates (x, y) of a cut's pixels."""
    u, v = cell_grid(height_mm)
    angle = math.radians(frame.rotation_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    u, v = u + place[0], v + place[1]
    return cos * u - sin * v, sin * u + cos * v


def felt_cell(
    relief: Relief, frame: LineFrame, place: tuple[float, float], height_mm: float, *, raised: bool
) -> Layer:
    """(rows, cols) heights of a cut over its land, mm, negative in the mark; NaN where not known."""
    from scipy.ndimage import map_coordinates

    x, y = plate_of_cell(frame, place, height_mm)
    at = [(y - relief.origin_mm[1]) / relief.pitch_mm, (x - relief.origin_mm[0]) / relief.pitch_mm]
    felt = map_coordinates(relief.height_mm.astype(np.float64), at, order=1, mode="constant", cval=np.nan)
    felt = -felt if raised else felt
    return _level(felt)


def _level(felt: Layer) -> Layer:
    """Heights over the land: a bowl fitted to what is not ink, for the plate's waves may be as deep as a worn mark."""
    from scipy import ndimage

    known = np.isfinite(felt)
    if known.sum() < LEAST_LAND:
        return felt
    rows, cols = felt.shape
    v, u = np.meshgrid(np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, cols), indexing="ij")
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    # at first the upper half is held for land
    land = known & (felt >= np.median(felt[known]))
    over = felt
    for _ in range(LAND_ROUNDS):
        if land.sum() < LEAST_LAND:
            break
        bowl = terms @ np.linalg.lstsq(terms[land], felt[land], rcond=None)[0]
        over = felt - bowl
        deep = float(np.percentile(-over[known], DEPTH_PERCENTILE))
        land = known & ~ndimage.binary_dilation(np.nan_to_num(over) < -LAND_SHARE * deep, iterations=2)
    return over


def ink_box(
    felt: Layer, height_mm: float, *, bounds: tuple[float, float]
) -> tuple[float, float, float, float] | None:
    """Box (u0, v0, u1, v1) of a mark at the land, mm from the cut's middle; None without ink."""
    u, v = cell_grid(height_mm)
    depth = np.where((u > -bounds[0]) & (u < bounds[1]), -np.nan_to_num(felt), 0.0)
    near = np.abs(v) < 0.5 * height_mm
    deep = float(np.percentile(depth[near], DEPTH_PERCENTILE))
    if deep <= 0.0:
        return None
    ink = depth > INK_SHARE * deep
    across, down = np.flatnonzero(ink.sum(axis=0) >= 2), np.flatnonzero(ink.sum(axis=1) >= 2)
    if not across.size or not down.size:
        return None
    # from half the depth up a wall of 45 degrees to the land
    wall = INK_SHARE * deep + 0.5 * height_mm / RELIEF_PIXELS
    return (
        float(u[0, across[0]] - wall),
        float(v[down[0], 0] - wall),
        float(u[0, across[-1]] + wall),
        float(v[down[-1], 0] + wall),
    )
