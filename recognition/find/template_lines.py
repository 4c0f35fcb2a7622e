"""Line search by template matching: a font's templates find and read lines, without any network.

view --every size, coarsely--> responses of all templates --rows and sizes that they explain most--> best rows
best row --finer--> chain, its spacing --> candidate --finest, every template in every cell--> Steps --> ReadLine
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font
from recognition.find.finder import overlap
from recognition.find.line_variants import anywhere
from recognition.find.promise import is_convincing, rank
from recognition.find.search import Move, Search
from recognition.find.template_fonts import STYLES, MarkStyle, TemplateFonts
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
from recognition.glyph_match.predicted import CANONICAL_HEIGHT_MM, template_key
from recognition.recogniser.read_line import ReadLine, combine_looks
from recognition.recogniser.steps import Steps
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.see.view import View
from whisker_array.whisker.touch import Touch, default_touch


@dataclass(frozen=True, eq=False)
class TemplateSearch(Search):
    """Search that uses only the templates of fonts; a look compares a line with those of one font and style."""

    _ranked: dict[tuple[View, str, MarkStyle], list[_Size]] = field(repr=False, default_factory=dict)
    _placed: dict[tuple[object, ...], _PlacedLine] = field(repr=False, default_factory=dict)
    _looked: dict[tuple[object, ...], ReadLine | None] = field(repr=False, default_factory=dict)

    @property
    def _fonts(self) -> TemplateFonts:
        assert self.request.templates is not None
        return self.request.templates

    @property
    def _tries(self) -> Sequence[tuple[MarkStyle, slice]]:
        matching = self._fonts.matching
        first = slice(0, matching.first_sizes)
        usual, *others = STYLES
        further = slice(matching.first_sizes, matching.most_sizes)
        return ((usual, first), (usual, further), *((style, first) for style in others))

    def heights_mm(self) -> list[float]:
        return [size.height_mm for size in self._sizes(self._fonts.fonts[0], STYLES[0])]

    def candidates(self) -> list[TextLine]:
        return self._candidates(*self._tries[0])

    def turned_candidates(self, *turns_deg: float) -> list[TextLine]:
        """Return nothing: templates are matched along level rows only."""
        return []

    def lines(self, about: Sequence[TextLine] = ()) -> list[ReadLine]:
        """Read the lines of the view, most promising first; try raised and dotted marks if sunk ones fail."""
        if about:
            return self.read(about)
        lines = self._until_sure((style, self._candidates(style, sizes)) for style, sizes in self._tries)
        if is_convincing(lines, self.request.limits.plain):
            return lines
        return rank([*lines, *self.read(read.line.reversed for read in lines[:1])])

    def read(
        self, lines: Iterable[TextLine], *, cheap: bool = False, like: ReadLine | None = None
    ) -> list[ReadLine]:
        """Read each line in each style, most promising first; a cheap look leaves out lines that explain little."""
        lines = list(lines)
        if cheap and self.request.grammar is not None:
            lines = [line for line in lines if self._explains_enough(line)]
        return self._until_sure((style, lines) for style in self._likely_styles())

    def _explains_enough(self, line: TextLine) -> bool:
        pixels, least = self._fonts.matching.coarse_pixels, self._least_total()
        return any(
            self._place(line, font, self._glyphs(font, style, line.height_mm, pixels=pixels)).total >= least
            for style in self._likely_styles()
            for font in self._fonts.in_style(style)
        )

    def _least_total(self) -> float:
        """Total of a coarse chain from which it may read better than the best one so far."""
        matching = self._fonts.matching
        coarse = [row.total for row in self._placed.values() if row.glyphs.pixels == matching.coarse_pixels]
        return matching.least_explained * max([0.0, *coarse])

    def _until_sure(self, tries: Iterable[tuple[MarkStyle, Sequence[TextLine]]]) -> list[ReadLine]:
        lines: list[ReadLine] = []
        for style, proposed in tries:
            lines = rank([*lines, *self._looks(proposed, style)])
            if is_convincing(self.in_region(lines), self.request.limits.sure):
                break
        return lines

    def more_looks(self, read: ReadLine, moves: Iterable[Move]) -> list[Steps]:
        """Return nothing: `_look` has already tried every position near the line."""
        return []

    def _glyphs(
        self, font: Font, style: MarkStyle, height_mm: float, *, pixels: int, touch: Touch | None = None
    ) -> GlyphImages:
        # at few pixels all heights share the templates of the canonical one
        if pixels <= self._fonts.matching.sketch_pixels:
            height_mm, touch = CANONICAL_HEIGHT_MM, None
        touch = touch if touch is not None else default_touch(height_mm)
        key = template_key(font, touch, height_mm=height_mm, face=style.face, raised=style.raised)
        templates = self._fonts.predict(font, self.request.chars_of(font), key)
        return glyph_images(templates, pixels=pixels)

    def _candidates(self, style: MarkStyle, sizes: slice) -> list[TextLine]:
        placed = [
            placed
            for font in self._fonts.in_style(style)
            for size in self._sizes(font, style)[sizes]
            if style in self._likely_styles()
            for placed in self._rows(size, font, style)
            if placed.placed
        ]
        lines: list[TextLine] = []
        for line in (row.through(row.ends) for row in sorted(placed, key=lambda row: -row.total)):
            # parts of characters resemble others: two lines are at least this far apart
            band_mm = self._fonts.matching.apart_heights * line.height_mm
            if not any(overlap(line, other, band_mm=band_mm) for other in lines):
                lines.append(line)
        return lines[: self._fonts.matching.most_lines]

    def _sizes(self, font: Font, style: MarkStyle) -> list[_Size]:
        key = self.view, font.name, style
        if key not in self._ranked:
            sizes = [self._sketch(height_mm, font, style) for height_mm in self._ladder_mm()]
            least = self._fonts.matching.least_explained * max(size.explained_mm for size in sizes)
            worth = [size for size in sizes if size.explained_mm >= least]
            self._ranked[key] = sorted(worth, key=lambda size: -size.explained_mm)
        return self._ranked[key]

    def _likely_styles(self, *, least_share: float = 0.8) -> list[MarkStyle]:
        explained = {style: 0.0 for _, _, style in self._ranked} or dict.fromkeys(STYLES, 1.0)
        for (_, _, style), sizes in self._ranked.items():
            explained[style] = max(explained[style], *(size.explained_mm for size in sizes))
        least = least_share * max(explained.values())
        return [style for style in STYLES if explained.get(style, -1.0) >= least]

    def _ladder_mm(self) -> list[float]:
        if self.request.height_mm is not None:
            return [self.request.height_mm]
        matching = self._fonts.matching
        count = math.ceil(math.log(matching.largest / matching.smallest) / math.log(matching.size_step)) + 1
        return [matching.largest * min(self.view.size_mm) / matching.size_step**k for k in range(count)]

    def _sketch(
        self, height_mm: float, font: Font, style: MarkStyle, *, most_rows: int = 3, chance: float = 0.45
    ) -> _Size:
        """Compare the whole view with coarse templates of one height; keep the rows that they explain most."""
        lines = anywhere(self.view, height_mm=height_mm, blind_step=0.5, most_blind=100)
        if not lines:
            return _Size(height_mm, 0.0, ())
        pixels = self._fonts.matching.sketch_pixels
        glyphs = self._glyphs(font, style, height_mm, pixels=pixels)
        middle = lines[len(lines) // 2]
        rows = HEIGHT_ROWS * (1.0 + 2.0 * abs(lines[0].centre_mm[0, 1] - middle.centre_mm[0, 1]) / height_mm)
        image = image_of(self.view, middle, rows=rows + HEIGHT_ROWS, margin=0.0, pixels=pixels)
        response = responses(image, glyphs, rows=slice(0, len(image)))
        best = []
        for line in lines:
            off = (line.centre_mm[0, 1] - middle.centre_mm[0, 1]) / height_mm
            row, slack = round((len(image) - 1) / 2 + off * pixels), round(0.3 * pixels)
            band = response[:, max(row - slack, 0) : row + slack + 1].max(axis=1)
            best.append((float(np.clip(band.max(axis=0) - chance, 0.0, None).sum()), line, band))
        best.sort(key=lambda row: -row[0])
        explained = max(chain_of(band, glyphs, font, None)[0] for _, _, band in best[:most_rows])
        return _Size(height_mm, height_mm * explained, tuple(line for _, line, _ in best[:most_rows]))

    def _rows(self, size: _Size, font: Font, style: MarkStyle) -> list[_PlacedLine]:
        glyphs = self._glyphs(font, style, size.height_mm, pixels=self._fonts.matching.coarse_pixels)
        return [self._place(row, font, glyphs) for row in size.rows]

    def _looks(self, lines: Iterable[TextLine], style: MarkStyle) -> list[ReadLine]:
        return [
            read
            for line in lines
            for font in self._fonts.in_style(style)
            if self.may_run(line) and self.looks.may_look()
            if (read := self._look(line, font, style)) is not None
        ]

    def _look(self, line: TextLine, font: Font, style: MarkStyle) -> ReadLine | None:
        self.looks.count += 1
        key = *self._key(line), font.name, style
        if key not in self._looked:
            self._looked[key] = self._read_line(line, font, style)
        return self._looked[key]

    def _read_line(self, line: TextLine, font: Font, style: MarkStyle) -> ReadLine | None:
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

    def _key(self, line: TextLine) -> tuple[object, ...]:
        return self.view, line.centre_mm.tobytes(), line.height_mm, self.request.grammar

    def _place(self, line: TextLine, font: Font, glyphs: GlyphImages) -> _PlacedLine:
        key = *self._key(line), glyphs
        if key not in self._placed:
            self._placed[key] = self._place_anew(line, font, glyphs)
        return self._placed[key]

    def _place_anew(
        self, line: TextLine, font: Font, glyphs: GlyphImages, *, slack_heights: float = 0.3
    ) -> _PlacedLine:
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
        return _PlacedLine(line, image, total, placed, at_rows, glyphs, beyond)


@dataclass(frozen=True)
class _Size:
    height_mm: float
    explained_mm: float
    rows: tuple[TextLine, ...]


@dataclass(frozen=True, eq=False)
class _PlacedLine:
    line: TextLine
    image: Image
    total: float
    placed: tuple[Placed, ...]
    rows: list[int]
    glyphs: GlyphImages
    margin_heights: float

    @property
    def columns(self) -> NDArray[np.float64]:
        pixels = np.array([placed.column for placed in self.placed], dtype=np.float64)
        return (pixels + 0.5) * HEIGHT_ROWS / self.glyphs.pixels - 0.5

    @property
    def off_heights(self) -> NDArray[np.float64]:
        return (np.array(self.rows) - (len(self.image) - 1) / 2) / self.glyphs.pixels

    @property
    def ends(self) -> NDArray[np.float64]:
        half = self.glyphs.half_cols * (HEIGHT_ROWS / self.glyphs.pixels)
        reach = -half[self.placed[0].template], half[self.placed[-1].template]
        return np.asarray(self.columns[[0, -1]] + reach)

    def through(self, ends: NDArray[np.float64] | None = None) -> TextLine:
        sure = [max(placed.reward, 1e-3) for placed in self.placed]
        if ends is None:
            margin = self.margin_heights * HEIGHT_ROWS
            ends = np.array([margin, self.line.columns(margin=self.margin_heights) - margin]) - 0.5
        fit = np.polyfit(self.columns, self.off_heights, min(1, len(sure) - 1), w=sure)
        height = len(self.image) * HEIGHT_ROWS / self.glyphs.pixels
        rows = np.asarray(np.polyval(fit, ends) * HEIGHT_ROWS + height / 2 - 0.5, dtype=np.float64)
        points = self.line.places_mm(ends, rows, margin=self.margin_heights, of_rows=height)
        return TextLine(points, self.line.height_mm)
