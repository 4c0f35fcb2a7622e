"""Line search by template matching: a font's templates find and read lines, without any network.

view --at several sizes--> responses of all templates --rows that a chain explains well--> candidates
candidate --at full resolution--> chain, its rows, its spacing --every template in every cell--> Steps --> ReadLine
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face
from recognition.find.finder import overlap
from recognition.find.promise import rank
from recognition.find.region import about_region
from recognition.find.search import Move, Search
from recognition.glyph_match.chain import Placed, place_bounds
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
from recognition.glyph_match.predicted import TemplateKey, TemplateSet, template_key
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.recogniser.steps import Steps
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import View
from whisker_array.whisker.touch import Touch, default_touch


@dataclass(frozen=True)
class MarkStyle:
    """Appearance of a font on a part: kind of face, and whether the marks are raised."""

    face: Face = Face.FLAT
    raised: bool = False


STYLES = (MarkStyle(), MarkStyle(raised=True), MarkStyle(face=Face.DOTTED))
"""Appearances that are searched, most frequent first."""


@dataclass(frozen=True, kw_only=True)
class MatchingLimits:
    """Resolution and range of a search by templates.

    Attributes:
        coarse_pixels: pixels for each character height in the search.
        fine_pixels: pixels for each character height in reading.
        smallest: least character height, as a share of the view's smaller side.
        largest: greatest character height, as a share of the view's smaller side.
        size_step: ratio between neighbouring heights.
        first_sizes: number of heights that are searched first.
        most_sizes: number of heights that are searched if those are not convincing, including them.
        slopes: slopes of a line relative to the view's rows, positive if it falls along +x: up to 5 degrees.
        rows_a_size: number of rows of each size that are tried as lines.
        most_lines: number of lines that are read at full resolution.
        beyond_heights: margin that is read before and after a line, in case it has more characters; character heights.
        most_rereads: greatest number of times that a line is read again along its characters.
        off_heights: a line is read again if a character lies further from its row than this, character heights.
    """

    coarse_pixels: int = 16
    fine_pixels: int = 32
    smallest: float = 0.13
    largest: float = 0.95
    size_step: float = 1.1
    first_sizes: int = 3
    most_sizes: int = 9
    slopes: tuple[float, ...] = (-0.09, -0.045, 0.0, 0.045, 0.09)
    rows_a_size: int = 20
    most_lines: int = 3
    beyond_heights: float = 1.0
    most_rereads: int = 3
    off_heights: float = 0.06


@dataclass(frozen=True, eq=False)
class TemplateFonts:
    """Fonts whose templates find and read lines.

    Attributes:
        fonts: fonts to compare.
        predict: function that predicts the templates of a font's characters; it should cache them.
        matching: resolution and range of the search.
    """

    fonts: Sequence[Font]
    predict: Callable[[Font, str, TemplateKey], TemplateSet]
    matching: MatchingLimits = MatchingLimits()

    def in_style(self, style: MarkStyle) -> list[Font]:
        """Fonts that can have a style: dots need strokes."""
        return [font for font in self.fonts if style.face is not Face.DOTTED or font.stroke_ratio > 0.0]


class TemplateSearch(Search):
    """Search that uses only the templates of fonts; a look compares a line with those of one font and style."""

    @property
    def _fonts(self) -> TemplateFonts:
        assert self.request.templates is not None
        return self.request.templates

    @property
    def _tries(self) -> Sequence[tuple[MarkStyle, slice]]:
        """Mark styles and ranks of sizes, tried in this order until a line is convincing."""
        matching = self._fonts.matching
        first = slice(0, matching.first_sizes)
        usual, *others = STYLES
        further = slice(matching.first_sizes, matching.most_sizes)
        return ((usual, first), (usual, further), *((style, first) for style in others))

    def heights_mm(self) -> list[float]:
        """Estimate the character heights at which a scan of the part is worth its time, most promising first."""
        near = about_region(self.request.region, self.view)
        return self._sizes_mm(near, self._fonts.fonts[0], STYLES[0])

    def candidates(self) -> list[TextLine]:
        """Propose lines, most promising first, without reading them."""
        return self._candidates(*self._tries[0])

    def lines(self) -> list[ReadLine]:
        """Read the lines of the view, most promising first; try raised and dotted marks if sunk ones fail."""
        return self._until_sure((style, self._candidates(style, sizes)) for style, sizes in self._tries)

    def read(self, lines: Iterable[TextLine]) -> list[ReadLine]:
        """Read each line in each style; the most promising comes first."""
        lines = list(lines)
        return self._until_sure((style, lines) for style in STYLES)

    def _until_sure(self, tries: Iterable[tuple[MarkStyle, Sequence[TextLine]]]) -> list[ReadLine]:
        lines: list[ReadLine] = []
        for style, proposed in tries:
            lines = rank([*lines, *self._looks(proposed, style)])
            if self._reaches(lines, self.request.limits.sure):
                break
        return lines

    def refine(self, lines: Sequence[ReadLine]) -> ReadLine:
        """Return the best line; `_look` has already moved it to its place."""
        return lines[0]

    def more_looks(self, read: ReadLine, moves: Iterable[Move]) -> list[Steps]:
        """Return nothing: `_look` has already tried every position near the line."""
        return []

    def _glyphs(
        self, font: Font, style: MarkStyle, height_mm: float, *, pixels: int, touch: Touch | None = None
    ) -> GlyphImages:
        """Make a font's templates at a height, as felt with `touch` (default: the default touch for that height)."""
        touch = touch if touch is not None else default_touch(height_mm)
        key = template_key(font, touch, height_mm=height_mm, face=style.face, raised=style.raised)
        templates = self._fonts.predict(font, self.request.chars_of(font), key)
        return glyph_images(templates, pixels=pixels)

    def _candidates(self, style: MarkStyle, sizes: slice) -> list[TextLine]:
        near = about_region(self.request.region, self.view)
        proposed = [
            rewarded
            for font in self._fonts.in_style(style)
            for height_mm in self._sizes_mm(near, font, style)[sizes]
            for rewarded in self._lines_of_size(near, font, style, height_mm)
        ]
        lines: list[TextLine] = []
        for _, line in sorted(proposed, key=lambda rewarded: -rewarded[0]):
            if len(lines) < self._fonts.matching.most_lines and not any(overlap(line, o) for o in lines):
                lines.append(line)
        return lines

    def _sizes_mm(
        self, view: View, font: Font, style: MarkStyle, *, sketch_pixels: int = 12, sketch_step: int = 3
    ) -> list[float]:
        """Rank character heights by the strongest response of any row of a view.

        Args:
            sketch_pixels: pixels for each character height in this ranking; it is used if no height is known.
            sketch_step: the ranking uses every `sketch_step`-th template.
        """
        if self.request.height_mm is not None:
            return [self.request.height_mm]
        matching = self._fonts.matching
        count = math.ceil(math.log(matching.largest / matching.smallest) / math.log(matching.size_step)) + 1
        sizes = [matching.largest * min(view.size_mm) / matching.size_step**k for k in range(count)]

        def response(height_mm: float) -> float:
            glyphs = self._glyphs(font, style, height_mm, pixels=sketch_pixels).every(sketch_step)
            sums = _Rows(view, glyphs, height_mm).row_sums(matching.slopes)
            # scaled by the height: more small characters fit along a line, so they would respond more often
            return height_mm * max(total for total, _ in sums)

        return sorted(sizes, key=response, reverse=True)

    def _lines_of_size(
        self, view: View, font: Font, style: MarkStyle, height_mm: float
    ) -> list[tuple[float, TextLine]]:
        """Find lines of characters of one height, each with the total reward of its chain."""
        matching = self._fonts.matching
        glyphs = self._glyphs(font, style, height_mm, pixels=matching.coarse_pixels)
        of_view, lines = _Rows(view, glyphs, height_mm), []
        ranked = sorted(of_view.row_sums(matching.slopes), key=lambda summed: -summed[0])
        for _, rows in ranked[: matching.rows_a_size]:
            total, placed = chain_of(of_view.along(rows), glyphs, font, self.request.grammar)
            if placed:
                first, last, half = placed[0], placed[-1], glyphs.half_cols
                ends = np.array([first.column - half[first.template], last.column + half[last.template]])
                lines.append((total, of_view.line(rows, ends)))
        return lines

    def _looks(self, lines: Iterable[TextLine], style: MarkStyle) -> list[ReadLine]:
        return [
            read
            for line in lines
            for font in self._fonts.in_style(style)
            if self.may_run(line) and not self.looks.stopped
            if (read := self._look(line, font, style)) is not None
        ]

    def _look(self, line: TextLine, font: Font, style: MarkStyle) -> ReadLine | None:
        """Read a line, after moving it to the line through its characters if they lie off it."""
        self.looks.count += 1
        matching = self._fonts.matching
        glyphs = self._glyphs(font, style, line.height_mm, pixels=matching.fine_pixels, touch=self.view.touch)
        best = self._place(line, font, glyphs)
        for _ in range(matching.most_rereads):
            if len(best.placed) < 2 or np.abs(best.off_heights).max() <= matching.off_heights:
                break
            again = self._place(best.through(), font, glyphs)
            if again.total <= best.total:
                break
            best = again
        if not best.placed:
            return None
        bounds = place_bounds(best.placed, glyphs.half_cols, best.image.shape[1], pixels=glyphs.pixels)
        cells = np.array(
            [
                cell_correlations(best.image, glyphs, row=row, column=placed.column, bounds=bound)
                for placed, row, bound in zip(best.placed, best.rows, bounds, strict=True)
            ]
        )
        columns = best.columns - (matching.beyond_heights - MARGIN) * HEIGHT_ROWS
        steps = steps_of(cells, glyphs.chars, columns, chars=self.request.chars, rare=self.request.rare)
        return combine_looks(best.line, [steps], self.request.grammar)

    def _place(
        self, line: TextLine, font: Font, glyphs: GlyphImages, *, slack_heights: float = 0.3
    ) -> _PlacedLine:
        """Find the best chain of characters along a line.

        Args:
            slack_heights: largest distance of the line from the row where it was found, character heights.
        """
        pixels, beyond = glyphs.pixels, self._fonts.matching.beyond_heights
        slack = round(slack_heights * pixels)
        rows = HEIGHT_ROWS * (1.0 + 4.0 * slack_heights)
        image = image_of(self.view, line, rows=rows, margin=beyond, pixels=pixels)
        first = len(image) // 2 - slack
        response = responses(image, glyphs, rows=slice(first, first + 2 * slack + 1))
        best = response.max(axis=1)
        total, chain = chain_of(best, glyphs, font, self.request.grammar)
        placed = beside(best, glyphs, font, chain)
        at_rows = [first + int(response[p.template, :, p.column].argmax()) for p in placed]
        return _PlacedLine(line, image, total, placed, at_rows, pixels, beyond)


