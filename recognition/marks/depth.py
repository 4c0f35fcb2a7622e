r"""Depth of each character, by touch: along its strokes' centre lines, from the land beside it.

          land, a plane through the samples beside the character (ink and burr left out)
    ______/\                   /\______
             \     depth      /            burr (high metal): not land (27 CFR 478.92 measures from the flat surface)
              \______|_______/
                     ^ centre line, looked for sideways by a little more than characters are misplaced

Depth is what the ball of the tip reaches, averaged over a sample (a fortieth of the height). Less the truth of
stamped parts, gothic, 32 characters each, default whisker and ball; micrometres, mean +- standard deviation:

    height, mm      3.2            5.0            7.0            12.7        depth there: 0.14 0.19 0.27 0.40 mm
    FLAT         +4.5 +- 0.8    +5.9 +- 1.1    +7.9 +- 1.3    +11.2 +- 2.2
    ROUND        +2.2 +- 0.5    +1.9 +- 0.5    +2.4 +- 0.7     +2.3 +- 0.7
    SHARP       -10.3 +- 2.2   -18.6 +- 3.4   -27.1 +- 4.7    -58.4 +- 9.8

Nothing of this is corrected. A place that stands above the land, filled over or heaped with dirt, has no depth: it
counts as 0, never as less. In a V of 45 degrees a ball of radius r stops 0.41 (r - root radius) above the bottom,
13, 21, 29 and 54 micrometres here: that is the bias, but whether a groove is a V is not known from a reading.
Such a mark is measured too shallow, never too deep. Of a raised SHARP mark the crest is averaged away, a third of it.

The burr is the rim beside the strokes, averaged over a few points along them. Touch rounds it off: of a rim 0.04 mm
high, K804217 of 5 mm, the share felt is 0.19 where it is 0.1 mm wide, 0.42 at 0.225, 0.67 at 0.4, 0.78 at 0.6 and 0.81
at 0.8. So a burr is at least as high as measured. A milled plate without any shows up to 0.01 mm; dirt heaped beside a
stroke counts, too.

Where a recorded scan was felt on a tilted part, moments count against those of the land beside them, so depths are
as wrong as the lift of the land: h_land / d0. Height maps are levelled before they are felt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveInt
from pydantic.dataclasses import dataclass as checked

from recognition.marks.centre_lines import CentreLine, centre_line
from recognition.marks.depth_sampling import (
    DepthField,
    across,
    crest,
    deepest,
    mean_depths,
    percentile,
    robust_plane,
    turn_matrix,
)
from recognition.marks.laid_text import LaidText
from recognition.ranges import Angles, Factors, Percent, ThreeOrMore
from whisker_array.estimation.relief import Relief

Points = NDArray[np.float64]


@checked(frozen=True)
class SettleSearch:
    """Poses to try for a character's centre line, about the pose that was read.

    Attributes:
        shift_heights: greatest shift down and to the right, either way, character heights.
        shift_steps: number of shifts each way.
        turns_deg: angles about the one read: cells are turned by 3 degrees or not at all.
        sizes: factors of the size: heights are right to 5 percent.
        every: use every so many-th point of the centre line.

    Raises:
        ValueError: a number out of its range.
    """

    shift_heights: float = 0.05
    shift_steps: PositiveInt = 2
    turns_deg: Angles = (-3.0, -1.5, 0.0, 1.5, 3.0)
    sizes: Factors = (0.96, 0.98, 1.0, 1.02, 1.04)
    every: PositiveInt = 3

    @cached_property
    def turns(self) -> tuple[Points, ...]:
        """Matrices that turn row vectors."""
        return tuple(turn_matrix(angle) for angle in self.turns_deg)


@checked(frozen=True)
class DepthRules:
    """Measures of depth along a centre line, and of the land beside it.

    Lengths are character heights.

    Attributes:
        shallow_percentile: quantile of the depths along the centre line that counts as the least, percent: a shallow
            leg of a character is a quarter or more of its line and shows in full, a tenth is as short as a crossing, a
            stroke's end or a bad sample.
        deep_percentile: the quantile that counts as the greatest, percent.
        sideways_heights: search radius across a stroke for its middle.
        sideways_steps: number of places across a stroke.
        burr_steps: places across the rim, from the stroke's edge to where land begins, of which the highest counts.
        smoothing_points: points along the stroke over which the middle is looked for together: one bad sample moves
            nothing.
        land_reach_heights: search radius for land about the character.
        burr_reach_heights: least distance of land from any ink; burrs are half as wide.
        plane_samples: most samples of land that the plane is fitted to.
        least_land: samples of land that must have been felt for a depth to be given.
        least_known: share of the centre line that must have been felt for a depth to be given.

    Raises:
        ValueError: a number out of its range.
    """

    shallow_percentile: Percent = 10.0
    deep_percentile: Percent = 90.0
    sideways_heights: float = 0.03
    sideways_steps: PositiveInt = 13
    burr_steps: PositiveInt = 9
    smoothing_points: PositiveInt = 5
    land_reach_heights: float = 0.35
    burr_reach_heights: float = 0.1
    plane_samples: ThreeOrMore = 400
    least_land: ThreeOrMore = 30
    least_known: float = 0.5


SETTLE_SEARCH = SettleSearch()
DEPTH_RULES = DepthRules()


@dataclass(frozen=True)
class MarkDepth:
    """Depth of a character, or height of a raised one, from the land beside it, mm.

    Felt along the strokes' centre lines; positive either way, 0 where the surface runs the wrong way: what is filled
    over has no depth.

    Attributes:
        mean_mm: over the centre line.
        min_mm: the shallowest tenth reaches no deeper than this.
        max_mm: the deepest tenth reaches this.
        burr_mm: height of the rim beside the strokes above the land ("high metal"): the highest tenth reaches this;
            of a raised mark how deep a rim is sunk. None where it is not known.

    Raises:
        ValueError: a value below 0 or not finite; a least depth above the greatest.
    """

    mean_mm: float
    min_mm: float
    max_mm: float
    burr_mm: float | None = None

    def __post_init__(self) -> None:
        values = (self.mean_mm, self.min_mm, self.max_mm, self.burr_mm or 0.0)
        if not all(math.isfinite(v) and v >= 0.0 for v in values):
            raise ValueError(f"{self} is below 0 or not finite; a depth that is not known is None")
        if self.min_mm > self.max_mm:
            raise ValueError(f"{self} has a least depth above its greatest")


def mark_depths(
    relief: Relief,
    laid: LaidText,
    *,
    search: SettleSearch = SETTLE_SEARCH,
    rules: DepthRules = DEPTH_RULES,
) -> tuple[MarkDepth | None, ...]:
    """Depth of each character of a line; None where too little of it or of the land beside it was felt.

    Args:
        relief: the surface as felt.
        laid: the line's text in the templates of a font that has all its characters.
        search: poses to try for each character's centre line.
        rules: quantiles, search radii and least numbers of samples.
    """
    line = _LineDepths(DepthField(relief, raised=laid.raised), laid.line.height_mm, search, rules)
    places = zip(laid.text, laid.places_mm(), laid.turns_deg(), strict=True)
    marks = [
        line.settle(line.mark(centre_line(laid.font, char, face=laid.face), place, float(turn)))
        for char, place, turn in places
    ]
    land = line.land(marks)
    return tuple(line.depth(mark, land) for mark in marks)


@dataclass(frozen=True, eq=False)
class _Mark:
    """A character's centre line in samples of the field: points (n, 2) and normals as (row, col)."""

    points: Points
    normals: Points
    half_width_mm: float


