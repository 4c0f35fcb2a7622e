"""The quality of every mark that was read: the felt cell against the template of what it was read as."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.glyph_match.correlation import Image
from recognition.glyph_match.predicted import PIXELS
from recognition.marks.grade import MarkGrade, grade_character
from recognition.marks.laid_text import LaidText

ALIKE_LETTERS = "AB"
"""Grade of completeness from which strokes of an unnamed font are those of the part."""


def grades_of(laid: LaidText, *, tall_heights: float = 0.58) -> tuple[MarkGrade | None, ...]:
    """The grade of every character of a text; None where its font has no template, or it stands beyond the map.

    Args:
        laid: the text in the templates of a font.
        tall_heights: rows about a character's middle that are graded with it, character heights either way.
    """
    felt = np.abs(laid.image).max(axis=(0, 1)) > 0.0
    image = np.pad(_steps(laid.image, felt), ((0, 0), (PIXELS, PIXELS), (PIXELS, PIXELS)))
    grades: list[MarkGrade | None] = []
    for char, row, column in zip(laid.text, laid.rows, laid.columns, strict=True):
        if char not in laid.glyphs.chars:
            grades.append(None)
            continue
        template = laid.glyphs.images[laid.glyphs.chars.index(char)]
        middle, side = (n // 2 for n in template.shape[:2])
        tall = min(middle, round(tall_heights * PIXELS))
        want = _steps(template[middle - tall : middle + tall + 1], felt)
        r, c = int(row) + PIXELS - tall, int(column) + PIXELS - side
        cell = image[:, r : r + want.shape[1], c : c + want.shape[2]]
        grades.append(grade_character(cell, want) if cell.shape == want.shape else None)
    return tuple(grades)


def is_of_the_part(grade: MarkGrade | None) -> bool:
    """Whether the strokes of the font that a mark was graded by are the mark's own."""
    return grade is not None and any(
        p.name == "completeness" and p.letter in ALIKE_LETTERS for p in grade.parameters
    )


def _steps(layers: Image, felt: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(2, rows, columns) half differences of opposite directions, which answer steps of the surface; of those felt."""
    known = np.moveaxis(layers * felt, 2, 0)
    return np.asarray(0.5 * (known[:2] - known[2:]))
