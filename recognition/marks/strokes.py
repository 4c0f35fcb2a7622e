"""Strokes of characters that were felt, and what they say for the character that was read and against its rivals.

    R read, P its rival                             felt    missing
      .--.       P       .--.     R has, P has not     \\     against P, for P
      |__|               |__|     P has, R has not     -     nothing
      |  \\              |

Both characters are laid over the surface where each lies deepest::

    relief --less the land--> depth --a window a place--> moved, turned and sized --> points: felt, or not
                                                                                             open: could be, or not

Nobody needs to name the font, because the strokes that distinguish two characters hardly depend on it. A felt piece of
a stroke supports the characters that contain it. A missing piece counts against them, but never fully: it may be filled
with dirt. That is the likelier, the more of the line's other strokes is missing. Where the surface rises above the
land, or was not scanned, there is no evidence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache, cached_property, lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.belief.part_lines import PartLines, ReadLine
from recognition.language.confusions import SWAP_SETS
from recognition.language.lattice import Lattice
from recognition.lines.places import boxes_of, places_mm
from recognition.marks.centre_lines import centre_line
from recognition.marks.depth_field import DepthField, Floats, mean_depths, turn_matrix
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from whisker_array.estimation.relief import Relief

LIVE = 0.004
"""Probability of a rival from which strokes must exclude it."""
STEP_HEIGHTS = 0.05
"""Distance between points of a stroke, character heights."""
MOST_ABSENT = 6.0
"""Most evidence of all missing pieces against a character, nats: absence never excludes it fully."""
LEAST_FIT = 0.45
"""Mean score of the places that another height of the line, or ridges for grooves, must reach. The exam's lines score
at most 0.61 if made half too high."""
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class RivalStrokes:
    """Evidence from strokes against a rival at a place.

    Attributes:
        char: the rival character.
        belief: probability of the rival without the evidence of strokes.
        margin: evidence of the strokes for the character that was read, nats; negative if it supports the rival.
        apart_heights: length of the strokes that only one of the two has, character heights.
        more_heights: length of the strokes that only the rival has, character heights.
        hidden: share of `more_heights` where nothing could be felt.
    """

    char: str
    belief: float
    margin: float
    apart_heights: float
    more_heights: float
    hidden: float

    @property
    def excluded_nats(self) -> float:
        """Evidence from posterior and strokes together for the character that was read, nats."""
        return self.margin - math.log(max(self.belief, 1e-12))


@dataclass(frozen=True)
class PlaceStrokes:
    """Felt strokes of the character that was read at a place.

    Attributes:
        felt: share of its strokes that was felt, in the best-fitting font; None if no font has the character.
        score: how well its strokes match the deepest parts of the place, at most 1.
        font: name of the best-fitting font.
        rivals: characters that the format allows and that are probable, or listed as easily confused with this one.
        whole: whether the surface was felt from edge to edge of the character.
        too_few_lines: why the scan lines cannot distinguish the character from its rivals; empty if they can.
    """

    felt: float | None
    score: float = 0.0
    font: str = ""
    rivals: tuple[RivalStrokes, ...] = ()
    whole: bool = True
    too_few_lines: str = ""


@dataclass(frozen=True, eq=False)
class LaidCharacter:
    """A character over the surface of a place.

    Attributes:
        score: mean depth of its strokes, of the deepest about the place, less what its pose costs; 1 at best.
        points: (n, 2) of its strokes, (row, col) of the place's window, character heights, `STEP_HEIGHTS` apart.
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
class FeltLine:
    """A felt line in which the strokes of characters are compared with the surface.

    Attributes:
        relief: the felt surface.
        line: position of the text.
        columns: columns of the places in the line's strip.
        raised: whether the marks are raised.
        fonts: fonts whose strokes are compared.
    """

    relief: Relief
    line: TextLine
    columns: Floats
    raised: bool
    fonts: tuple[Font, ...]

    def strokes(
        self,
        text: Sequence[str],
        lattice: Lattice,
        *,
        slope: float = 1.0,
        filled: float = 0.03,
        filled_of_missing: float = 0.8,
        most_filled: float = 0.7,
    ) -> tuple[PlaceStrokes, ...]:
        """Compute the felt strokes of the characters that were read and of their rivals.

        Args:
            text: one character for each place.
            lattice: probabilities of all characters that may stand at each place.
            slope: calibration slope of the probabilities, in log odds (`recognition.decision.score`).
            filled: probability that a piece of a stroke is filled if no stroke of the line is missing.
            filled_of_missing: increase of that probability with the missing share of the line's strokes.
            most_filled: greatest such probability.
        """
        if len(text) != self.columns.size or lattice.n_places != len(text):
            return ()
        tried = [
            [(font, self.lay(k, char, font)) for font in self.fonts if char in font.glyphs]
            for k, char in enumerate(text)
        ]
        best = [max(each, key=lambda one: one[1].score, default=None) for each in tried]
        missing = [1.0 - one[1].share_felt() for one in best if one is not None]
        filled = min(filled + filled_of_missing * float(np.mean(missing or [0.0])), most_filled)
        made = []
        for k, (char, one) in enumerate(zip(text, best, strict=True)):
            if one is None:
                made.append(PlaceStrokes(None, whole=self.whole[k]))
                continue
            font, laid = one
            rivals = tuple(
                _compare(laid, self.lay(k, rival, font), rival, belief, filled)
                for rival, belief in _rivals(char, lattice.chars, lattice.log_belief[k], slope)
                if rival in font.glyphs
            )
            made.append(PlaceStrokes(laid.share_felt(), laid.score, font.name, rivals, self.whole[k]))
        return tuple(made)

    def by_font(self, text: Sequence[str]) -> dict[str, float]:
        """Return the mean score of a text over its places, for each font that has all its characters."""
        return dict(self._mean_scores(text))

    def _mean_scores(self, text: Sequence[str]) -> Iterator[tuple[str, float]]:
        for font in self.fonts if len(text) == self.columns.size else ():
            if all(c in font.glyphs for c in text):
                scores = [self.lay(k, char, font).score for k, char in enumerate(text)]
                yield font.name, float(np.mean(scores))

    def _mean_score(self, text: Sequence[str]) -> float:
        """Compute the mean score of a text in the first font with all its characters, to compare heights."""
        return next(self._mean_scores(text), ("", math.inf))[1]

    def stands_out(self, text: Sequence[str]) -> bool | None:
        """Whether the strokes of a text are ridges rather than grooves; None if no font has all its characters.

        Strokes are laid over the relief and over its negative. Ridges must reach the score of felt strokes: under dirt
        a badly read text fits neither way, and dies normally strike grooves.
        """
        ridges, grooves = (replace(self, raised=raised)._mean_score(text) for raised in (True, False))
        return ridges > max(grooves, LEAST_FIT) if math.isfinite(ridges + grooves) else None

    def fit_size(
        self,
        text: Sequence[str],
        *,
        good_fit: float = 0.6,
        least_gain: float = 0.08,
        factors: Sequence[float] = (0.66, 0.57, 0.76, 0.87),
    ) -> FeltLine:
        """Return the line at the height at which the strokes of its text fit best; its places stay where they are.

        A recogniser reads a line that was found half too high as well as any other, but its strokes miss the grooves.

        Args:
            text: one character for each place.
            good_fit: mean score of the places from which the line keeps the height at which it was found.
            least_gain: least gain in score over the height found.
            factors: factors of the height found that are tried instead; if the first brings no gain, the others are
                skipped.
        """
        best, most = self, self._mean_score(text)
        if most >= good_fit:
            return self
        least = most + least_gain
        for factor in factors:
            tried = self._at_height(factor * self.line.height_mm)
            score = tried._mean_score(text)
            if score > max(most, least):
                best, most = tried, score
            elif best is self:
                break
        return best if most >= LEAST_FIT else self

    def _at_height(self, height_mm: float) -> FeltLine:
        along = self.line.height_mm * ((self.columns + 0.5) / HEIGHT_ROWS - MARGIN)
        columns = (along / height_mm + MARGIN) * HEIGHT_ROWS - 0.5
        return replace(self, line=TextLine(self.line.centre_mm, height_mm), columns=columns)

    @cached_property
    def whole(self) -> list[bool]:
        """Whether the scan covers each place's character from edge to edge, in x and in y.

        Only the ends of the scan lines matter here, not covered or missing samples within them.
        """
        known = np.isfinite(self.relief.height_mm)
        if not known.any():
            return [False] * self.columns.size
        spans = (np.flatnonzero(known.any(axis=axis))[[0, -1]] for axis in (0, 1))
        low, high = np.array(self.relief.origin_mm) + self.relief.pitch_mm * np.array([*spans]).T
        # a box's outermost strip may be land: at a line's ends it is 0.84 heights wide, characters 0.5 to 0.7
        spare = 0.15 * self.line.height_mm
        return [
            bool(np.all(low <= np.add(box[:2], spare)) and np.all(np.subtract(box[2:], spare) <= high))
            for box in (astuple(one) for one in boxes_of(self.line, self.columns))
        ]

    def depth_mm(self) -> float:
        """Depth of the line's marks: the median of the deepest samples about its places."""
        return float(np.median([window.deep for window in self._windows]))

    @cached_property
    def _windows(self) -> list[_Window]:
        """The surface about each place."""
        return _windows(DepthField(self.relief, raised=self.raised), self.line, self.columns)

    def lay(
        self,
        place: int,
        char: str,
        font: Font,
        *,
        shift_heights: float = 0.16,
        shift_cost: float = 0.2,
        felt_share: float = 0.4,
        felt_noise: float = 3.0,
    ) -> LaidCharacter:
        """Lay a character where it lies deepest about a place, turned and sized a little.

        Args:
            place: from 0.
            char: the character.
            font: whose strokes.
            shift_heights: greatest shift down and to the right, either way, character heights.
            shift_cost: cost of a shift by a character height along either axis, share of the depth of the place.
            felt_share: share of the character's usual depth from which a stroke is felt.
            felt_noise: multiple of the land's spread that a felt stroke must reach as well.
        """
        window, shape = self._windows[place], _pieces(font, char)
        if not len(shape):
            none = np.zeros(0, dtype=np.bool_)
            return LaidCharacter(-1.0, np.zeros((0, 2)), none, none, none)
        reach = len(window.depth) // 2
        middle = np.full(2, float(reach))
        matrices, costs = _poses()
        poses = (shape @ matrices @ window.turn)[:, :, ::-1] * window.height_px
        moves = np.linspace(-shift_heights, shift_heights, 5) * window.height_px
        # every third point tells the pose
        table = mean_depths(window.depth, poses[:, ::3], middle, moves) / window.deep
        far = shift_cost * np.abs(moves) / window.height_px
        table -= costs[:, None, None] + far[:, None] + far
        best, i, j = np.unravel_index(int(np.argmax(table)), table.shape)
        points = poses[int(best)] + middle + (moves[i], moves[j])
        row, col = np.clip(np.rint(points).astype(np.intp), 0, 2 * reach).T
        deepest = window.near[row, col]
        felt = deepest > felt_share * window.deep
        usual = float(np.median(deepest[felt])) if felt.any() else window.deep
        return LaidCharacter(
            float(table[best, i, j]),
            points / window.height_px,
            deepest > max(felt_share * usual, felt_noise * window.noise),
            window.open[row, col],
            window.own[row, col],
        )


