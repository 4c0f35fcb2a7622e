"""The search: which font, height, polarity and row make a line of characters out of an edge map, and which one.

Templates are predicted once near the height; hypotheses differ in how the image is sampled, 16 pixels to the
supposed height, so that template spectra are shared by all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.stamping.die import Face
from glyphs.surface.maps import EdgeMap
from recognition.decode import Placed, best_chain
from recognition.frames import LineImage, line_image, padded, resampled, turned
from recognition.match import SEARCH_PIXELS, dense_scores
from recognition.template_scores import TemplateScores, depth_share
from recognition.templates import TemplateCache, TemplateSet, stretched, template_key
from whisker_array.whisker.touch import Touch

SCORE_FLOOR = 0.5
"""Correlation that earns nothing: what a wrong character typically reaches."""
CHARACTER_COST = 0.03
"""Height-widths a character must explain before it earns: a stroke of a neighbour taken for an I does not."""
CRISP_HANDS = ((Face.FLAT, -0.035), (Face.FLAT, 0.03), (Face.SHARP, 0.0))
SOFT_HANDS = ((0.03, 0.02), (0.05, 0.03), (0.03, 0.05), (0.05, 0.06))
"""Softening and growth tried on marks that the font's own stroke does not fit, character heights: first other
strokes of a stamping die, then cast, coined or worn marks."""
FREE_WIDTHS = (0.84, 1.18)
"""Widths tried for every character by itself when the font is not the mark's own."""
MARGIN_PIXELS = 3
"""Land assumed around the map, so that a window may lean over its rim."""
ROW_REACH = 2
"""Rows, of 16 to the height, by which characters may leave the common line."""
NEAR_ROWS = 7
"""Rows to either side of where a line was found that are looked at again when its hypothesis is varied."""


@dataclass(frozen=True)
class Hypothesis:
    """One way the line may lie."""

    font: Font
    height_mm: float
    x_scale: float
    rotation_deg: float
    grow: float = 0.0
    soften: float = 0.0
    free_widths: bool = False
    face: Face = Face.FLAT


@dataclass(frozen=True, eq=False)
class LineFit:
    """What a hypothesis explains.

    Attributes:
        hypothesis: font, height, widening, rotation.
        raised: polarity that explained more.
        value_mm: length of line explained, weighted by how well; 0 when nothing is.
        placed: characters, left to right, by template index and column of the search image.
        rows: row of each character in the search image.
        scores: correlation of each character.
        image: the search image.
        templates: the set whose templates were placed.
    """

    hypothesis: Hypothesis
    raised: bool
    value_mm: float
    placed: tuple[Placed, ...]
    rows: tuple[int, ...]
    scores: tuple[float, ...]
    image: LineImage
    templates: TemplateSet

    @property
    def text(self) -> str:
        """Characters as the search has them."""
        return "".join(self.templates.chars[p.template] for p in self.placed)

    @property
    def mean_score(self) -> float:
        """Mean correlation of the characters, 0 without any."""
        return float(np.mean(self.scores)) if self.scores else 0.0

    def middle_v_mm(self) -> float | None:
        """Where the line lies across, line frame; None without characters."""
        if not self.rows:
            return None
        return self.image.origin_mm[1] + float(np.median(self.rows)) * self.image.pitch_v_mm

    def slope_deg(self) -> float:
        """Rotation of the line that is left, from the rows of its characters."""
        if len(self.placed) < 3:
            return 0.0
        columns = np.array([p.column for p in self.placed], dtype=np.float64)
        slope = np.polyfit(columns - columns.mean(), np.array(self.rows, dtype=np.float64), 1)[0]
        return math.degrees(math.atan(slope * self.image.pitch_v_mm / self.image.pitch_u_mm))


