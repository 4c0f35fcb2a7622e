"""A felt line, and the pose of each character on it, for strokes, depths and grades; the font need not be known.

relief --minus the land--> depths along the line --correlation--> side, height, font; where each fit starts
                                                --least squares, place by place--> poses
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face
from recognition.glyph_match.correlation import Image, correlate
from recognition.glyph_match.depth_glyphs import depth_glyph, depth_template
from recognition.glyph_match.pose import (
    DOWN,
    NUMBERS,
    PIXELS,
    RIGHT,
    TALL,
    Floats,
    PlaceSamples,
    spread_of_poses,
)
from recognition.see.places import boxes_of
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine
from recognition.see.view import HEIGHTS, KNOWN, View

BESIDE_HEIGHTS = 1.2
"""Margin of land in a strip before and after its line, character heights."""
POSE_SD_AT_LINE = spread_of_poses(right=0.12, down=0.10, turn_deg=4.5, wide=0.12, tall=0.12, deep=0.6)
"""Expected spread of poses around the places of a found line."""
POSE_SD_REFINED = spread_of_poses(right=0.06, down=0.05, turn_deg=3.5, deep=0.45)
"""Expected spread about a pose known from the line or another character: blows differ."""
ZERO_POSE = np.zeros(NUMBERS)
"""Expected pose of a character at its place."""
LEAST_FIT = 0.45
"""Least mean correlation of a text for another height of the line, or for ridges instead of grooves."""
LEAST_SAMPLES = 50
"""Least number of samples of a place for fitting a character."""
_BEYOND = 2 * PIXELS
"""Land beyond the edges of a strip, pixels: half of the greatest window."""


@dataclass(frozen=True, eq=False)
class DepthStrip:
    """The depths felt along a line, PIXELS per character height."""

    # (rows, columns) depth below the surrounding land, in units of noise; the middle one of the odd number of
    # rows is that of the line
    depth: Floats
    known: NDArray[np.bool_]
    usual: float
    noise: float  # unit of the depths, character heights
    columns: Floats

    @cached_property
    def _image(self) -> Image:
        shown = np.clip(self.depth / self.usual, -0.5, 1.3) * self.known
        return np.pad(shown[..., None].astype(np.float32), ((_BEYOND,) * 2, (_BEYOND,) * 2, (0, 0)))

    def window(self, middle: NDArray[np.intp], up: int, side: int) -> Image:
        """(2 up + 1, 2 side + 1, 1) window of the relative depths about a pixel: row, column."""
        row, column = np.clip(middle, 0, np.array(self.known.shape) - 1) + _BEYOND
        return self._image[row - up : row + up + 1, column - side : column + side + 1]

    def samples(self, place: int, *, tall_heights: float = 0.72) -> PlaceSamples:
        """Every second sample about a place, up to its neighbours: adjacent samples are alike."""
        left, right = self.reaches[place]
        column = self.columns[place]
        columns = np.arange(
            max(round(column - PIXELS * left), 0),
            min(round(column + PIXELS * right) + 1, self.known.shape[1]),
        )
        tall = round(tall_heights * PIXELS)
        rows = np.arange(-tall, tall + 1)
        cell = np.ix_(rows + self.known.shape[0] // 2, columns)
        used = self.known[cell] & ((rows[:, None] + columns) % 2 == 0)
        across, down = np.meshgrid((columns - column) / PIXELS, rows / PIXELS)
        return PlaceSamples(across[used], down[used], self.depth[cell][used], self.usual)

    @cached_property
    def reaches(self) -> Floats:
        """(places, 2) extent of each place to the left and right, character heights."""
        gaps = np.diff(self.columns, prepend=-np.inf, append=np.inf) / PIXELS
        return np.minimum(0.5 * np.stack([gaps[:-1], gaps[1:]], axis=1) + 0.05, 0.6)


@dataclass(frozen=True, eq=False)
class LaidCharacter:
    """A character laid on a place of a felt line, in a pose (`recognition.glyph_match.pose`) about its middle."""

    pose: Floats
    log_likelihood: float = 0.0
    fit: float = 0.0


@dataclass(frozen=True, eq=False)
class FeltLine:
    """A felt line, on which characters are laid at the columns of its strip."""

    view: View
    line: TextLine
    columns: Floats
    raised: bool = False
    _laid: dict[tuple[int, str, str, Face], LaidCharacter] = field(
        init=False, repr=False, default_factory=dict
    )

    @cached_property
    def strip(self) -> DepthStrip:
        zoom = PIXELS / HEIGHT_ROWS
        rows = round(2.4 * PIXELS) | 1
        strip = self.view.strip(self.line, rows=rows / zoom, margin=BESIDE_HEIGHTS, zoom=zoom)
        columns = ((self.columns + 0.5) / HEIGHT_ROWS - MARGIN + BESIDE_HEIGHTS) * PIXELS - 0.5
        return _depth_strip(strip[HEIGHTS] if self.raised else -strip[HEIGHTS], strip[KNOWN] > 0.5, columns)

    @property
    def depth_mm(self) -> float:
        return self.strip.usual * self.strip.noise * self.line.height_mm

    def at_height(self, height_mm: float) -> FeltLine:
        """The line at another height; its places stay where they are."""
        along = self.line.height_mm * ((self.columns + 0.5) / HEIGHT_ROWS - MARGIN)
        columns = (along / height_mm + MARGIN) * HEIGHT_ROWS - 0.5
        return replace(self, line=TextLine(self.line.centre_mm, height_mm), columns=columns)

    def places_mm(self, place: int, points: Floats) -> Floats:
        """(n, 2) x, y of points at (n, 2) distances to the right and down from a place, character heights."""
        along = self.columns[place] + points[:, 0] * HEIGHT_ROWS
        return self.line.places_mm(along, 0.5 * (ROWS - 1) + points[:, 1] * HEIGHT_ROWS)

    @cached_property
    def whole(self) -> list[bool]:
        """Whether the scan's extent covers each place's character from edge to edge, in x and in y."""
        known = self.view.layers[KNOWN] > 0.5
        if not known.any():
            return [False] * self.columns.size
        spans = (np.flatnonzero(known.any(axis=axis))[[0, -1]] for axis in (0, 1))
        low, high = np.array(self.view.origin_mm) + self.view.pitch_mm * np.array([*spans]).T
        # the rim of a box may be land: at the ends of a line a box is 0.84 heights wide, a character 0.5 to 0.7
        spare = 0.15 * self.line.height_mm
        return [
            bool(np.all(low <= np.add(box[:2], spare)) and np.all(np.subtract(box[2:], spare) <= high))
            for box in (astuple(box) for box in boxes_of(self.line, self.columns))
        ]

    def mean_correlation(self, text: Sequence[str], font: Font, face: Face = Face.FLAT) -> float:
        """Mean correlation of a text's characters at their places; a character that the font lacks counts as 0."""
        fits = [self.best_shift(k, c, font, face)[0] for k, c in enumerate(text) if c in font.glyphs]
        return sum(fits) / max(len(text), 1)

    def best_shift(
        self,
        place: int,
        char: str,
        font: Font,
        face: Face,
        about: Floats = ZERO_POSE,
        *,
        shift_heights: float = 0.16,
        shift_cost: float = 3.0,
    ) -> tuple[float, Floats]:
        """Correlation of a character about a place, and the pose in which it correlates best."""
        template = depth_template(font, char, face, round(math.exp(about[TALL]), 2))
        move = round(shift_heights * PIXELS)
        place_pixels = np.array([self.strip.known.shape[0] // 2, self.strip.columns[place]])
        middle = np.rint(place_pixels + PIXELS * about[[DOWN, RIGHT]]).astype(np.intp)
        window = self.strip.window(middle, *(n // 2 + move for n in template.shape[:2]))
        around = np.arange(-move, move + 1)
        cost = shift_cost * (around / PIXELS) ** 2
        fits = correlate(window, [template])[0] - cost - cost[:, None]
        best = np.unravel_index(int(fits.argmax()), fits.shape)
        start = about.copy()
        start[[DOWN, RIGHT]] = (middle + around[[*best]] - place_pixels) / PIXELS
        return float(fits[best]), start

    def lay(
        self,
        place: int,
        char: str,
        font: Font,
        face: Face = Face.FLAT,
        *,
        about: Floats | None = None,
        spread: Floats = POSE_SD_AT_LINE,
    ) -> LaidCharacter:
        key = place, char, font.name, face
        if about is None and key in self._laid:
            return self._laid[key]
        expected = ZERO_POSE if about is None else about
        samples, laid = self.strip.samples(place), LaidCharacter(expected)
        if samples.felt.size >= LEAST_SAMPLES:
            glyph = depth_glyph(font, char, face)
            start = self.best_shift(place, char, font, face, expected)[1]
            log_likelihood, pose = samples.fit(glyph, expected, spread, start)
            laid = LaidCharacter(pose, log_likelihood, samples.correlation(glyph, pose))
        if about is None:
            self._laid[key] = laid
        return laid


def _depth_strip(
    depth: NDArray[np.float32],
    known: NDArray[np.bool_],
    columns: Floats,
    *,
    land_heights: float = 1.6,
    land_steps: int = 4,
    deep_percent: float = 93.0,
    noise: tuple[float, float] = (0.12, 0.35),
) -> DepthStrip:
    from glyphs.opencv import cv2

    filled = np.where(known, depth, np.median(depth[known]) if known.any() else 0.0)
    wide = int(land_heights * PIXELS / land_steps) | 1
    land = ndimage.median_filter(filled[::land_steps, ::land_steps], size=wide)
    below = filled - cv2.resize(land, filled.shape[::-1], interpolation=cv2.INTER_LINEAR)
    middle, tall = depth.shape[0] // 2, round(0.55 * PIXELS)
    first, end = int(columns[0] - 0.4 * PIXELS), int(columns[-1] + 0.4 * PIXELS)
    inside_line = np.s_[middle - tall : middle + tall + 1, max(first, 0) : max(end, 0)]
    inside = below[inside_line][known[inside_line]]
    inside = inside if inside.size else np.zeros(1)
    deep = max(float(np.percentile(inside, deep_percent)), 1e-4)
    scatter = 1.4826 * float(np.median(np.abs(inside - np.median(inside))))
    unit = float(np.clip(scatter, noise[0] * deep, noise[1] * deep))
    return DepthStrip(np.asarray(below / unit, dtype=np.float64), known, deep / unit, unit, columns)


def felt_line(
    view: View,
    line: TextLine,
    columns: Floats,
    text: Sequence[str],
    fonts: Sequence[Font],
    *,
    good_fit: float = 0.65,
    least_gain: float = 0.08,
    factors: Sequence[float] = (0.87, 0.76, 0.66, 0.57),
) -> FeltLine:
    """Find whether the marks of a line are sunk or raised, and the height at which its text fits some font best."""

    def best_correlation(candidate: FeltLine) -> float:
        return max((candidate.mean_correlation(text, font) for font in fonts), default=0.0)

    # raised marks are rare, and text that was read badly under dirt fits neither way
    sunk, raised = (FeltLine(view, line, columns, out) for out in (False, True))
    best, most = sunk, best_correlation(sunk)
    if most < good_fit and (ridges := best_correlation(raised)) > max(most, LEAST_FIT):
        best, most = raised, ridges
    # the recogniser also reads a line that was found half too high, but then the strokes miss the grooves
    as_found, least = best, most + least_gain
    for factor in factors if most < good_fit else ():
        tried = as_found.at_height(factor * line.height_mm)
        score = best_correlation(tried)
        if score > max(most, least):
            best, most = tried, score
    return best if most >= LEAST_FIT else as_found