@dataclass(frozen=True, eq=False)
class _Window:
    """The surface about a place: its own depths, up to `deep`, and 0 where the neighbours begin."""

    height_px: float
    noise: float
    deep: float
    turn: Floats
    depth: Floats
    near: Floats
    open: Bools
    own: Bools


def _windows(
    field: DepthField,
    line: TextLine,
    columns: Floats,
    *,
    beside_heights: float = 0.07,
    window_heights: float = 0.9,
    cell_heights: float = 0.6,
    heap_share: float = 0.5,
) -> list[_Window]:
    """Cut out the surface about the places of a line, over its land.

    Args:
        field: as felt.
        line: position of the text.
        columns: (places,) of the line's strip.
        beside_heights: search radius for the groove about a point of a stroke, character heights.
        window_heights: half the size of the window about the middle of a place, character heights.
        cell_heights: greatest distance along the line from the middle of a place that belongs to it, character heights.
        heap_share: height above the land, as a share of the place's depth, from which dirt covers what is below.
    """
    from scipy import ndimage

    height = line.height_mm / field.pitch_mm
    known = np.isfinite(field.depth_mm)
    depth = np.where(known, field.depth_mm, 0.0)
    depth -= _land(depth, height)
    blurred = ndimage.uniform_filter(depth, 3)
    # the least of the land's magnitudes, 30 %, are surely land; of normal noise they lie within 0.385 deviations
    noise = float(np.percentile(np.abs(blurred[known]), 30.0)) / 0.385 if known.any() else 0.0
    wide = max(3, round(2 * beside_heights * height) | 1)
    nearest, mean = ndimage.maximum_filter(blurred, wide), ndimage.uniform_filter(depth, wide)
    # beyond the map lies land, of which nothing is known
    maps = [np.pad(one, 1) for one in (depth, nearest, mean, known)]
    at = places_mm(line, columns)
    ahead = places_mm(line, columns + 1.0) - at
    middles = field.samples(at)
    reach = max(2, round(window_heights * height))
    around = np.arange(-reach, reach + 1)
    half_way = 0.5 * np.linalg.norm(np.diff(middles, axis=0), axis=1)
    ends = np.minimum(np.r_[np.inf, half_way, np.inf], cell_heights * height)
    windows = []
    for middle, (right, down), before, after in zip(middles, ahead, ends, ends[1:], strict=False):
        turn = turn_matrix(math.degrees(math.atan2(down, right)))
        place = np.rint(middle).astype(np.intp)[:, None] + 1 + around
        cell = np.ix_(*np.clip(place, 0, np.array(maps[0].shape)[:, None] - 1))
        below, near, level, felt = (one[cell] for one in maps)
        along = around * turn[0, 0] + around[:, None] * turn[0, 1]
        own = (along > -before) & (along < after)
        deep = max(float(np.percentile(below[own], 95.0)), 1e-9)
        open_ = felt & (level > -heap_share * deep)
        shown = np.minimum(np.where(own, below, 0.0), deep)
        windows.append(_Window(height, noise, deep, turn, shown, near, open_, own))
    return windows


