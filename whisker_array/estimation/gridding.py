"""Average the sweeps of a scan onto one grid of the plate frame.

A pixel is a weighted mean of samples with a triangular kernel. The kernel reaches one pixel to either side,
or to the next sample if that is further away::

    weight  1 |        .                 samples  x x x x x x x x x
              |      .' '.               pixels     |   |   |   |
            0 |____.'_____'._____        each pixel: samples within reach, weighted by distance
                 pixel +- reach
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import OneLine
from glyphs.surface.maps import MapError, TraceDirection
from whisker_array.arrays import Floats, Mask


def averaging_weights(
    position: NDArray[Any], pixel: NDArray[Any], pitch: float, *, gap_steps: float = 2.1
) -> Any:
    """Sparse (pixels, samples) weights of each sample in each pixel. The kernel reaches one pitch to either side, or to
    the neighbouring sample if that is further away. A gap of more than `gap_steps` median steps stays open."""
    from scipy import sparse

    position, pixel = np.asarray(position, np.float64), np.asarray(pixel, np.float64)
    order = np.argsort(position, kind="stable")
    ordered = position[order]
    gaps = np.diff(ordered)
    step = float(np.median(gaps)) if gaps.size else pitch
    # reach to the neighbour on either side, but one median step at the ends and into an open gap
    closed = np.where(gaps > gap_steps * step, step, gaps)
    apart = np.maximum(np.r_[step, closed, step], pitch) * (1.0 + 1e-6)
    begin = np.searchsorted(ordered + apart[1:], pixel)
    end = np.searchsorted(ordered - apart[:-1], pixel)
    count = np.maximum(end - begin, 0)
    first = np.concatenate([[0], np.cumsum(count)])
    near = np.arange(first[-1]) + np.repeat(begin - first[:-1], count)
    off = np.repeat(pixel, count) - ordered[near]
    weight = np.clip(1.0 - np.abs(off) / np.where(off > 0.0, apart[near + 1], apart[near]), 0.0, None)
    return sparse.csr_array((weight, order[near], first), shape=(pixel.size, position.size))


def average_onto(values: Floats, along: Any, across: Any) -> tuple[Floats, Mask]:
    """Average (lines, samples) onto (pixels across, pixels along); pixels of half the weight or less are invalid, 0."""
    known = np.isfinite(values)
    total = across @ (along @ np.where(known, values, 0.0).T).T
    weight = across @ (along @ known.T.astype(np.float64)).T
    expected = np.outer(across.sum(axis=1), along.sum(axis=1))
    valid = weight > 0.5 * expected
    return np.where(valid, total / np.maximum(weight, 1e-12), 0.0), valid


@dataclass(frozen=True, eq=False, repr=False)
class SweptLines(OneLine):
    """One value (lines, samples) for every sample of the lines of a sweep, NaN where unknown."""

    values: Floats
    place_mm: Floats
    along_mm: Floats
    direction: TraceDirection


@dataclass(frozen=True, eq=False, repr=False)
class PlateGrid(OneLine):
    """Pixel grid of a map: x (cols,) and y (rows,)."""

    x_mm: Floats
    y_mm: Floats
    pitch_mm: float

    @property
    def origin_mm(self) -> tuple[float, float]:
        return float(self.x_mm[0]), float(self.y_mm[0])


def common_grid(
    swept: Sequence[SweptLines],
    pitch_mm: float,
    *,
    within_mm: tuple[float, float, float, float] | None = None,
) -> PlateGrid:
    """Return the grid that all sweeps cover, within (x0, y0, x1, y1). Raises MapError if they do not overlap there."""
    covered = [] if within_mm is None else [within_mm]
    for each in swept:
        x, y = (each.along_mm, each.place_mm) if each.direction.along_x else (each.place_mm, each.along_mm)
        covered.append((x.min(), y.min(), x.max(), y.max()))
    x0, y0, _, _ = np.max(covered, axis=0)
    _, _, x1, y1 = np.min(covered, axis=0)
    if x1 - x0 < pitch_mm or y1 - y0 < pitch_mm:
        raise MapError("the sweeps of the scan do not overlap on the plate")
    return PlateGrid(
        x_mm=x0 + pitch_mm * np.arange(int((x1 - x0) / pitch_mm + 1e-6) + 1),
        y_mm=y0 + pitch_mm * np.arange(int((y1 - y0) / pitch_mm + 1e-6) + 1),
        pitch_mm=pitch_mm,
    )


def on_grid(
    swept: Sequence[SweptLines],
    grid: PlateGrid,
    *,
    shift: Mapping[TraceDirection, tuple[float, float]] | None = None,
) -> tuple[list[Floats], list[Mask]]:
    """Return a (rows, cols) map of each sweep and its mask of valid pixels, moved by each direction's `shift`, mm."""
    layers, known = [], []
    for each in swept:
        dx, dy = (shift or {}).get(each.direction, (0.0, 0.0))
        along_x = each.direction.along_x
        pixel_along, pixel_across = (grid.x_mm, grid.y_mm) if along_x else (grid.y_mm, grid.x_mm)
        layer, good = average_onto(
            each.values,
            averaging_weights(each.along_mm + (dx if along_x else dy), pixel_along, grid.pitch_mm),
            averaging_weights(each.place_mm + (dy if along_x else dx), pixel_across, grid.pitch_mm),
        )
        layers.append(layer if along_x else layer.T)
        known.append(good if along_x else good.T)
    return layers, known