class LineSearch:
    """Fits hypotheses to one edge map; holds the line-frame images that they share."""

    def __init__(
        self, edges: EdgeMap, touch: Touch, cache: TemplateCache, *, chars: str, places: Sequence[str] | None
    ) -> None:
        """Prepare.

        Args:
            edges: the map to be read.
            touch: how it was felt.
            cache: of template sets.
            chars: characters that may occur.
            places: characters allowed at each place of a known format, or None.
        """
        self.edges, self.touch, self.cache = edges, touch, cache
        self.chars, self.places = chars, places
        self._images: dict[float, LineImage] = {}

    def image(self, rotation_deg: float) -> LineImage:
        """The channels in the frame of a line so rotated."""
        key = round(rotation_deg, 2)
        if key not in self._images:
            self._images[key] = (
                turned(self.image(0.0), rotation_deg=key) if key else line_image(self.edges, rotation_deg=0.0)
            )
        return self._images[key]

    def templates(self, hypothesis: Hypothesis, *, raised: bool) -> TemplateSet:
        """The templates of a hypothesis, felt as the scan was."""
        key = template_key(
            hypothesis.font,
            self.touch,
            self.edges.directions,
            height_mm=hypothesis.height_mm,
            rotation_deg=hypothesis.rotation_deg,
            raised=raised,
            grow=hypothesis.grow,
            soften=hypothesis.soften,
            face=hypothesis.face,
        )
        available = "".join(c for c in self.chars if c in hypothesis.font.glyphs)
        found = self.cache.get(hypothesis.font, available, key)
        return stretched(found, FREE_WIDTHS) if hypothesis.free_widths else found

    def fit(
        self, hypothesis: Hypothesis, *, raised: bool | None = None, near_v_mm: float | None = None
    ) -> LineFit:
        """The best chain of characters under a hypothesis, of either polarity unless it is known.

        Args:
            hypothesis: how the line may lie.
            raised: polarity, if known.
            near_v_mm: where across the line a fit of nearly the same hypothesis lay: rows far from it are not
                looked at, unless the line moves off.
        """
        base = self.image(hypothesis.rotation_deg)
        pixel = hypothesis.height_mm / SEARCH_PIXELS
        image = padded(
            resampled(base, pitch_u_mm=pixel * hypothesis.x_scale, pitch_v_mm=pixel), MARGIN_PIXELS
        )
        # while the polarity is open, sunk templates serve both: a raised mark answers with about the opposite sign
        templates = self.templates(hypothesis, raised=bool(raised))
        rows = _rows_near(image, near_v_mm)
        dense = dense_scores(image, templates, self.edges.directions, rows=rows)
        width = 2.0 * templates.half_width + 0.1
        half = np.maximum(1, np.round(templates.half_width * SEARCH_PIXELS)).astype(np.int64)
        allowed = self._allowed(templates)
        share = depth_share(dense)
        best: LineFit | None = None
        for polarity in (False, True) if raised is None else (raised,):
            negative = polarity and raised is None
            template_scores = TemplateScores(
                dense, share, width, negative=negative, score_floor=SCORE_FLOOR, cost=CHARACTER_COST
            )
            row = _best_row(template_scores.promises())
            if rows is not None and not rows[0] + 2 * ROW_REACH <= row < rows[1] - 2 * ROW_REACH:
                return self.fit(hypothesis, raised=raised)
            total, placed, at_rows = _best_placed(template_scores, row, image, half, allowed)
            length = total * hypothesis.height_mm * hypothesis.x_scale
            if best is None or length > best.value_mm:
                scores = [
                    float(dense.score[p.template, r, p.column]) for p, r in zip(placed, at_rows, strict=True)
                ]
                at = tuple(-s if negative else s for s in scores)
                best = LineFit(hypothesis, polarity, length, placed, at_rows, at, image, templates)
        assert best is not None
        return best

    def _allowed(self, templates: TemplateSet) -> NDArray[np.bool_] | None:
        if self.places is None:
            return None
        return np.array([[c in place for c in templates.chars] for place in self.places], dtype=np.bool_)


def _rows_near(image: LineImage, v_mm: float | None) -> tuple[int, int] | None:
    """First and last plus one of the rows about a line; None for all."""
    if v_mm is None:
        return None
    row = round((v_mm - image.origin_mm[1]) / image.pitch_v_mm)
    return max(0, row - NEAR_ROWS), min(image.channels.shape[1], row + NEAR_ROWS + 1)


def _best_row(promise: NDArray[np.float64]) -> int:
    """The row whose neighbourhood promises most."""
    return int(np.argmax(np.convolve(promise, np.ones(2 * ROW_REACH + 1), mode="same")))


def _best_placed(
    template_scores: TemplateScores,
    row: int,
    image: LineImage,
    half: NDArray[np.int64],
    allowed: NDArray[np.bool_] | None,
) -> tuple[float, tuple[Placed, ...], tuple[int, ...]]:
    """What the best chain about a row earns, the chain and the row of each of its characters."""
    low, high = max(0, row - ROW_REACH), min(image.channels.shape[1], row + ROW_REACH + 1)
    near = template_scores.near(low, high)
    total, placed = best_chain(
        near.max(axis=1),
        half,
        allowed=allowed,
        overlap=1,
        reach=int(1.5 * SEARCH_PIXELS),
        gap_free=SEARCH_PIXELS // 2,
        gap_cost=0.01,
    )
    at = tuple(low + int(np.argmax(near[p.template, :, p.column])) for p in placed)
    return total, placed, at


def refine_geometry(search: LineSearch, start: LineFit, *, spans: Sequence[float]) -> LineFit:
    """Vary height by shrinking steps, and take up the rotation that is left, while the fit improves."""
    # the polarity is settled now: marks that stand out get templates of their own
    best = start
    if start.raised:
        best = search.fit(start.hypothesis, raised=True, near_v_mm=start.middle_v_mm())
    slope = best.slope_deg()
    if abs(slope) > 0.25:
        best = _better(search, best, rotation_deg=best.hypothesis.rotation_deg + slope)
    for span in spans:
        for factor in (1.0 + span, 1.0 / (1.0 + span)):
            tried = _better(search, best, height_mm=best.hypothesis.height_mm * factor)
            if tried is not best:
                best = tried
                break
    return best


def refine_stroke(search: LineSearch, start: LineFit) -> LineFit:
    """Vary the stroke against the font's: other faces of a die, struck deeper or less deep."""
    best = start
    for face, grow in CRISP_HANDS:
        best = _better(search, best, face=face, grow=grow)
    return best


def refine_shape(search: LineSearch, start: LineFit, *, x_scales: Sequence[float]) -> LineFit:
    """Vary softness, boldness and width of the characters: marks of a hand or a font we have not got."""
    best = start
    for soften, grow in SOFT_HANDS:
        best = _better(search, best, soften=soften, grow=grow)
    for scale in x_scales:
        best = _better(search, best, x_scale=scale)
    return _better(search, best, free_widths=True)


def _better(search: LineSearch, held: LineFit, **changes: Any) -> LineFit:
    """The fit of the changed hypothesis if it explains more, else the one held."""
    hypothesis = replace(held.hypothesis, **changes)
    turned = hypothesis.rotation_deg != held.hypothesis.rotation_deg
    fit = search.fit(hypothesis, raised=held.raised, near_v_mm=None if turned else held.middle_v_mm())
    return fit if fit.value_mm > held.value_mm else held