def _land(depth: Floats, height_px: float, *, wide_heights: float = 1.2, steps: int = 6) -> Floats:
    """Level of the land: the median about each place, of a map thinned to so many steps to a character height."""
    from scipy import ndimage

    from glyphs.opencv import cv2

    every = max(1, int(height_px / steps))
    level = ndimage.median_filter(depth[::every, ::every], size=int(wide_heights * height_px / every) | 1)
    return np.asarray(cv2.resize(level, depth.shape[::-1], interpolation=cv2.INTER_LINEAR))


@cache
def _poses(
    *,
    turns_deg: Sequence[float] = (-14.0, -7.0, 0.0, 7.0, 14.0),
    widths: Sequence[float] = (0.78, 0.9, 1.0, 1.12, 1.28),
    heights: Sequence[float] = (0.95, 1.05),
    turn_cost: float = 0.006,
    width_cost: float = 0.2,
    height_cost: float = 0.4,
) -> tuple[Floats, Floats]:
    """Poses in which a character is tried: (poses, 2, 2) that turn and size row vectors (right, down), and their costs.

    Blows turn a character, and so does an arc that was taken for a line; fonts are wider or narrower than the one laid;
    the height of a line is found to 5 percent. Costs are shares of the depth of the place, of a degree and of a unit of
    the logarithms of width and height: so much depth a pose must gain.
    """
    tried = [*product(turns_deg, widths, heights)]
    matrices = np.stack([np.diag((wide, tall)) @ turn_matrix(turn) for turn, wide, tall in tried])
    logs = [(turn, math.log(wide), math.log(tall)) for turn, wide, tall in tried]
    return matrices, np.abs(logs) @ (turn_cost, width_cost, height_cost)


