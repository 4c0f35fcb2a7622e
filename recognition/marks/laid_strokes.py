"""Characters of a font laid over a surface, each where it lies deepest, and which of their strokes were felt there.

relief --less the land--> depth --a window a place--> moved, turned and sized --> points: felt, or not
                                                                                         open: could be, or not
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.marks.centre_lines import centre_line
from recognition.marks.depth_sampling import DepthField, mean_depths, percentile, turn_matrix

STEP_HEIGHTS, SETTLE_EVERY = 0.05, 3
"""Between points of a stroke; of these, one in so many settles where it lies."""
ALIKE_HEIGHTS = 0.13
"""Between strokes of two characters below which they are the same one."""
FELT_SHARE, FELT_NOISE = 0.4, 3.0
"""Share of a character's usual depth, and multiple of the land's spread, from which a stroke is felt."""
HEAP_SHARE = 0.5
"""Height above the land, as a share of the line's depth, from which dirt covers what is below."""
BESIDE_HEIGHTS = 0.07
"""About a point of a stroke where its groove is looked for."""
TURNS_DEG, WIDTHS, HEIGHTS = (-14.0, -7.0, 0.0, 7.0, 14.0), (0.78, 0.9, 1.0, 1.12, 1.28), (0.95, 1.05)
"""Search ranges of a character against the font's: blows turn it, and so does an arc that was taken for a line;
fonts are wider or narrower; lines are found so well."""
SHIFT_HEIGHTS, SHIFT_STEPS = 0.16, 5
TURN_COST, WIDTH_COST, HEIGHT_COST, SHIFT_COST = 0.006, 0.2, 0.4, 0.2
"""Share of the depth that a degree, a unit of the logarithms and a height of either shift must gain."""
LAND_HEIGHTS, LAND_STEPS = 1.2, 6
"""Window whose median is the land, and samples of it to a height."""
WINDOW_HEIGHTS, CELL_HEIGHTS = 0.9, 0.6
"""About the middle of a place: what is looked at, and what is its own where no neighbour is nearer."""
DEEP_PERCENT = 95.0
CALM_PERCENT, CALM_SPREADS = 30.0, 0.385
"""Quantile of all depths that is surely land, and the same of normal noise in standard deviations."""

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_TRIED = tuple(product(TURNS_DEG, WIDTHS, HEIGHTS))
_POSES = np.stack([np.diag((wide, tall)) @ turn_matrix(turn) for turn, wide, tall in _TRIED])
"""(poses, 2, 2) that turn and size row vectors (right, down)."""
_COSTS = np.array(
    [
        TURN_COST * abs(turn) + WIDTH_COST * abs(math.log(wide)) + HEIGHT_COST * abs(math.log(tall))
        for turn, wide, tall in _TRIED
    ]
)


