r"""Depth of each character by touch: along the centre lines of its strokes, from the land beside it.

          land, a plane through the samples beside the character (ink and burr left out)
    ______/\                   /\______
             \     depth      /            burr (high metal): not land (27 CFR 478.92 measures from the flat surface)
              \______|_______/
                     ^ centre line of the laid character, moved sideways a little to the deepest point

Depth means how deep the ball of the tip reaches, averaged over a sample (a fortieth of the height). Its errors on
stamped parts with the default whisker and ball, gothic, 32 characters each; micrometres, mean +- standard deviation
(`python tests/benchmarks/depth_accuracy.py`):

    height, mm      3.2            5.0            7.0            12.7        depths: 0.15, 0.21, 0.28, 0.43 mm
    FLAT         +4.3 +- 0.5    +6.0 +- 1.1    +7.3 +- 0.7    +12.2 +- 2.0
    ROUND        +1.8 +- 0.3    +1.5 +- 0.4    +1.5 +- 0.4     +1.2 +- 1.0
    SHARP       -16.1 +- 2.1   -29.1 +- 4.4   -40.8 +- 4.2   -88.2 +- 11.1
    FLAT, under dirt of 0.3, 0.6 and 0.9 at 5.0 mm: +8.9 +- 6.8, +6.4 +- 17.5, -28.1 +- 42.5

Depths are shown with these errors. A depth rule removes those of flat and round faces (`depth_bias_mm`).

Where dirt in a stroke rises above the land, the depth is 0, never negative. In a V of 45 degrees a ball of radius r
stops 0.41 (r - root radius) above the bottom: 13, 21, 29 and 54 micrometres at these heights. The true depth is that of
the deepest point, so a SHARP mark is measured too shallow. Averaging removes a third of a raised SHARP crest.

The burr is the rim beside the strokes, averaged over a few points along them. Touch rounds it off. Of a rim 0.04 mm
high (K804217, 5 mm), the share felt is 0.19 at a width of 0.1 mm, 0.42 at 0.225, 0.67 at 0.4, 0.78 at 0.6 and 0.81 at
0.8. So a burr is at least as high as measured. A milled plate without burr shows up to 0.01 mm. Dirt heaped beside a
stroke counts as burr.

If the part of a recorded scan was tilted, moments are taken relative to those of the land beside them. The relative
error of a depth is then that of the land's lift to the preload, h_land / d0. Height maps are levelled before a scan.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.stamping.faces import Face
from recognition.glyph_match.pose import Floats
from recognition.marks.centre_lines import CentreLine, centre_line
from recognition.marks.laid_text import LaidText
from whisker_array.estimation.relief import Relief

BURR_REACH_HEIGHTS = 0.1
"""Minimum distance of land from any ink, character heights; burrs are half as wide."""
LEAST_KNOWN = 0.5
"""Minimum share of the centre line, or of the rim, that must be felt."""
SMOOTH_POINTS = 5
"""Neighbouring points along a stroke that share one middle, so that a single bad sample does not move it."""
BIAS_HEIGHTS_MM = (3.2, 5.0, 7.0, 12.7)
BIAS_UM = {Face.FLAT: (4.3, 6.0, 7.3, 12.2), Face.ROUND: (1.8, 1.5, 1.5, 1.2)}
"""Mean errors at these heights, from the table above, micrometres (`python tests/benchmarks/depth_accuracy.py`)."""
DEEP_PERCENT = 90.0
"""Percentile along a centre line that counts as the maximum."""


@dataclass(frozen=True)
class MarkDepth:
    """Depth of a character, or height of a raised one, mm; 0 where the surface is on the other side of the land.

    Attributes:
        min_mm, max_mm: 10th and 90th percentile over the centre line.
        burr_mm: 90th percentile of the rim's height ("high metal"), for a raised mark its depth; None if unknown.
        bias_mm: usual error of the depths of a clean mark of this face and height; positive if measured too deep.
    """

    mean_mm: float
    min_mm: float
    max_mm: float
    burr_mm: float | None = None
    sd_mm: float | None = None
    bias_mm: float = 0.0


def mark_depths(
    relief: Relief, laid: LaidText, *, places: Collection[int] | None = None
) -> tuple[MarkDepth | None, ...]:
    """Depth of each character of a line; None if too little of it or of the land beside it was felt."""
    felt = relief.height_mm if laid.felt.raised else -relief.height_mm
    # a margin of unknown samples
    depth = np.pad(felt.astype(np.float64), 1, constant_values=np.nan)
    height = laid.height_mm / relief.pitch_mm
    marks = [None if character is None else _mark(relief, laid, k) for k, character in enumerate(laid.laid)]
    land = _land([mark for mark in marks if mark is not None], depth, height)
    depths = (
        None if mark is None or not (places is None or k in places) else _depth(mark, depth, land, height)
        for k, mark in enumerate(marks)
    )
    bias_mm = depth_bias_mm(laid.face, laid.height_mm)
    return tuple(None if mark is None else replace(mark, bias_mm=bias_mm) for mark in depths)


def depth_bias_mm(face: Face, height_mm: float) -> float:
    """Usual error of the depths of a clean mark, interpolated in the table of this module; 0 for other faces."""
    # the error of a V depends on the tip of its die, and never makes it deeper
    return float(1e-3 * np.interp(height_mm, BIAS_HEIGHTS_MM, BIAS_UM[face])) if face in BIAS_UM else 0.0


def _mark(relief: Relief, laid: LaidText, place: int, *, ahead_heights: float = 0.05) -> CentreLine:
    line = centre_line(laid.font, laid.text[place], face=laid.face)
    on, ahead = (
        (laid.points_mm(place, points) - relief.origin_mm)[:, ::-1] / relief.pitch_mm + 1.0
        for points in (line.points, line.points + ahead_heights * line.normals)
    )
    normals = (ahead - on) / np.linalg.norm(ahead - on, axis=1, keepdims=True)
    return CentreLine(on, normals, line.half_width * laid.height_mm / relief.pitch_mm)


def _land(marks: Sequence[CentreLine], depth: Floats, height: float) -> NDArray[np.bool_]:
    bare = np.ones(depth.shape, dtype=np.bool_)
    for mark in marks:
        row, col = np.clip(np.round(mark.points).astype(np.intp), 0, np.array(bare.shape) - 1).T
        bare[row, col] = False
    clear = max((mark.half_width for mark in marks), default=0.0) + BURR_REACH_HEIGHTS * height
    return np.asarray((ndimage.distance_transform_edt(bare) > clear) & np.isfinite(depth))


def _depth(
    mark: CentreLine,
    depth: Floats,
    land: NDArray[np.bool_],
    height: float,
    *,
    # percentile of the depths along the centre line that counts as the minimum. A shallow leg is a quarter of
    # the line or more, so it shows in full. A crossing, the end of a stroke or a bad sample is a tenth at
    # most, so it does not.
    shallow_percent: float = 10.0,
    sideways_heights: float = 0.03,
    least_sd_mm: float = 1e-3,
    # factor of the scatter of the land, which is added in quadrature: dirt that makes the land uneven fills
    # strokes, too. Of 1,251 characters, 3.2 to 7 mm high, under eight soils, 76 % lie within one standard
    # deviation and 90 % within two. On worn plates it is 41 % and 55 %, because wear leaves the land even.
    sd_of_scatter: float = 9.0,
) -> MarkDepth | None:
    land_plane = _plane(mark, depth, land, height) if len(mark.points) else None
    if land_plane is None:
        return None
    plane, scatter_mm = land_plane
    aside = sideways_heights * height * np.linspace(-1.0, 1.0, 13)
    below = across(depth, mark.points, mark.normals, aside, plane)
    known = np.isfinite(below).all(axis=0)
    if known.mean() < LEAST_KNOWN:
        return None
    along = np.maximum(deepest(below[:, known]), 0.0)
    low, high = np.percentile(along, (shallow_percent, DEEP_PERCENT))
    burr_mm, sd_mm = _burr_mm(mark, depth, plane, height), math.hypot(least_sd_mm, sd_of_scatter * scatter_mm)
    return MarkDepth(float(along.mean()), float(low), float(high), burr_mm, sd_mm)


def _burr_mm(mark: CentreLine, depth: Floats, plane: Floats, height: float) -> float | None:
    # from the stroke's edge to where land begins
    beside = mark.half_width + np.linspace(0.0, BURR_REACH_HEIGHTS * height, 9)
    rises = [-across(depth, mark.points, mark.normals, side, plane) for side in (-beside, beside)]
    rim = np.concatenate([crest(rise[:, np.isfinite(rise).all(axis=0)]) for rise in rises])
    if rim.size < LEAST_KNOWN * 2 * len(mark.points):
        return None
    return max(float(np.percentile(rim, DEEP_PERCENT)), 0.0)


def across(depth: Floats, points: Floats, normals: Floats, aside: Floats, plane: Floats) -> Floats:
    """(aside, n) depth below a plane across a stroke at each of (n, 2) points; bilinear, NaN outside the felt area."""
    places = points.T[:, None] + aside[:, None] * normals.T[:, None]
    felt = ndimage.map_coordinates(depth, places, order=1, mode="nearest")
    return np.asarray(felt - plane[0] - (places[0] * plane[1] + places[1] * plane[2]))


def deepest(depth: Floats) -> Floats:
    """(n,) depth at the middle of the stroke, where the sum over neighbouring points is deepest."""
    row = np.argmax(_sum_neighbours(depth), axis=0)
    return np.asarray(np.take_along_axis(depth, row[None], axis=0)[0])


def crest(rise: Floats) -> Floats:
    """(n,) height of a rim at its highest point across, averaged over neighbours to ignore single grains."""
    return np.asarray((_sum_neighbours(rise) / _sum_neighbours(np.ones_like(rise))).max(axis=0))


def _sum_neighbours(values: Floats) -> Floats:
    window = np.ones(min(SMOOTH_POINTS, values.shape[1]))
    return np.asarray(ndimage.correlate1d(values, window, axis=1, mode="constant") if window.size else values)


def _plane(
    mark: CentreLine,
    depth: Floats,
    land: NDArray[np.bool_],
    height: float,
    *,
    reach_heights: float = 0.35,
    most_samples: int = 400,
    least_samples: int = 30,
) -> tuple[Floats, float] | None:
    reach = reach_heights * height
    low = np.maximum(np.floor(mark.points.min(axis=0) - reach).astype(np.intp), 0)
    high = np.maximum(np.ceil(mark.points.max(axis=0) + reach).astype(np.intp) + 1, 0)
    samples = np.argwhere(land[low[0] : high[0], low[1] : high[1]]) + low
    if len(samples) < least_samples:
        return None
    row, col = samples[:: -(-len(samples) // most_samples)].T
    middle = mark.points.mean(axis=0)
    level, down, right = robust_plane(depth[row, col], row - middle[0], col - middle[1])
    plane = np.array([level - down * middle[0] - right * middle[1], down, right])
    off = depth[row, col] - plane @ (np.ones_like(row), row, col)
    return plane, 1.4826 * float(np.median(np.abs(off - np.median(off))))


def robust_plane(level: Floats, row: Floats, col: Floats, *, rounds: int = 3) -> Floats:
    """(3,) level and slopes at (row, col), by Tukey's weights; the smallest slopes if all lie on one line."""
    design = np.column_stack([np.ones(level.size), row, col])
    terms = np.array([np.median(level), 0.0, 0.0])
    for _ in range(rounds):
        residual = level - design @ terms
        spread = 1.4826 * np.median(np.abs(residual))
        if spread <= 0.0:
            break
        weighted = design * (np.clip(1.0 - (residual / (3.0 * spread)) ** 2, 0.0, None) ** 2)[:, None]
        terms = np.linalg.lstsq(weighted.T @ design, weighted.T @ level, rcond=None)[0]
    return terms