class _Rows:
    """Template responses along level and slightly sloping rows of a whole view."""

    def __init__(self, view: View, glyphs: GlyphImages, height_mm: float) -> None:
        (width, high), (x, y) = view.size_mm, view.origin_mm
        self.pixels, self.rows = glyphs.pixels, round(high / height_mm * HEIGHT_ROWS)
        self.across = TextLine.straight(x, y + high / 2, length_mm=width, height_mm=height_mm)
        image = image_of(view, self.across, rows=self.rows, margin=0.0, pixels=self.pixels)
        response = responses(image, glyphs, rows=slice(0, len(image)))
        # a character may lie a row higher or lower
        self.near = np.maximum(response, np.maximum(np.roll(response, 1, 1), np.roll(response, -1, 1)))
        self.best_responses = (glyphs.half_cols[:, None, None] * np.clip(self.near, 0.0, None) ** 2).max(
            axis=0
        )
        self.columns = np.arange(image.shape[1])

    def row_sums(self, slopes: Sequence[float]) -> list[tuple[float, NDArray[np.int64]]]:
        """Sum the best responses along each row of every slope; return each sum and the row at every column."""
        high, tried = len(self.best_responses), []
        for slope in slopes:
            lean = np.rint(slope * (self.columns - self.columns.mean())).astype(np.int64)
            rows = np.clip(np.arange(high)[:, None] + lean, 0, high - 1)
            totals = self.best_responses[rows, self.columns].sum(axis=1) / self.pixels**2
            tried += list(zip(totals.tolist(), rows, strict=True))
        return tried

    def along(self, rows: NDArray[np.int64]) -> Image:
        """Return the responses at one row of each column, shape (T, columns)."""
        return np.asarray(self.near[:, rows, self.columns])

    def line(self, rows: NDArray[np.int64], ends: NDArray[np.int64]) -> TextLine:
        """Make the line that follows rows between two columns."""
        on = rows[np.clip(ends, 0, self.columns.size - 1)]
        u, v = (_in_strip(pixels, self.pixels) for pixels in (ends, on))
        points = self.across.places_mm(u, v, margin=0.0, of_rows=self.rows)
        return TextLine(points, self.across.height_mm)


