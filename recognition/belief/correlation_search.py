"""Lines found and read by the responses of a font's templates, and by no network.

view --at several sizes--> responses of all templates --rows where a chain explains much--> candidates
candidate --at full resolution--> chain, its rows, its spacing --every template in every cell--> Steps --> ReadLine
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face
from recognition.belief.line_belief import line_belief
from recognition.belief.line_search import LineSearch, of_other_scales, promise_of, says_much
from recognition.belief.part_lines import ReadLine, about_region
from recognition.experts.steps import Steps
from recognition.glyph_match.chain import Placed
from recognition.glyph_match.correlation import (
    GlyphImages,
    Image,
    beside,
    cell_correlations,
    chain_of,
    glyph_images,
    image_of,
    responses,
    steps_of,
)
from recognition.glyph_match.predicted import TemplateCache, template_key
from recognition.glyph_match.spacing import place_bounds
from recognition.lines.find import overlap
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import View, ViewKind
from whisker_array.whisker.touch import Touch, default_touch

COARSE_PIXELS, FINE_PIXELS = 16, 32
"""To a character height, for the search and for reading."""
SMALLEST, LARGEST, SIZE_STEP = 0.13, 0.95, 1.1
"""Character heights that are searched, as shares of the view's smaller side, and the ratio between two of them."""
SLOPES = (-0.09, -0.045, 0.0, 0.045, 0.09)
"""Slopes of a line against the view's rows, down along +x: up to 5 degrees."""
ROWS_A_SIZE, MOST_LINES = 20, 3
"""Rows of one size that are tried as lines, and lines that are read at full resolution."""
BEYOND_HEIGHTS = 1.0
"""Looked at before and after a line, character heights: a character may stand there."""
MOST_MOVED, OFF_HEIGHTS = 3, 0.06
"""Characters further off their line's row than this are looked at again along the line through them."""


@dataclass(frozen=True)
class Guise:
    """Ways in which a font may look on a part."""

    face: Face = Face.FLAT
    raised: bool = False


GUISES = (Guise(), Guise(raised=True), Guise(face=Face.DOTTED))
FIRST, FURTHER = slice(0, 3), slice(3, 9)
TRIES = ((GUISES[0], FIRST), (GUISES[0], FURTHER), *((guise, FIRST) for guise in GUISES[1:]))
"""Looks of the marks, and which of the sizes, tried one after the other until a line says much."""