@dataclass(frozen=True, eq=False)
class LaidCharacter:
    """A character over the surface of a place.

    Attributes:
        score: mean depth of its strokes, of the deepest about the place, less what its pose costs; 1 at best.
        points: (n, 2) of its strokes, (row, col) of the place's window, STEP_HEIGHTS apart.
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

    def __init__(self, field: DepthField, middles: Floats, turns_deg: Floats, *, height_mm: float) -> None:
        """Level it.

        Args:
            field: as felt.
            middles: (places, 2) (row, col) of the field.
            turns_deg: (places,) of the line there.
            height_mm: of the characters.
        """
        from scipy import ndimage

        self.height_px = height_mm / field.pitch_mm
        self._reach = max(2, round(WINDOW_HEIGHTS * self.height_px))
        known = np.isfinite(field.depth_mm)
        depth = np.where(known, field.depth_mm, 0.0)
        depth -= _land(depth, self.height_px)
        blurred = ndimage.uniform_filter(depth, 3)
        self.noise = _spread(blurred[known]) if known.any() else 0.0
        wide = max(3, round(2 * BESIDE_HEIGHTS * self.height_px) | 1)
        maps = (depth, ndimage.maximum_filter(blurred, wide), ndimage.uniform_filter(depth, wide), known)
        self._windows = [self._window(maps, middles, k, float(turn)) for k, turn in enumerate(turns_deg)]

    def _window(
        self, maps: Sequence[NDArray[np.generic]], middles: Floats, place: int, turn: float
    ) -> _Window:
        low = np.rint(middles[place]).astype(np.intp) - self._reach
        cut = [_square_about(one, low, 2 * self._reach + 1) for one in maps]
        at = np.arange(-self._reach, self._reach + 1)
        matrix = turn_matrix(turn)
        along = at * matrix[0, 0] + at[:, None] * matrix[0, 1]
        before, after = (
            0.5 * float(np.linalg.norm(middles[k] - middles[place])) if 0 <= k < len(middles) else math.inf
            for k in (place - 1, place + 1)
        )
        most = CELL_HEIGHTS * self.height_px
        own = (along > -min(before, most)) & (along < min(after, most))
        depth = np.where(own, cut[0], 0.0)
        deep = max(percentile(depth[own], DEEP_PERCENT), 1e-9)
        open_ = cut[3].astype(np.bool_) & (cut[2] > -HEAP_SHARE * deep)
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
        shape, window = _pieces(font, char), self._windows[place]
        if not len(shape):
            none = np.zeros(0, dtype=np.bool_)
            return LaidCharacter(-1.0, np.zeros((0, 2)), none, none, none)
        middle = np.full(2, float(self._reach))
        poses = (shape @ _POSES @ window.turn)[:, :, ::-1] * self.height_px
        moves = np.linspace(-SHIFT_HEIGHTS, SHIFT_HEIGHTS, SHIFT_STEPS) * self.height_px
        table = mean_depths(window.depth, poses[:, ::SETTLE_EVERY], middle, moves) / window.deep
        far = SHIFT_COST * np.abs(moves) / self.height_px
        table -= _COSTS[:, None, None] + far[:, None] + far
        best, i, j = np.unravel_index(int(np.argmax(table)), table.shape)
        points = poses[int(best)] + middle + (moves[i], moves[j])
        row, col = np.clip(np.rint(points).astype(np.intp), 0, 2 * self._reach).T
        deepest = window.near[row, col]
        felt = deepest > FELT_SHARE * window.deep
        usual = float(np.median(deepest[felt])) if felt.any() else window.deep
        return LaidCharacter(
            float(table[best, i, j]),
            points,
            deepest > max(FELT_SHARE * usual, FELT_NOISE * self.noise),
            window.open[row, col],
            window.own[row, col],
        )

    def apart(self, one: LaidCharacter, other: LaidCharacter) -> Bools:
        """(n,) points of a character that are the place's own and that the other has no stroke by."""
        far = np.linalg.norm(one.points[:, None] - other.points, axis=2).min(axis=1, initial=np.inf)
        return np.asarray((far > ALIKE_HEIGHTS * self.height_px) & one.within)


@lru_cache(maxsize=1024)
def _pieces(font: Font, char: str) -> Floats:
    """(n, 2) points along a character's strokes, one to a square of STEP_HEIGHTS: a double stroke counts once."""
    points = centre_line(font, char).points
    _, first = np.unique(np.floor(points / STEP_HEIGHTS), axis=0, return_index=True)
    return points[np.sort(first)]


def _square_about(values: NDArray[np.generic], low: NDArray[np.intp], size: int) -> NDArray[np.float64]:
    """A square of a map; 0, which is land, and not known, beyond it."""
    out = np.zeros((size, size))
    first, last = np.maximum(low, 0), np.minimum(low + size, values.shape)
    if (last > first).all():
        r, c = first - low
        out[r : r + last[0] - first[0], c : c + last[1] - first[1]] = values[
            first[0] : last[0], first[1] : last[1]
        ]
    return out


def _spread(depth: Floats) -> float:
    """Standard deviation of the land, from the least of its magnitudes: marks and dirt are the others."""
    return percentile(np.abs(depth), CALM_PERCENT) / CALM_SPREADS


def _land(depth: Floats, height_px: float) -> Floats:
    """Level of the land: the median about each place, of a thinned map."""
    from scipy import ndimage

    from glyphs.opencv import cv2

    every = max(1, int(height_px / LAND_STEPS))
    thinned = depth[::every, ::every]
    level = ndimage.median_filter(thinned, size=int(LAND_HEIGHTS * height_px / every) | 1)
    return np.asarray(cv2.resize(level, depth.shape[::-1], interpolation=cv2.INTER_LINEAR))