@dataclass(frozen=True, eq=False)
class _PlacedLine:
    """Characters found along a line, their total reward, and their rows in the line's image."""

    line: TextLine
    image: Image
    total: float
    placed: tuple[Placed, ...]
    rows: list[int]
    pixels: int
    beyond_heights: float

    @property
    def columns(self) -> NDArray[np.float64]:
        """Columns of the line's strip, shape (places,), with the margin of the image."""
        return _in_strip([placed.column for placed in self.placed], self.pixels)

    @property
    def off_heights(self) -> NDArray[np.float64]:
        """Distance of each place below the line, shape (places,), character heights."""
        return (np.array(self.rows) - (len(self.image) - 1) / 2) / self.pixels

    def through(self) -> TextLine:
        """Fit the line through the characters, weighted by their rewards."""
        sure = [max(placed.reward, 1e-3) for placed in self.placed]
        slope, down = np.polyfit(self.columns, self.off_heights, 1, w=sure)
        margin = self.beyond_heights * HEIGHT_ROWS
        ends = np.array([margin, self.line.columns(margin=self.beyond_heights) - margin]) - 0.5
        height = len(self.image) * HEIGHT_ROWS / self.pixels
        rows = (slope * ends + down) * HEIGHT_ROWS + height / 2 - 0.5
        points = self.line.places_mm(ends, rows, margin=self.beyond_heights, of_rows=height)
        return TextLine(points, self.line.height_mm)


def _in_strip(pixels: Sequence[int] | NDArray[np.int64], height_pixels: int) -> NDArray[np.float64]:
    """Convert pixels of an image with `height_pixels` pixels for each character height to pixels of a strip."""
    return (np.array(pixels, dtype=np.float64) + 0.5) * HEIGHT_ROWS / height_pixels - 0.5
