"""Which strokes of a character were felt: of the one that was read, and of its rivals.

    R read, P its rival                             felt    missing
      .--.       P       .--.     R has, P has not     \\     against P, for P
      |__|               |__|     P has, R has not     -     nothing
      |  \\              |

Both are laid over the surface where each lies deepest, in a font that nobody need have named: which strokes tell two
characters apart hardly depends on the font. A piece of a stroke that was felt speaks for who has it. One that was not
felt speaks against it, but never fully: it may be filled, the likelier the more is missing of the line's other
strokes. Where the surface stands above the land, or was not scanned, nothing could be felt, and nothing is said.
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
from recognition.decision.centre_lines import centre_line
from recognition.decision.depth_sampling import DepthField, mean_depths, percentile, turn_matrix
from recognition.language.confusions import SWAP_SETS
from recognition.language.lattice import Lattice
from recognition.lines.places import places_mm
from recognition.views.text_line import TextLine
from whisker_array.estimation.relief import Relief

LIVE = 0.004
"""Belief in a rival from which strokes must speak against it."""
STEP_HEIGHTS, SETTLE_EVERY = 0.05, 3
"""Between points of a stroke; of these, one in so many settles where it lies."""
PIECE_HEIGHTS = 0.25
"""Of a stroke, that is felt or filled as one: pieces speak for themselves."""
MISLED = 0.05
"""Chance that a piece seems felt where none is: a scratch, or strokes that run otherwise in the part's font."""
FILLED, FILLED_OF_MISSING = 0.03, 0.8
"""Chance that a piece is filled where nothing of the line is missing, and what the line's missing share adds."""
MOST_FILLED = 0.7
MOST_ABSENT = 6.0
"""Nats that all missing pieces of a character together may say against it: absence never speaks fully."""
ALIKE_HEIGHTS = 0.13
"""Between strokes of two characters below which they are the same one."""
FELT_SHARE, FELT_OF_LINE = 0.4, 0.12
"""Of a character's usual depth, and of the line's, from which a stroke is felt."""
HEAP_SHARE = 0.5
"""Of the line's depth, height above the land from which dirt covers what is below."""
BESIDE_HEIGHTS = 0.07
"""About a point of a stroke where its groove is looked for."""
TURNS_DEG, WIDTHS, HEIGHTS = (-4.0, 0.0, 4.0), (0.75, 0.87, 1.0, 1.15, 1.3), (0.92, 1.0, 1.08)
"""How a character may stand against the font's: blows turn it, fonts are wider or narrower, lines are found so well."""
SHIFT_HEIGHTS, SHIFT_STEPS = 0.15, 5
TURN_COST, WIDTH_COST, HEIGHT_COST, SHIFT_COST = 0.0075, 0.19, 0.39, 0.2
"""Share of the depth that a degree, a unit of the logarithms and a height of either shift must gain."""
LAND_HEIGHTS, LAND_STEPS = 1.2, 6
"""Window whose median is the land, and samples of it to a height."""
CELL_HEIGHTS = 0.6

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RivalStrokes:
    """What strokes say of a rival at a place.

    Attributes:
        char: the rival.
        belief: in it without its strokes.
        margin: nats by which strokes speak for the character that was read; negative for the rival.
        apart_heights: length of the strokes that only one of them has.
        more_heights: of these, what only the rival has.
        hidden: share of the latter where nothing could be felt.
    """

    char: str
    belief: float
    margin: float
    apart_heights: float
    more_heights: float
    hidden: float


@dataclass(frozen=True)
class PlaceStrokes:
    """What was felt of the character read at a place.

    Attributes:
        felt: share of its strokes that was felt, in the font that suits it best; None where no font has it.
        font: that one's name.
        rivals: that the format allows and that are live, or declared to be taken for it.
    """

    felt: float | None
    font: str = ""
    rivals: tuple[RivalStrokes, ...] = ()


