"""Measure the marks of a line: once for the line, then for each text that it may have.

view, line, text --> Marks: side, height and pose of the line, its surface
Marks, text, posteriors --> TextMarks: strokes of the text and its rivals, depths, grades
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.surface.display import OneLine
from recognition.glyph_match.felt_line import FeltLine, felt_line
from recognition.glyph_match.pose import Floats
from recognition.glyph_match.predicted import TemplateSet
from recognition.language.box import Box
from recognition.language.lattice import Lattice
from recognition.marks.depth import MarkDepth
from recognition.marks.grade import OWN_FIT, Edges, MarkGrade, edge_fit, edges_of, grades_of
from recognition.marks.laid_text import LaidText, can_be_laid, laid_text
from recognition.marks.no_depth import NoDepth
from recognition.marks.strokes import PlaceStrokes, StrokeSurface, strokes_of
from recognition.marks.unknown_font import LineDepths
from recognition.recogniser.read_line import ReadLine
from recognition.see.view import View
from whisker_array.estimation.relief import Relief

Predict = Callable[..., TemplateSet]
"""`(font, view, height_mm, raised=, face=)`: templates of a font, predicted for the touch of a view."""


@dataclass(frozen=True, eq=False)
class MarkFonts:
    """Fonts along whose strokes marks are measured, and stand-ins whose strokes are compared with them."""

    fonts: tuple[Font, ...]
    stand_ins: tuple[Font, ...]
    named: bool
    predict: Predict

    @property
    def every(self) -> tuple[Font, ...]:
        return (*self.fonts, *self.stand_ins)


@dataclass(frozen=True, eq=False, repr=False)
class Marks(OneLine):
    """The felt marks of a line; characters with clipped samples, (n, 2) x, y, have no depth."""

    felt: FeltLine
    relief: Relief
    fonts: MarkFonts
    clipped_mm: Floats
    samples: int
    _known: dict[tuple[str, ...], TextMarks] = field(default_factory=dict, init=False, repr=False)

    def of_text(self, text: Sequence[str], boxes: Sequence[Box]) -> TextMarks:
        chars = tuple(text)
        if chars not in self._known:
            self._known[chars] = TextMarks(self, chars, tuple(boxes))
        return self._known[chars]

    @cached_property
    def surface(self) -> StrokeSurface:
        return StrokeSurface(self.felt.strip)


@dataclass(frozen=True, eq=False, repr=False)
class TextMarks(OneLine):
    """The marks of a text; each of them is measured when it is first needed."""

    marks: Marks
    text: tuple[str, ...]
    boxes: tuple[Box, ...] = ()
    _strokes: dict[tuple[Lattice, float], tuple[PlaceStrokes, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def whole(self) -> tuple[bool, ...]:
        """Whether each character was felt from edge to edge; true where no font has any of the characters."""
        felt = self.marks.felt
        laid = can_be_laid(felt, self.text, self.marks.fonts.every)
        return tuple(felt.whole) if laid else (True,) * len(self.text)

    @cached_property
    def laid(self) -> LaidText | None:
        fonts = self.marks.fonts
        return laid_text(self.marks.felt, self.text, fonts.fonts, stand_ins=fonts.stand_ins)

    @cached_property
    def along(self) -> LaidText | None:
        """The text along whose strokes depths are measured, in a named font if any is named."""
        fonts = self.marks.fonts.fonts
        if self.laid is None or self.laid.font in fonts:
            return self.laid
        return laid_text(self.marks.felt, self.text, fonts)

    @property
    def other_font_fits_better(self) -> bool:
        if not self.marks.fonts.stand_ins or self.laid is None or self.along is None:
            return False
        return self.laid.font.name != self.along.font.name

    @cached_property
    def _depths(self) -> LineDepths | None:
        laid, along, fonts = self.laid, self.along, self.marks.fonts
        if laid is None or along is None:
            return None
        others = tuple(
            laid if font is laid.font else along.in_font(font)
            for font in fonts.every
            if font is not along.font
        )
        return LineDepths(self.marks.relief, along, others, named=fonts.named)

    @property
    def font_fits(self) -> bool:
        return self._depths is None or self._depths.font_fits

    @cached_property
    def _edges(self) -> list[Edges | None] | None:
        along, fonts = self.along, self.marks.fonts
        if along is None or not self.font_fits:
            return None
        view, raised = along.felt.view, along.felt.raised
        templates = fonts.predict(along.font, view, along.height_mm, raised=raised, face=along.face)
        edges = edges_of(along, templates)
        return edges if fonts.named or edge_fit(edges) >= OWN_FIT else None

    @property
    def in_own_font(self) -> LaidText | None:
        return None if self._edges is None else self.along

    @cached_property
    def depths(self) -> tuple[MarkDepth | NoDepth | None, ...]:
        clipped = _clipped_places(self.marks, self.boxes)
        depths = (None,) * len(self.text) if self._depths is None else self._depths.depths
        return tuple(
            NoDepth.SATURATED if k in clipped else depth if self.whole[k] else NoDepth.NOT_FELT
            for k, depth in enumerate(depths)
        )

    @cached_property
    def grades(self) -> tuple[MarkGrade | None, ...]:
        if self._edges is None or self._depths is None:
            return (None,) * len(self.text)
        graded = np.logical_and(self._depths.same_strokes, self.whole)
        return tuple(
            grade if known else None for grade, known in zip(grades_of(self._edges), graded, strict=True)
        )

    def strokes(self, lattice: Lattice, *, slope: float) -> tuple[PlaceStrokes, ...]:
        """Felt strokes of the text and its rivals, place by place, by the score's `slope`; empty if unknown."""
        if self.laid is None:
            return ()
        key = lattice, slope
        if key not in self._strokes:
            self._strokes[key] = strokes_of(self.laid, lattice, slope=slope, surface=self.marks.surface)
        return self._strokes[key]

    def has_strokes(self, lattice: Lattice | None) -> bool:
        same_places = lattice is not None and lattice.n_places == len(self.text)
        return same_places and can_be_laid(self.marks.felt, self.text, self.marks.fonts.every)


def measure(view: View, line: ReadLine, fonts: MarkFonts, *, clipped_mm: Floats) -> Marks | None:
    """Find side, height and pose of the marks along a line; None without heights."""
    if view.relief is None or view.edges is None:
        return None
    felt = felt_line(view, line.line, line.columns, line.lattice.text, fonts.every)
    return Marks(felt, view.relief, fonts, clipped_mm, int(view.edges.valid.sum()))


def _clipped_places(
    marks: Marks,
    boxes: Sequence[Box],
    *,
    few: int = 3,
    # clipped samples outside of the characters, as a share of all samples, from which the level of the land, and so
    # every depth, is not trusted
    land_share: float = 0.01,
) -> frozenset[int]:
    if not len(marks.clipped_mm):
        return frozenset()
    corners = np.array([(box.x0_mm, box.y0_mm, box.x1_mm, box.y1_mm) for box in boxes]).reshape(-1, 2, 2)
    low, high = corners.transpose(1, 0, 2)
    points = marks.clipped_mm[:, None]
    inside = np.asarray(np.logical_and.reduce((points >= low) & (points <= high), axis=2))
    clipped = inside.sum(axis=0) >= few
    clipped |= np.count_nonzero(~inside.any(axis=1)) > land_share * marks.samples
    return frozenset(int(k) for k in np.flatnonzero(clipped))
