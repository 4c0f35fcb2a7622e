"""Measure the marks of a line: once for the line, then for each text that it may have.

view, line, text --> Marks: side, height and pose of the line, its surface
Marks, text, posteriors --> TextMarks: strokes of the text and its rivals, depths, grades
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.surface.display import one_line
from recognition.glyph_match.felt_line import FeltLine, felt_line
from recognition.glyph_match.pose import Floats
from recognition.glyph_match.predicted import TemplateSet
from recognition.language.box import Box
from recognition.language.lattice import Lattice
from recognition.marks.depth import MarkDepth
from recognition.marks.grade import OWN_FIT, MarkGrade, edge_fit, edges_of, grades_of
from recognition.marks.laid_text import LaidText, laid_text
from recognition.marks.no_depth import NoDepth
from recognition.marks.strokes import PlaceStrokes, strokes_of
from recognition.marks.unknown_font import line_depths
from recognition.recogniser.read_line import ReadLine
from recognition.see.view import View
from whisker_array.estimation.relief import Relief

Predict = Callable[..., TemplateSet]
"""`(font, view, height_mm, raised=, face=)`: templates of a font, predicted for the touch of a view."""


@dataclass(frozen=True, eq=False)
class MarkFonts:
    """Fonts along whose strokes marks are measured.

    Attributes:
        fonts: the named fonts; if none is named, stand-ins.
        stand_ins: further fonts, whose strokes are compared with the part's.
        named: whether `fonts` were named.
        predict: predicts the templates of a font.
    """

    fonts: tuple[Font, ...]
    stand_ins: tuple[Font, ...]
    named: bool
    predict: Predict

    @property
    def every(self) -> tuple[Font, ...]:
        """All fonts."""
        return (*self.fonts, *self.stand_ins)


@dataclass(frozen=True, eq=False)
class Marks:
    """The felt marks of a line.

    Attributes:
        felt: the line with its depths and poses.
        relief: the surface.
        fonts: fonts along whose strokes the marks are measured.
        clipped_mm: (n, 2) x, y of clipped samples: characters there have no depth.
        samples: number of samples of the surface.
    """

    felt: FeltLine
    relief: Relief
    fonts: MarkFonts
    clipped_mm: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    samples: int = 0
    _known: dict[object, TextMarks] = field(default_factory=dict, init=False, repr=False)

    __repr__ = one_line

    def of_text(
        self, text: Sequence[str], lattice: Lattice, boxes: Sequence[Box], *, slope: float
    ) -> TextMarks:
        """Measure the marks of a text; the same is measured once.

        Args:
            text: one character per place.
            lattice: posteriors of all characters that may stand at each place.
            boxes: position of each character.
            slope: calibration slope of the posteriors, in log odds (`recognition.decide.score`).
        """
        chars, key = tuple(text), (tuple(text), lattice, slope)
        if chars not in self._known:
            self._known[chars] = _depths_of(self, chars, boxes)
        marks = self._known[chars]
        if marks.laid is not None and key not in self._known:
            self._known[key] = replace(marks, strokes=strokes_of(marks.laid, lattice, slope=slope))
        return self._known.get(key, marks)


@dataclass(frozen=True, eq=False)
class TextMarks:
    """The marks of a text.

    Attributes:
        depths: depth of each character, or why it has none; None where no depth was tried.
        grades: grade of each character; None where it was not graded.
        laid: the text, fitted to the line in a font; None if no font fits.
        along: the text along whose strokes the depths were measured, in a named font if any is named.
        in_own_font: `along` if its font is the part's; None otherwise.
        font_fits: whether the font of `along` fits the marks.
        strokes: felt strokes, place by place, of the text and its rivals; empty if unknown.
    """

    depths: tuple[MarkDepth | NoDepth | None, ...]
    grades: tuple[MarkGrade | None, ...]
    laid: LaidText | None = None
    along: LaidText | None = None
    in_own_font: LaidText | None = None
    font_fits: bool = True
    strokes: tuple[PlaceStrokes, ...] = ()

    __repr__ = one_line


def measure(
    view: View, line: ReadLine, fonts: MarkFonts, *, clipped_mm: Floats | None = None
) -> Marks | None:
    """Find side, height and pose of the marks along a line; None without heights.

    Args:
        view: view that was felt.
        line: line that was read.
        fonts: fonts along whose strokes the marks are measured.
        clipped_mm: (n, 2) x, y of clipped samples.
    """
    if view.relief is None or view.edges is None:
        return None
    felt = felt_line(view, line.line, line.columns, line.lattice.text, fonts.every)
    clipped = np.zeros((0, 2)) if clipped_mm is None else clipped_mm
    return Marks(felt, view.relief, fonts, clipped, int(view.edges.valid.sum()))


def _depths_of(marks: Marks, text: tuple[str, ...], boxes: Sequence[Box]) -> TextMarks:
    """Depths and grades of a text, without its strokes."""
    clipped, found = _clipped_places(marks, boxes), _depths_along(marks, text)
    whole = marks.felt.whole if found.laid is not None else [True] * len(text)
    return replace(
        found,
        grades=tuple(grade if whole[k] else None for k, grade in enumerate(found.grades)),
        depths=tuple(
            NoDepth.SATURATED if k in clipped else depth if whole[k] else NoDepth.NOT_FELT
            for k, depth in enumerate(found.depths)
        ),
    )


def _depths_along(marks: Marks, text: tuple[str, ...]) -> TextMarks:
    fonts, nothing = marks.fonts, (None,) * len(text)
    laid = laid_text(marks.felt, text, fonts.fonts, stand_ins=fonts.stand_ins)
    along = laid
    if laid is not None and laid.font not in fonts.fonts:
        along = laid_text(marks.felt, text, fonts.fonts)
    if laid is None or along is None:
        return TextMarks(nothing, nothing, laid)
    others = [
        laid if font is laid.font else along.in_font(font) for font in fonts.every if font is not along.font
    ]
    line = line_depths(marks.relief, along, others, named=fonts.named)
    text_marks = TextMarks(line.depths, nothing, laid, along, font_fits=line.font_fits)
    if not line.font_fits:
        return text_marks
    view, raised = along.felt.view, along.felt.raised
    edges = edges_of(along, fonts.predict(along.font, view, along.height_mm, raised=raised, face=along.face))
    if not fonts.named and edge_fit(edges) < OWN_FIT:
        return text_marks
    grades = zip(grades_of(edges), line.same_strokes, strict=True)
    return replace(
        text_marks, in_own_font=along, grades=tuple(grade if same else None for grade, same in grades)
    )


def _clipped_places(
    marks: Marks, boxes: Sequence[Box], *, few: int = 3, land_share: float = 0.01
) -> frozenset[int]:
    """Places with clipped samples; all of them if the land is clipped as well.

    Args:
        marks: with the clipped samples.
        boxes: position of each character.
        few: number of clipped samples from which the depth of a character is not trusted.
        land_share: clipped samples outside of the characters, as a share of all samples, from which the level of the
            land, and so every depth, is not trusted.
    """
    if not len(marks.clipped_mm):
        return frozenset()
    corners = np.array([(box.x0_mm, box.y0_mm, box.x1_mm, box.y1_mm) for box in boxes]).reshape(-1, 2, 2)
    low, high = corners.transpose(1, 0, 2)
    points = marks.clipped_mm[:, None]
    inside = np.asarray(np.logical_and.reduce((points >= low) & (points <= high), axis=2))
    clipped = inside.sum(axis=0) >= few
    clipped |= np.count_nonzero(~inside.any(axis=1)) > land_share * marks.samples
    return frozenset(int(k) for k in np.flatnonzero(clipped))
