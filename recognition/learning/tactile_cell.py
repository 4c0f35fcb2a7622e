"""The relief about one place of a line: sampled upright at one size, over its own land."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import RELIEF_PIXELS
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine
from whisker_array.estimation.relief import Relief

Layer = NDArray[np.float64]
Place = tuple[float, float]
"""Along a line from its start and down from it, mm."""
Cell = tuple[float, float, float, float]

DOWN, ACROSS = np.arange(-26, 27) / RELIEF_PIXELS, np.arange(-32, 33) / RELIEF_PIXELS
"""Rows and columns of a cell from its middle, character heights: a W of a wide font and some land."""


def felt_cell(relief: Relief, line: TextLine, place: Place, *, raised: bool) -> Layer:
    """(rows, columns) heights about a place over their land, mm, negative in the mark; NaN where not known."""
    from scipy.ndimage import map_coordinates

    along, down = (far / line.height_mm for far in place)
    columns, rows = (
        (along + MARGIN + ACROSS) * HEIGHT_ROWS - 0.5,
        (down + DOWN) * HEIGHT_ROWS + 0.5 * ROWS - 0.5,
    )
    x, y = np.moveaxis(line.grid_mm(columns, rows), -1, 0)
    at = [(y - relief.origin_mm[1]) / relief.pitch_mm, (x - relief.origin_mm[0]) / relief.pitch_mm]
    felt = map_coordinates(relief.height_mm.astype(np.float64), at, order=1, mode="constant", cval=np.nan)
    return _over_land(-felt if raised else felt)


def _over_land(
    felt: Layer,
    *,
    land_share: float = 0.35,
    rounds: int = 4,
    least_land: int = 60,
    deepest_percent: float = 97.0,
) -> Layer:
    """Heights over a bowl fitted to what is not ink: the plate's waves may be as deep as a worn mark.

    A bold character covers more of its cell than it leaves, which a fit by Tukey's weights does not survive.

    Args:
        felt: cell.
        land_share: of a mark's depth down to which a sample is land.
        rounds: of separation.
        least_land: samples of land needed.
        deepest_percent: of the samples lie above a mark's depth.
    """
    from scipy import ndimage

    known = np.isfinite(felt)
    if known.sum() < least_land:
        return felt
    v, u = np.meshgrid(DOWN, ACROSS, indexing="ij")
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    # at first the upper half is held for land
    land, over = known & (felt >= np.median(felt[known])), felt
    for _ in range(rounds):
        if land.sum() < least_land:
            break
        over = felt - terms @ np.linalg.lstsq(terms[land], felt[land], rcond=None)[0]
        deep = float(np.percentile(-over[known], deepest_percent))
        land = known & ~ndimage.binary_dilation(np.nan_to_num(over) < -land_share * deep, iterations=2)
    return over


def ink_box(
    felt: Layer,
    height_mm: float,
    *,
    bounds: tuple[float, float],
    ink_share: float = 0.5,
    deepest_percent: float = 97.0,
) -> Cell | None:
    """Box (u0, v0, u1, v1) of a mark at the land, mm from the cell's middle; None without ink.

    Args:
        felt: cell.
        height_mm: of the characters.
        bounds: reach of the cell to its left and right, mm.
        ink_share: of a character's depth from which a sample is ink.
        deepest_percent: of the samples half a height about the middle lie above that depth.
    """
    u, v = ACROSS * height_mm, DOWN * height_mm
    depth = np.where((u > -bounds[0]) & (u < bounds[1]), -np.nan_to_num(felt), 0.0)
    deep = float(np.percentile(depth[np.abs(DOWN) < 0.5], deepest_percent))
    if deep <= 0.0:
        return None
    ink = depth > ink_share * deep
    across, down = np.flatnonzero(ink.sum(axis=0) >= 2), np.flatnonzero(ink.sum(axis=1) >= 2)
    if not across.size or not down.size:
        return None
    # from half the depth up a wall of 45 degrees to the land
    wall = ink_share * deep + 0.5 * height_mm / RELIEF_PIXELS
    return (
        float(u[across[0]] - wall),
        float(v[down[0]] - wall),
        float(u[across[-1]] + wall),
        float(v[down[-1]] + wall),
    )