@dataclass(frozen=True, kw_only=True)
class CorrelationSearch(LineSearch):
    """Finds and reads lines by templates of fonts alone.

    Attributes:
        fonts: whose templates are compared.
        cache: of template sets.
    """

    fonts: Sequence[Font]
    cache: TemplateCache

    def heights_mm(self, view: View) -> list[float]:
        """Character heights worth a scan of what a view shows, most promising first."""
        return of_other_scales(self._sizes_mm(about_region(self.region, view), self.fonts[0], GUISES[0]))

    def candidates(self, view: View) -> list[TextLine]:
        """Where lines may lie, most promising first, without a look at them."""
        return self._candidates(view, *TRIES[0])

    def lines(self, view: View) -> list[ReadLine]:
        """Lines of a view by a look each, most promising first; raised and dotted ones where sunk ones say little."""
        seen: list[ReadLine] = []
        for guise, sizes in TRIES:
            lines = self._candidates(view, guise, sizes)
            seen = sorted([*seen, *self._looks(view, lines, guise)], key=promise_of, reverse=True)
            if says_much(self.meant(view, seen)):
                break
        return seen

    def looks(self, view: View, lines: Sequence[TextLine]) -> list[ReadLine]:
        """One look at each line, most promising first."""
        seen: list[ReadLine] = []
        for guise in GUISES:
            seen = sorted([*seen, *self._looks(view, lines, guise)], key=promise_of, reverse=True)
            if says_much(seen):
                break
        return seen

    def settle(self, view: View, seen: Sequence[ReadLine]) -> ReadLine:
        """The best line: a look at one has moved it where it belongs."""
        return seen[0]

    def more_looks(
        self, view: View, line: TextLine, moves: Sequence[tuple[float, float, int]] = ()
    ) -> list[Steps]:
        """Nothing: a look has tried every place near the line."""
        return []

    def _glyphs(
        self,
        view: View,
        font: Font,
        guise: Guise,
        height_mm: float,
        *,
        pixels: int,
        touch: Touch | None = None,
    ) -> GlyphImages:
        """A font's templates at a height, felt with `touch` or, without one, with the usual touch of that height."""
        felt = touch if touch is not None else default_touch(height_mm)
        key = template_key(font, felt, height_mm=height_mm, face=guise.face, raised=guise.raised)
        templates = self.cache.get(font, "".join(c for c in self.chars if c in font.glyphs), key)
        return glyph_images(templates, pixels=pixels, slopes=view.kind is ViewKind.HEIGHTS)

    @property
    def _places(self) -> tuple[str, ...] | None:
        """Characters that the format allows at each place; None where their number is open."""
        lengths = None if self.grammar is None else self.grammar.lengths()
        if self.grammar is None or lengths is None or len(lengths) != 1:
            return None
        return self.grammar.places(next(iter(lengths)))

    @property
    def _gaps(self) -> frozenset[int]:
        return frozenset() if self.grammar is None else self.grammar.gaps

    def _fonts(self, guise: Guise) -> list[Font]:
        return [font for font in self.fonts if guise.face is not Face.DOTTED or font.stroke_ratio > 0.0]

    def _candidates(self, view: View, guise: Guise, sizes: slice) -> list[TextLine]:
        near = about_region(self.region, view)
        found = [
            one
            for font in self._fonts(guise)
            for height_mm in self._sizes_mm(near, font, guise)[sizes]
            for one in self._of_size(near, font, guise, height_mm)
        ]
        kept: list[TextLine] = []
        for _, line in sorted(found, key=lambda one: -one[0]):
            if len(kept) < MOST_LINES and not any(overlap(line, other) for other in kept):
                kept.append(line)
        return kept

    def _sizes_mm(
        self, view: View, font: Font, guise: Guise, *, sketch_pixels: int = 12, sketch_step: int = 3
    ) -> list[float]:
        """Character heights, those first at which some row of a view answers most.

        Args:
            sketch_pixels, sketch_step: where no height is known, at so many pixels every third template ranks the
                sizes.
        """
        if self.height_mm is not None:
            return [self.height_mm]
        count = math.ceil(math.log(LARGEST / SMALLEST) / math.log(SIZE_STEP)) + 1
        sizes = [LARGEST * min(view.size_mm) / SIZE_STEP**k for k in range(count)]

        def answer(height_mm: float) -> float:
            glyphs = self._glyphs(view, font, guise, height_mm, pixels=sketch_pixels).every(sketch_step)
            # along as much of the line: small characters would answer more often
            return height_mm * max(one[0] for one in _Rows(view, glyphs, height_mm).row_sums())

        return sorted(sizes, key=answer, reverse=True)

    def _of_size(
        self, view: View, font: Font, guise: Guise, height_mm: float
    ) -> list[tuple[float, TextLine]]:
        """Lines of characters of a height, and how much each explains."""
        glyphs = self._glyphs(view, font, guise, height_mm, pixels=COARSE_PIXELS)
        seen, found = _Rows(view, glyphs, height_mm), []
        for _, rows in sorted(seen.row_sums(), key=lambda one: -one[0])[:ROWS_A_SIZE]:
            total, placed = chain_of(seen.along(rows), glyphs, font, places=self._places, gaps=self._gaps)
            if placed:
                half = glyphs.half_cols
                ends = [
                    placed[k].column + side * int(half[placed[k].template]) for k, side in ((0, -1), (-1, 1))
                ]
                found.append((total, seen.line(rows, ends)))
        return found

    def _looks(self, view: View, lines: Sequence[TextLine], guise: Guise) -> list[ReadLine]:
        seen = [
            one
            for line in lines
            if self.may_run(line)
            for font in self._fonts(guise)
            if (one := self._look(view, line, font, guise)) is not None
        ]
        return sorted(seen, key=promise_of, reverse=True)

    def _look(self, view: View, line: TextLine, font: Font, guise: Guise) -> ReadLine | None:
        """A line read where it is, or where its characters show that it is."""
        glyphs = self._glyphs(view, font, guise, line.height_mm, pixels=FINE_PIXELS, touch=view.touch)
        found = self._place(view, line, font, glyphs)
        for _ in range(MOST_MOVED):
            if len(found.placed) < 2 or np.abs(found.off_heights).max() <= OFF_HEIGHTS:
                break
            again = self._place(view, found.through(), font, glyphs)
            if again.total <= found.total:
                break
            found = again
        if not found.placed:
            return None
        bounds = place_bounds(found.placed, glyphs.half_cols, found.image.shape[1], pixels=FINE_PIXELS)
        cells = np.array(
            [
                cell_correlations(found.image, glyphs, row=row, column=one.column, bounds=bound)
                for one, row, bound in zip(found.placed, found.rows, bounds, strict=True)
            ]
        )
        columns = found.columns - (BEYOND_HEIGHTS - MARGIN) * HEIGHT_ROWS
        steps = steps_of(cells, glyphs.chars, columns, chars=self.chars, rare=self.rare)
        belief = line_belief([steps], self.grammar)
        return None if belief is None else ReadLine(found.line, belief)

    def _place(
        self, view: View, line: TextLine, font: Font, glyphs: GlyphImages, *, slack_heights: float = 0.3
    ) -> _PlacedLine:
        """The best chain of characters along a line.

        Args:
            slack_heights: by which a line may lie off the row where it was found, character heights.
        """
        slack = round(slack_heights * FINE_PIXELS)
        rows = HEIGHT_ROWS * (1.0 + 4.0 * slack_heights)
        image = image_of(view, line, rows=rows, margin=BEYOND_HEIGHTS, pixels=FINE_PIXELS)
        first = len(image) // 2 - slack
        response = responses(image, glyphs, rows=slice(first, first + 2 * slack + 1))
        best = response.max(axis=1)
        total, placed = chain_of(best, glyphs, font, places=self._places, gaps=self._gaps)
        placed = beside(best, glyphs, font, placed)
        at = [first + int(response[one.template, :, one.column].argmax()) for one in placed]
        return _PlacedLine(line, image, total, placed, at)


