"""Characters of a font laid over a surface, each where it lies deepest, and which of their strokes were felt there.

relief --less the land--> depth --a window a place--> moved, turned and sized --> points: felt, or not
                                                                                         open: could be, or not
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt
from pydantic.dataclasses import dataclass as checked

from glyphs.fonts.glyph import Font
from recognition.marks.centre_lines import centre_line
from recognition.marks.depth_sampling import DepthField, mean_depths, percentile, turn_matrix
from recognition.ranges import Angles, Factors, Percent

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@checked(frozen=True)
class PoseSearch:
    """Poses of a character to try, and the gain in depth that each must bring.

    Blows turn a character, and so does an arc that was taken for a line; fonts are wider or narrower than the one
    laid; the height of a line is found to 5 percent. Costs are shares of the depth of the place.

    Attributes:
        turns_deg: angles to try.
        widths: factors of the font's width to try.
        heights: factors of the font's height to try.
        shift_heights: greatest shift down and to the right, either way, character heights.
        shift_steps: number of shifts along each axis.
        every: use every so many-th point of the strokes.
        turn_cost: cost of a degree.
        width_cost: cost of a unit of the width's logarithm.
        height_cost: cost of a unit of the height's logarithm.
        shift_cost: cost of a shift by a character height along either axis.

    Raises:
        ValueError: a number out of its range.
    """

    turns_deg: Angles = (-14.0, -7.0, 0.0, 7.0, 14.0)
    widths: Factors = (0.78, 0.9, 1.0, 1.12, 1.28)
    heights: Factors = (0.95, 1.05)
    shift_heights: float = 0.16
    shift_steps: PositiveInt = 5
    every: PositiveInt = 3
    turn_cost: float = 0.006
    width_cost: float = 0.2
    height_cost: float = 0.4
    shift_cost: float = 0.2

    @cached_property
    def matrices(self) -> Floats:
        """(poses, 2, 2) that turn and size row vectors (right, down)."""
        tried = product(self.turns_deg, self.widths, self.heights)
        return np.stack([np.diag((wide, tall)) @ turn_matrix(turn) for turn, wide, tall in tried])

    @cached_property
    def costs(self) -> Floats:
        """(poses,) cost of each, without its shift."""
        tried = product(self.turns_deg, self.widths, self.heights)
        return np.array(
            [
                self.turn_cost * abs(turn)
                + self.width_cost * abs(math.log(wide))
                + self.height_cost * abs(math.log(tall))
                for turn, wide, tall in tried
            ]
        )


@checked(frozen=True)
class StrokeLimits:
    """Limits from which a stroke counts as felt, and the windows in which it is looked for.

    Lengths are character heights.

    Attributes:
        step_heights: distance between points of a stroke.
        alike_heights: distance between strokes of two characters below which they are the same stroke.
        felt_share: share of a character's usual depth from which a stroke is felt.
        felt_noise: multiple of the land's spread that a felt stroke must reach as well.
        heap_share: height above the land, as a share of the line's depth, from which dirt covers what is below.
        beside_heights: search radius for the groove about a point of a stroke.
        land_heights: size of the window whose median is the land.
        land_steps: samples of that window to a character height.
        window_heights: half the size of the window about the middle of a place.
        cell_heights: greatest distance along the line from the middle of a place that belongs to the place.
        deep_percent: quantile of the depths of a place that is taken for its depth, percent.
        calm_percent: quantile of the magnitudes of all depths that is surely land, percent.
        calm_spreads: same quantile of the magnitudes of normal noise, standard deviations.

    Raises:
        ValueError: a number out of its range.
    """

    step_heights: PositiveFloat = 0.05
    alike_heights: float = 0.13
    felt_share: float = 0.4
    felt_noise: float = 3.0
    heap_share: float = 0.5
    beside_heights: float = 0.07
    land_heights: PositiveFloat = 1.2
    land_steps: PositiveInt = 6
    window_heights: PositiveFloat = 0.9
    cell_heights: PositiveFloat = 0.6
    deep_percent: Percent = 95.0
    calm_percent: Percent = 30.0
    calm_spreads: PositiveFloat = 0.385


POSE_SEARCH = PoseSearch()
STROKE_LIMITS = StrokeLimits()


@dataclass(frozen=True, eq=False)
class LaidCharacter:
    """A character over the surface of a place.

    Attributes:
        score: mean depth of its strokes, of the deepest about the place, less what its pose costs; 1 at best.
        points: (n, 2) of its strokes, (row, col) of the place's window, `StrokeLimits.step_heights` apart.
        felt: (n,) whether the stroke was felt there.
        open: (n,) whether one could be felt.
        within: (n,) whether this is the place's own, and not its neighbours'.
    """

    score: float
    points: Floats
    felt: Bools
    open: Bools
    within: Bools

    def share_felt(self) -> float:
        """Share of its strokes that was felt, of those that could be; 0 where none could be."""
        return float((self.felt & self.open).sum() / max(self.open.sum(), 1))


@dataclass(frozen=True, eq=False)
class _Window:
    """The surface about a place: its own depths, up to `deep`, and 0 where the neighbours begin."""

    deep: float
    turn: Floats
    depth: Floats
    near: Floats
    open: Bools
    own: Bools


class PlacesFelt:
    """The surface about the places of a line."""

    def __init__(
        self,
        field: DepthField,
        middles: Floats,
        turns_deg: Floats,
        *,
        height_mm: float,
        poses: PoseSearch = POSE_SEARCH,
        limits: StrokeLimits = STROKE_LIMITS,
    ) -> None:
        """Level it.

        Args:
            field: as felt.
            middles: (places, 2) (row, col) of the field.
            turns_deg: (places,) of the line there.
            height_mm: of the characters.
            poses: poses in which characters are tried.
            limits: limits from which a stroke counts as felt.
        """
        from scipy import ndimage

        self.height_px, self.limits, self._poses = height_mm / field.pitch_mm, limits, poses
        self._reach = max(2, round(limits.window_heights * self.height_px))
        known = np.isfinite(field.depth_mm)
        depth = np.where(known, field.depth_mm, 0.0)
        depth -= _land(depth, self.height_px, limits)
        blurred = ndimage.uniform_filter(depth, 3)
        self.noise = _spread(blurred[known], limits) if known.any() else 0.0
        wide = max(3, round(2 * limits.beside_heights * self.height_px) | 1)
        nearest, mean = ndimage.maximum_filter(blurred, wide), ndimage.uniform_filter(depth, wide)
        # beyond the map lies land, of which nothing is known
        maps = [np.pad(one, 1) for one in (depth, nearest, mean, known)]
        self._windows = [self._window(maps, middles, k, float(turn)) for k, turn in enumerate(turns_deg)]

    def _window(self, maps: Sequence[NDArray[Any]], middles: Floats, place: int, turn: float) -> _Window:
        at = np.arange(-self._reach, self._reach + 1)
        around = np.rint(middles[place]).astype(np.intp)[:, None] + 1 + at
        rows, columns = np.clip(around, 0, np.array(maps[0].shape)[:, None] - 1)
        cut = [one[np.ix_(rows, columns)] for one in maps]
        matrix = turn_matrix(turn)
        along = at * matrix[0, 0] + at[:, None] * matrix[0, 1]
        before, after = (
            0.5 * float(np.linalg.norm(middles[k] - middles[place])) if 0 <= k < len(middles) else math.inf
            for k in (place - 1, place + 1)
        )
        most = self.limits.cell_heights * self.height_px
        own = (along > -min(before, most)) & (along < min(after, most))
        depth = np.where(own, cut[0], 0.0)
        deep = max(percentile(depth[own], self.limits.deep_percent), 1e-9)
        open_ = cut[3] & (cut[2] > -self.limits.heap_share * deep)
        return _Window(deep, matrix, np.minimum(depth, deep), cut[1], open_, own)

    def depth_mm(self) -> float:
        """Depth of the line's marks: the median of the deepest samples about its places."""
        return float(np.median([window.deep for window in self._windows]))

    def best_font(self, place: int, char: str, fonts: Sequence[Font]) -> tuple[Font, LaidCharacter] | None:
        """The font in which a character lies deepest at a place; None where none has it."""
        tried = [(font, self.lay(place, char, font)) for font in fonts if char in font.glyphs]
        return max(tried, key=lambda one: one[1].score, default=None)

    def lay(self, place: int, char: str, font: Font) -> LaidCharacter:
        """A character where it lies deepest about a place, turned and sized a little."""
        limits, search = self.limits, self._poses
        shape, window = _pieces(font, char, limits.step_heights), self._windows[place]
        if not len(shape):
            none = np.zeros(0, dtype=np.bool_)
            return LaidCharacter(-1.0, np.zeros((0, 2)), none, none, none)
        middle = np.full(2, float(self._reach))
        poses = (shape @ search.matrices @ window.turn)[:, :, ::-1] * self.height_px
        moves = np.linspace(-search.shift_heights, search.shift_heights, search.shift_steps) * self.height_px
        table = mean_depths(window.depth, poses[:, :: search.every], middle, moves) / window.deep
        far = search.shift_cost * np.abs(moves) / self.height_px
        table -= search.costs[:, None, None] + far[:, None] + far
        best, i, j = np.unravel_index(int(np.argmax(table)), table.shape)
        points = poses[int(best)] + middle + (moves[i], moves[j])
        row, col = np.clip(np.rint(points).astype(np.intp), 0, 2 * self._reach).T
        deepest = window.near[row, col]
        felt = deepest > limits.felt_share * window.deep
        usual = float(np.median(deepest[felt])) if felt.any() else window.deep
        return LaidCharacter(
            float(table[best, i, j]),
            points,
            deepest > max(limits.felt_share * usual, limits.felt_noise * self.noise),
            window.open[row, col],
            window.own[row, col],
        )

    def apart(self, one: LaidCharacter, other: LaidCharacter) -> Bools:
        """(n,) points of a character that are the place's own and that the other has no stroke by."""
        far = np.linalg.norm(one.points[:, None] - other.points, axis=2).min(axis=1, initial=np.inf)
        return np.asarray((far > self.limits.alike_heights * self.height_px) & one.within)


@lru_cache(maxsize=1024)
def _pieces(font: Font, char: str, step: float) -> Floats:
    """(n, 2) points along a character's strokes, one to a square of a step: a double stroke counts once."""
    points = centre_line(font, char).points
    _, first = np.unique(np.floor(points / step), axis=0, return_index=True)
    return points[np.sort(first)]


def _spread(depth: Floats, limits: StrokeLimits) -> float:
    """Standard deviation of the land, from the least of its magnitudes: marks and dirt are the others."""
    return percentile(np.abs(depth), limits.calm_percent) / limits.calm_spreads


def _land(depth: Floats, height_px: float, limits: StrokeLimits) -> Floats:
    """Level of the land: the median about each place, of a thinned map."""
    from scipy import ndimage

    from glyphs.opencv import cv2

    every = max(1, int(height_px / limits.land_steps))
    thinned = depth[::every, ::every]
    level = ndimage.median_filter(thinned, size=int(limits.land_heights * height_px / every) | 1)
    return np.asarray(cv2.resize(level, depth.shape[::-1], interpolation=cv2.INTER_LINEAR))