@dataclass(frozen=True, eq=False)
class _Laid:
    """A character over the surface: points (n, 2) as (row, col), whether each is felt, could be, and is the place's."""

    score: float
    points: Floats
    felt: NDArray[np.bool_]
    open: NDArray[np.bool_]
    within: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FeltLine:
    """A line as it was felt: what is asked for the strokes of characters.

    Attributes:
        relief: the surface.
        line: where the text lies.
        columns: of its strip, where the places stand.
        raised: whether its marks stand out.
        fonts: whose strokes may be looked for.
    """

    relief: Relief
    line: TextLine
    columns: Floats
    raised: bool
    fonts: tuple[Font, ...]

    def strokes(self, text: Sequence[str], lattice: Lattice) -> tuple[PlaceStrokes, ...]:
        """What was felt of the characters read, and of their rivals.

        Args:
            text: a character a place.
            lattice: beliefs in all that may stand there.
        """
        if len(text) != self.columns.size or lattice.n_places != len(text):
            return ()
        surface = _Surface(self)
        best = [surface.suited(k, char) for k, char in enumerate(text)]
        missing = [1.0 - _share(one[1].felt, one[1].open) for one in best if one is not None]
        filled = min(FILLED + FILLED_OF_MISSING * float(np.mean(missing or [0.0])), MOST_FILLED)
        made = []
        for k, (char, one) in enumerate(zip(text, best, strict=True)):
            if one is None:
                made.append(PlaceStrokes(None))
                continue
            font, laid = one
            beliefs = np.exp(lattice.log_belief[k])
            rivals = tuple(
                _against(surface, laid, surface.laid(k, rival, font), rival, filled, belief)
                for rival, belief in _rivals(char, lattice.chars, beliefs)
                if rival in font.glyphs
            )
            made.append(PlaceStrokes(_share(laid.felt, laid.open), font.name, rivals))
        return tuple(made)


def _rivals(char: str, chars: Sequence[str], beliefs: Floats) -> list[tuple[str, float]]:
    """Live ones, and those declared that the format allows."""
    declared = {c for swap in SWAP_SETS if char in swap.chars for c in swap.chars}
    return [
        (c, float(b))
        for c, b in zip(chars, beliefs, strict=True)
        if c != char and (b >= LIVE or (c in declared and b > 0.0))
    ]


def _share(felt: NDArray[np.bool_], known: NDArray[np.bool_]) -> float:
    return float((felt & known).sum() / max(known.sum(), 1))


def _against(
    surface: _Surface, read: _Laid, rival: _Laid, char: str, filled: float, belief: float
) -> RivalStrokes:
    own, theirs = surface.apart(read, rival) & read.within, surface.apart(rival, read) & rival.within
    felt, absent = -math.log(MISLED), -math.log(filled)
    pieces = STEP_HEIGHTS / PIECE_HEIGHTS

    def many(laid: _Laid, only: NDArray[np.bool_], felt: bool) -> float:
        return pieces * float((only & laid.open & (laid.felt == felt)).sum())

    margin = felt * (many(read, own, True) - many(rival, theirs, True))
    margin += min(absent * many(rival, theirs, False), MOST_ABSENT)
    margin -= min(absent * many(read, own, False), MOST_ABSENT)
    return RivalStrokes(
        char=char,
        belief=belief,
        margin=float(margin),
        apart_heights=float(own.sum() + theirs.sum()) * STEP_HEIGHTS,
        more_heights=float(theirs.sum()) * STEP_HEIGHTS,
        hidden=_share(~rival.open, theirs),
    )


_TRIED = tuple(product(TURNS_DEG, WIDTHS, HEIGHTS))
_POSES = np.stack([np.diag((wide, tall)) @ turn_matrix(turn) for turn, wide, tall in _TRIED])
"""(poses, 2, 2) that turn and size row vectors (right, down)."""
_COSTS = np.array(
    [
        TURN_COST * abs(turn) + WIDTH_COST * abs(math.log(wide)) + HEIGHT_COST * abs(math.log(tall))
        for turn, wide, tall in _TRIED
    ]
)


@lru_cache(maxsize=1024)
def _pieces(font: Font, char: str) -> Floats:
    """(n, 2) points along a character's strokes, one to a square of STEP_HEIGHTS: a double stroke counts once."""
    points = centre_line(font, char).points
    _, first = np.unique(np.floor(points / STEP_HEIGHTS), axis=0, return_index=True)
    return points[np.sort(first)]