class _Rows:
    """Template responses along the rows of a whole view, level or a little turned."""

    def __init__(self, view: View, glyphs: GlyphImages, height_mm: float) -> None:
        (width, high), (x, y) = view.size_mm, view.origin_mm
        self.pixels, self.rows = glyphs.pixels, round(high / height_mm * HEIGHT_ROWS)
        self.across = TextLine.straight(x, y + high / 2, length_mm=width, height_mm=height_mm)
        image = image_of(view, self.across, rows=self.rows, margin=0.0, pixels=self.pixels)
        response = responses(image, glyphs, rows=slice(0, len(image)))
        # a character may stand a row higher or lower
        self.near = np.maximum(response, np.maximum(np.roll(response, 1, 1), np.roll(response, -1, 1)))
        self.answers = (glyphs.half_cols[:, None, None] * np.clip(self.near, 0.0, None) ** 2).max(axis=0)
        self.columns = np.arange(image.shape[1])

    def row_sums(self) -> list[tuple[float, NDArray[np.int64]]]:
        """The sum of the best answers along each row of every slope, and the row at each column."""
        high, tried = len(self.answers), []
        for slope in SLOPES:
            lean = np.rint(slope * (self.columns - self.columns.mean())).astype(np.int64)
            rows = np.clip(np.arange(high)[:, None] + lean, 0, high - 1)
            totals = self.answers[rows, self.columns].sum(axis=1) / self.pixels**2
            tried += list(zip(totals.tolist(), rows, strict=True))
        return tried

    def along(self, rows: NDArray[np.int64]) -> Image:
        """(T, columns) answers at a row of each column."""
        return np.asarray(self.near[:, rows, self.columns])

    def line(self, rows: NDArray[np.int64], ends: Sequence[int]) -> TextLine:
        """The line along rows between two columns."""
        on = rows[np.clip(ends, 0, self.columns.size - 1)]
        u, v = (_in_strip(pixels, self.pixels) for pixels in (ends, on))
        points = self.across.places_mm(u, v, margin=0.0, of_rows=self.rows)
        return TextLine(points, self.across.height_mm)


@dataclass(frozen=True, eq=False)
class _PlacedLine:
    """Characters found along a line: what they explain, and the rows of its image at which they stand."""

    line: TextLine
    image: Image
    total: float
    placed: tuple[Placed, ...]
    rows: list[int]

    @property
    def columns(self) -> NDArray[np.float64]:
        """(places,) of the line's strip, with the margin of the image."""
        return _in_strip([one.column for one in self.placed], FINE_PIXELS)

    @property
    def off_heights(self) -> NDArray[np.float64]:
        """(places,) how far below the line each stands, character heights."""
        return (np.array(self.rows) - (len(self.image) - 1) / 2) / FINE_PIXELS

    def through(self) -> TextLine:
        """The line through the characters, the surest of them first of all."""
        sure = [max(one.reward, 1e-3) for one in self.placed]
        slope, down = np.polyfit(self.columns, self.off_heights, 1, w=sure)
        margin = BEYOND_HEIGHTS * HEIGHT_ROWS
        ends = np.array([margin, self.line.columns(margin=BEYOND_HEIGHTS) - margin]) - 0.5
        height = len(self.image) * HEIGHT_ROWS / FINE_PIXELS
        rows = (slope * ends + down) * HEIGHT_ROWS + height / 2 - 0.5
        points = self.line.places_mm(ends, rows, margin=BEYOND_HEIGHTS, of_rows=height)
        return TextLine(points, self.line.height_mm)


def _in_strip(pixels: Sequence[int] | NDArray[np.int64], to_height: int) -> NDArray[np.float64]:
    """Pixels of an image of so many to a height as those of a strip."""
    return (np.array(pixels, dtype=np.float64) + 0.5) * HEIGHT_ROWS / to_height - 0.5
