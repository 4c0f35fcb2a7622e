"""Felt strokes of characters: evidence for the character that was read and against its rivals.

    R was read      P is its rival      strokes            if felt      if missing
      .--.            .--.              only in R: \\       against P    for P
      |__|            |__|              only in P: none    -            -
      |  \\           |

Both characters are laid over the surface where each fits best::

    depths along the line --laid by least squares--> points along the strokes: felt, or not
                                                                               open (could be felt), or not

A felt piece of a stroke supports the characters that contain it, in any font. A missing piece counts against them, but
never fully: it may be filled with dirt, the likelier the more of the line's other strokes is missing. Where the surface
rises above the land, or was not scanned, there is no evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.fonts.glyph import Font
from recognition.find.part_lines import PartLines
from recognition.glyph_match.felt_line import POSE_SD_REFINED, DepthStrip, FeltLine
from recognition.glyph_match.pose import DEEP, PIXELS, Floats, points_at
from recognition.language.confusions import SWAP_SETS
from recognition.language.lattice import Lattice
from recognition.marks.centre_lines import centre_line
from recognition.marks.laid_text import LaidText, laid_text
from recognition.recogniser.read_line import ReadLine

LIVE = 0.004
"""Minimum probability of a rival that strokes must exclude."""
STEP_HEIGHTS = 0.05
"""Distance between points of a stroke, character heights."""
MOST_ABSENT = 6.0
"""Maximum evidence of all missing pieces against a character, nats: they never exclude it fully."""
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class RivalStrokes:
    """Evidence from strokes against a rival at a place, nats; `more_heights` is the length that only the rival has."""

    char: str
    belief: float
    margin: float
    apart_heights: float
    more_heights: float
    hidden: float

    @property
    def excluded_nats(self) -> float:
        return self.margin - math.log(max(self.belief, 1e-12))


@dataclass(frozen=True)
class PlaceStrokes:
    """Felt strokes of the character that was read at a place, and those of its rivals; `felt` is a share of the strokes
    that are not `covered`: above those the surface rises over the land."""

    felt: float | None
    score: float = 0.0
    rivals: tuple[RivalStrokes, ...] = ()
    covered: float = 0.0


@dataclass(frozen=True, eq=False)
class _Strokes:
    points: Floats
    felt: Bools
    open: Bools
    within: Bools

    def share_felt(self) -> float:
        return float((self.felt & self.open).sum() / max(self.open.sum(), 1))

    def share_covered(self) -> float:
        return 1.0 - float(self.open.mean()) if self.open.size else 0.0


class StrokeSurface:
    """The depths along a line, prepared to find strokes in them."""

    def __init__(
        self,
        strip: DepthStrip,
        *,
        near_heights: float = 0.06,
        beside_heights: float = 0.07,
        heap_share: float = 0.5,
    ) -> None:
        self.strip = strip
        near, beside = (2 * round(far * PIXELS) + 1 for far in (near_heights, beside_heights))
        self._near = near
        self.open = strip.known & (ndimage.uniform_filter(strip.depth, beside) > -heap_share * strip.usual)

    @cached_property
    def _smooth(self) -> Floats:
        return np.asarray(ndimage.gaussian_filter(self.strip.depth, 0.7))

    @cached_property
    def deepest(self) -> Floats:
        """(rows, columns) greatest depth within the search radius."""
        return np.asarray(ndimage.maximum_filter(self._smooth, self._near))

    @cached_property
    def noise(self) -> float:
        # the smallest 30 % of the magnitudes are certainly land; with normal noise they lie within 0.385 deviations
        known = np.abs(self._smooth[self.strip.known])
        return float(np.percentile(known, 30.0)) / 0.385 if known.size else 0.0

    @cached_property
    def is_open(self) -> bool:
        """Whether strokes could be felt everywhere at all places, so that none of any character is hidden."""
        columns, width = self.strip.columns, self.open.shape[1]
        low, high = np.rint(columns + PIXELS * self.strip.reaches.T * [[-1], [1]]).astype(np.intp)
        return all(
            first >= 0 and last < width and bool(self.open[:, first : last + 1].all())
            for first, last in zip(low, high, strict=True)
        )

    def strokes(
        self,
        place: int,
        char: str,
        font: Font,
        pose: Floats,
        *,
        felt_share: float = 0.4,
        felt_noise: float = 3.0,
        least_deep: float = 0.35,
    ) -> _Strokes:
        """The strokes of a character in a pose; a felt one also reaches `felt_noise` times the land's spread."""
        points = points_at(pose, _pieces(font, char))
        middle = np.array([self.strip.columns[place], self.strip.known.shape[0] // 2])
        column, row = np.rint(middle + points * PIXELS).astype(np.intp).T
        shape = np.array(self.strip.known.shape)
        inside = (row >= 0) & (column >= 0) & (row < shape[0]) & (column < shape[1])
        row, column = (np.clip(index, 0, n - 1) for index, n in zip((row, column), shape, strict=True))
        usual = max(math.exp(pose[DEEP]), least_deep) * self.strip.usual
        felt = self.deepest[row, column] > max(felt_share * usual, felt_noise * self.noise)
        left, right = self.strip.reaches[place]
        within = (points[:, 0] > -left) & (points[:, 0] < right)
        return _Strokes(points, felt, self.open[row, column] & inside, within)


def strokes_of(
    laid: LaidText,
    lattice: Lattice,
    *,
    slope: float = 1.0,
    surface: StrokeSurface | None = None,
    filled: float = 0.03,
    filled_of_missing: float = 0.8,
    most_filled: float = 0.7,
) -> tuple[PlaceStrokes, ...]:
    """Compute the felt strokes of a text's characters and their rivals; empty if text and lattice differ."""
    felt, font = laid.felt, laid.font
    if lattice.n_places != len(laid.text):
        return ()
    surface = StrokeSurface(felt.strip) if surface is None else surface
    read = [
        None if character is None else surface.strokes(k, char, font, character.pose)
        for k, (char, character) in enumerate(zip(laid.text, laid.laid, strict=True))
    ]
    missing = [1.0 - character.share_felt() for character in read if character is not None]
    filled = min(filled + filled_of_missing * float(np.mean(missing or [0.0])), most_filled)
    strokes = []
    for k, (char, character, of_char) in enumerate(zip(laid.text, laid.laid, read, strict=True)):
        if character is None or of_char is None:
            strokes.append(PlaceStrokes(None))
            continue
        rivals = []
        for rival, belief in _rivals(char, lattice.chars, lattice.log_belief[k], slope):
            if rival in font.glyphs:
                pose = felt.lay(k, rival, font, laid.face, about=character.pose, spread=POSE_SD_REFINED).pose
                rivals.append(_compare(of_char, surface.strokes(k, rival, font, pose), rival, belief, filled))
        strokes.append(
            PlaceStrokes(of_char.share_felt(), character.fit, tuple(rivals), of_char.share_covered())
        )
    return tuple(strokes)


@lru_cache(maxsize=1024)
def _pieces(font: Font, char: str) -> Floats:
    points = centre_line(font, char).points
    _, first = np.unique(np.floor(points / STEP_HEIGHTS), axis=0, return_index=True)
    return points[np.sort(first)]


def _rivals(char: str, chars: Sequence[str], log_belief: Floats, slope: float) -> list[tuple[str, float]]:
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
    read: _Strokes,
    rival: _Strokes,
    char: str,
    belief: float,
    filled: float,
    *,
    alike_heights: float = 0.13,
    piece_heights: float = 0.25,
    # probability that a piece seems to be felt where there is none: a scratch, or other strokes in the part's
    # font
    falsely_felt: float = 0.05,
) -> RivalStrokes:
    far = np.linalg.norm(read.points[:, None] - rival.points, axis=2)
    only_read, theirs = (
        strokes.within & (far.min(axis=axis, initial=np.inf) > alike_heights)
        for axis, strokes in ((1, read), (0, rival))
    )
    felt, absent = -math.log(falsely_felt), -math.log(filled)

    def pieces(laid: _Strokes, only: Bools, *, felt: bool) -> float:
        return STEP_HEIGHTS / piece_heights * float((only & laid.open & (laid.felt == felt)).sum())

    margin = felt * (pieces(read, only_read, felt=True) - pieces(rival, theirs, felt=True))
    margin += min(absent * pieces(rival, theirs, felt=False), MOST_ABSENT)
    margin -= min(absent * pieces(read, only_read, felt=False), MOST_ABSENT)
    return RivalStrokes(
        char=char,
        belief=belief,
        margin=margin,
        apart_heights=float(only_read.sum() + theirs.sum()) * STEP_HEIGHTS,
        more_heights=float(theirs.sum()) * STEP_HEIGHTS,
        hidden=float((theirs & ~rival.open).sum() / max(theirs.sum(), 1)),
    )


def reject_false_lines(
    part: PartLines,
    main: FeltLine,
    fonts: Sequence[Font],
    *,
    # minimum depth, as a share of the serial's. Of 36 second lines of the exam, at any dirt, the shallowest had 0.46.
    least_depth: float = 0.25,
    # minimum share of the strokes that was felt, mean of the characters: those lines had at least 0.8
    least_felt: float = 0.5,
) -> PartLines:
    """Drop unassigned lines that do not feel like marks: dirt beside the serial is sometimes read as text."""

    def is_felt(read: ReadLine) -> bool:
        lattice, columns = read.open_places
        line = replace(main, line=read.line, columns=columns)
        if line.depth_mm < least_depth * main.depth_mm:
            return False
        laid = laid_text(line, lattice.text, fonts)
        felt = (
            []
            if laid is None
            else [place.felt for place in strokes_of(laid, lattice) if place.felt is not None]
        )
        return not felt or float(np.mean(felt)) >= least_felt

    return replace(part, others=tuple(filter(is_felt, part.others)))