@dataclass(frozen=True, eq=False)
class _LineDepths:
    """The field about a line's characters, and how their depths are measured."""

    field: DepthField
    height_mm: float
    search: SettleSearch
    rules: DepthRules

    def _samples(self, heights: float) -> float:
        """A length in samples of the field."""
        return heights * self.height_mm / self.field.pitch_mm

    def mark(self, shape: CentreLine, place_mm: Points, turn_deg: float) -> _Mark:
        """The centre line of a character where it was read."""
        pitch_mm, matrix = self.field.pitch_mm, turn_matrix(turn_deg)
        middle = (place_mm - self.field.origin_mm)[::-1] / pitch_mm
        points = middle + (shape.points * self.height_mm @ matrix)[:, ::-1] / pitch_mm
        return _Mark(points, (shape.normals @ matrix)[:, ::-1], shape.half_width * self.height_mm)

    def settle(self, mark: _Mark) -> _Mark:
        """The character moved, turned and sized a little to where its centre line lies deepest as a whole."""
        if not len(mark.points):
            return mark
        search = self.search
        middle = mark.points.mean(axis=0)
        thinned = mark.points[:: search.every] - middle
        step = self._samples(search.shift_heights / search.shift_steps)
        moves = np.arange(-search.shift_steps, search.shift_steps + 1) * step

        def along(poses: Sequence[Points]) -> NDArray[np.float64]:
            """(poses, shifts down, shifts right) mean depth; places not felt count as land."""
            tried = np.stack([thinned @ pose for pose in poses])
            return np.asarray(mean_depths(self.field.depth_mm, tried, middle, moves))

        turn = search.turns[int(np.argmax(along(search.turns).max(axis=(1, 2))))]
        poses = [turn * size for size in search.sizes]
        table = along(poses)
        best, i, j = np.unravel_index(int(np.argmax(table)), table.shape)
        shift = (
            moves[i] + step * _vertex(table[best, :, j], int(i)),
            moves[j] + step * _vertex(table[best, i], int(j)),
        )
        points = (mark.points - middle) @ poses[int(best)] + middle + shift
        return _Mark(points, mark.normals @ turn, mark.half_width_mm)

    def land(self, marks: Sequence[_Mark]) -> NDArray[np.bool_]:
        """Samples that were felt and lie clear of every character's ink and burr."""
        from scipy import ndimage

        bare = np.ones(self.field.depth_mm.shape, dtype=np.bool_)
        half = max((mark.half_width_mm for mark in marks), default=0.0)
        for mark in marks:
            at = np.clip(np.round(mark.points).astype(np.intp), 0, np.array(bare.shape) - 1)
            bare[at[:, 0], at[:, 1]] = False
        clear = (half + self.rules.burr_reach_heights * self.height_mm) / self.field.pitch_mm
        return np.asarray((ndimage.distance_transform_edt(bare) > clear) & np.isfinite(self.field.depth_mm))

    def depth(self, mark: _Mark, land: NDArray[np.bool_]) -> MarkDepth | None:
        """Depth of one character; None where too little of it or of the land beside it was felt."""
        rules, plane = self.rules, self._plane(mark, land) if len(mark.points) else None
        if plane is None:
            return None
        reach = self._samples(rules.sideways_heights)
        aside = np.linspace(-reach, reach, rules.sideways_steps)
        depth = across(self.field.depth_mm, mark.points, mark.normals, aside, plane)
        known = np.isfinite(depth).all(axis=0)
        if known.mean() < rules.least_known:
            return None
        below = np.maximum(deepest(np.ascontiguousarray(depth[:, known]), rules.smoothing_points), 0.0)
        low, high = (percentile(below, part) for part in (rules.shallow_percentile, rules.deep_percentile))
        return MarkDepth(float(below.mean()), low, high, self._burr_mm(mark, plane))

    def _burr_mm(self, mark: _Mark, plane: NDArray[np.float64]) -> float | None:
        """Height of the rim beside the strokes above the land; None where too little of it was felt."""
        rules, half = self.rules, mark.half_width_mm / self.field.pitch_mm
        beside = half + np.linspace(0.0, self._samples(rules.burr_reach_heights), rules.burr_steps)
        crests = []
        for side in (-beside, beside):
            rise = -across(self.field.depth_mm, mark.points, mark.normals, side, plane)
            rise = np.ascontiguousarray(rise[:, np.isfinite(rise).all(axis=0)])
            crests.append(crest(rise, rules.smoothing_points) if rise.size else np.empty(0))
        rim = np.concatenate(crests)
        if rim.size < rules.least_known * 2 * len(mark.points):
            return None
        return max(percentile(rim, rules.deep_percentile), 0.0)

    def _plane(self, mark: _Mark, land: NDArray[np.bool_]) -> NDArray[np.float64] | None:
        """Level and slopes (per sample, along rows and columns) of the land about a character; robust."""
        reach = self._samples(self.rules.land_reach_heights)
        low = np.maximum(np.floor(mark.points.min(axis=0) - reach).astype(np.intp), 0)
        high = np.ceil(mark.points.max(axis=0) + reach).astype(np.intp) + 1
        window = (slice(low[0], max(high[0], 0)), slice(low[1], max(high[1], 0)))
        row, col = np.nonzero(land[window])
        if row.size < self.rules.least_land:
            return None
        thinned = slice(None, None, -(-row.size // self.rules.plane_samples))
        row, col = row[thinned], col[thinned]
        level = self.field.depth_mm[window][row, col]
        middle = mark.points.mean(axis=0)
        down, right = row + low[0] - middle[0], col + low[1] - middle[1]
        terms = robust_plane(level, down, right)
        return np.array([terms[0] - terms[1] * middle[0] - terms[2] * middle[1], terms[1], terms[2]])


def _vertex(values: NDArray[np.float64], at: int) -> float:
    """Where between neighbours the parabola through a maximum has its vertex, in steps."""
    if not 0 < at < values.size - 1:
        return 0.0
    before, here, after = values[at - 1 : at + 2]
    bend = 2.0 * here - before - after
    return float(np.clip(0.5 * (after - before) / bend, -0.5, 0.5)) if bend > 0.0 else 0.0