class _Surface:
    """Depth below the land about the places of a line."""

    def __init__(self, about: FeltLine) -> None:
        field = DepthField(about.relief, raised=about.raised)
        self.fonts = about.fonts
        self.height_px = about.line.height_mm / field.pitch_mm
        known = np.isfinite(field.depth_mm)
        self.depth = np.where(known, field.depth_mm, 0.0)
        self.depth -= _land(self.depth, self.height_px)
        at = places_mm(about.line, about.columns)
        self.middles = (at[:, ::-1] - np.array(field.origin_mm)[::-1]) / field.pitch_mm
        ahead = places_mm(about.line, about.columns + 1.0) - at
        self.turns_deg = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
        apart = 0.5 * np.linalg.norm(np.diff(self.middles, axis=0), axis=1)
        self.halves = np.column_stack([np.r_[np.inf, apart], np.r_[apart, np.inf]])
        self.deep = np.array([self._deep(middle) for middle in self.middles])
        usual = float(np.median(self.deep)) if self.deep.size else 0.0
        self.least = FELT_OF_LINE * usual
        from scipy import ndimage

        wide = max(3, round(2 * BESIDE_HEIGHTS * self.height_px) | 1)
        blurred = ndimage.uniform_filter(self.depth, 3)
        self.near = ndimage.maximum_filter(blurred, wide)
        self.open = known & (ndimage.uniform_filter(self.depth, wide) > -HEAP_SHARE * usual)

    def suited(self, place: int, char: str) -> tuple[Font, _Laid] | None:
        """The font in which a character lies deepest at a place."""
        tried = [(font, self.laid(place, char, font)) for font in self.fonts if char in font.glyphs]
        return max(tried, key=lambda one: one[1].score, default=None)

    def laid(self, place: int, char: str, font: Font) -> _Laid:
        """A character where it lies deepest about a place, turned and sized a little."""
        shape = _pieces(font, char)
        deep, middle = max(self.deep[place], 1e-9), self.middles[place]
        if not len(shape):
            none = np.zeros(0, dtype=np.bool_)
            return _Laid(-1.0, np.zeros((0, 2)), none, none, none)
        turn = turn_matrix(float(self.turns_deg[place]))
        poses = (shape @ _POSES @ turn)[:, :, ::-1] * self.height_px
        moves = np.linspace(-SHIFT_HEIGHTS, SHIFT_HEIGHTS, SHIFT_STEPS) * self.height_px
        table = mean_depths(np.minimum(self.depth, deep), poses[:, ::SETTLE_EVERY], middle, moves) / deep
        far = SHIFT_COST * np.abs(moves) / self.height_px
        table -= _COSTS[:, None, None] + far[:, None] + far
        best, i, j = np.unravel_index(int(np.argmax(table)), table.shape)
        points = poses[int(best)] + middle + (moves[i], moves[j])
        row, col = np.clip(np.rint(points).astype(np.intp), 0, np.array(self.depth.shape) - 1).T
        deepest = self.near[row, col]
        felt = deepest > FELT_SHARE * deep
        usual = float(np.median(deepest[felt])) if felt.any() else deep
        return _Laid(
            float(table[best, i, j]),
            points,
            deepest > max(FELT_SHARE * usual, self.least),
            self.open[row, col],
            self._of_place(place, points),
        )

    def apart(self, one: _Laid, other: _Laid) -> NDArray[np.bool_]:
        """Points of a character that the other has no stroke by."""
        if not len(other.points):
            return np.ones(len(one.points), dtype=np.bool_)
        far = np.linalg.norm(one.points[:, None] - other.points, axis=2).min(axis=1, initial=np.inf)
        return np.asarray(far > ALIKE_HEIGHTS * self.height_px)

    def _of_place(self, place: int, points: Floats) -> NDArray[np.bool_]:
        """Not beyond half way to the neighbours, whose strokes are their own."""
        angle = math.radians(float(self.turns_deg[place]))
        along = (points - self.middles[place]) @ (math.sin(angle), math.cos(angle))
        before, after = self.halves[place]
        return np.asarray((along > -before) & (along < after))

    def _deep(self, middle: Floats) -> float:
        """Depth of what is deepest about a place."""
        reach = CELL_HEIGHTS * self.height_px
        low = np.maximum((middle - reach).astype(np.intp), 0)
        high = np.maximum((middle + reach).astype(np.intp), 0)
        window = self.depth[low[0] : high[0], low[1] : high[1]]
        return percentile(window, 95.0) if window.size > 1 else 0.0


def _land(depth: Floats, height_px: float) -> Floats:
    """Level of the land: the median about each place, of a thinned map."""
    from scipy import ndimage

    from glyphs.opencv import cv2

    every = max(1, int(height_px / LAND_STEPS))
    thinned = depth[::every, ::every]
    level = ndimage.median_filter(thinned, size=int(LAND_HEIGHTS * height_px / every) | 1)
    return np.asarray(cv2.resize(level, depth.shape[::-1], interpolation=cv2.INTER_LINEAR))