@lru_cache(maxsize=1024)
def _pieces(font: Font, char: str) -> Floats:
    """(n, 2) points along a character's strokes, one to a square of a step: a double stroke counts once."""
    points = centre_line(font, char).points
    _, first = np.unique(np.floor(points / STEP_HEIGHTS), axis=0, return_index=True)
    return points[np.sort(first)]


def _rivals(char: str, chars: Sequence[str], log_belief: Floats, slope: float) -> list[tuple[str, float]]:
    """List the probable rivals, and the declared ones that the format allows, with their calibrated probabilities."""
    total = np.logaddexp.reduce(log_belief)
    power = slope * (log_belief - total)
    beliefs = np.exp(power - np.logaddexp.reduce(power) + total)
    declared = {c for chars in SWAP_SETS if char in chars for c in chars}
    return [
        (c, float(b))
        for c, b in zip(chars, beliefs, strict=True)
        if c != char and (b >= LIVE or (c in declared and b > 0.0))
    ]


def _compare(
    read: LaidCharacter,
    rival: LaidCharacter,
    char: str,
    belief: float,
    filled: float,
    *,
    alike_heights: float = 0.13,
    piece_heights: float = 0.25,
    falsely_felt: float = 0.05,
) -> RivalStrokes:
    """Weigh the strokes of the character that was read against a rival's.

    Args:
        read: the character that was read, laid over its place.
        rival: the other one, laid over the same place.
        char: what that is.
        belief: probability of the rival.
        filled: probability that a piece of a stroke is filled.
        alike_heights: distance between strokes of two characters below which they are the same stroke.
        piece_heights: length of the pieces of a stroke that are felt or filled independently, character heights.
        falsely_felt: probability that a piece seems to be felt where there is none: a scratch, or other strokes in the
            part's font.
    """
    far = np.linalg.norm(read.points[:, None] - rival.points, axis=2)
    own, theirs = (
        one.within & (far.min(axis=axis, initial=np.inf) > alike_heights)
        for axis, one in ((1, read), (0, rival))
    )
    felt, absent = -math.log(falsely_felt), -math.log(filled)

    def pieces(laid: LaidCharacter, only: Bools, *, felt: bool) -> float:
        return STEP_HEIGHTS / piece_heights * float((only & laid.open & (laid.felt == felt)).sum())

    margin = felt * (pieces(read, own, felt=True) - pieces(rival, theirs, felt=True))
    margin += min(absent * pieces(rival, theirs, felt=False), MOST_ABSENT)
    margin -= min(absent * pieces(read, own, felt=False), MOST_ABSENT)
    return RivalStrokes(
        char=char,
        belief=belief,
        margin=margin,
        apart_heights=float(own.sum() + theirs.sum()) * STEP_HEIGHTS,
        more_heights=float(theirs.sum()) * STEP_HEIGHTS,
        hidden=float((theirs & ~rival.open).sum() / max(theirs.sum(), 1)),
    )


def felt_others(
    part: PartLines, main: FeltLine, *, least_depth: float = 0.25, least_felt: float = 0.5
) -> PartLines:
    """Drop unassigned lines that were not felt as marks are: dirt beside the serial is read as text now and then.

    Text is struck about as deep as the serial is, and its characters' strokes lie in what is deep there.

    Args:
        part: its lines.
        main: the serial's as it was felt.
        least_depth: share of the serial's depth. Of 36 second lines of the exam, at any dirt, the shallowest had 0.46
            of it.
        least_felt: share of strokes felt, mean of the characters: those lines had 0.8 at least.
    """

    def is_felt(one: ReadLine) -> bool:
        lattice, columns = one.belief.open_places
        line = replace(main, line=one.line, columns=columns)
        felt = [place.felt for place in line.strokes(lattice.text, lattice) if place.felt is not None]
        deep = line.depth_mm() >= least_depth * main.depth_mm()
        return deep and (not felt or float(np.mean(felt)) >= least_felt)

    return replace(part, others=tuple(filter(is_felt, part.others)))
