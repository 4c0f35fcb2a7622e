"""The quality of every mark that was read: the felt cell against the template of what it was read as."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recognition.decision.grade import GradeError, grade_character
from recognition.decision.laid_text import LaidText
from recognition.decision.reading import CharacterReading, Reading
from recognition.experts.correlation import Image
from recognition.experts.templates.predicted import PIXELS

ALIKE_LETTERS = "AB"
"""Grades of completeness from which strokes of a font that nobody named are those of the part."""
TALL_HEIGHTS, SIDE_HEIGHTS = 0.58, 0.12
"""What is graded with a character: rows about its middle, land beside its ink."""


def graded(reading: Reading, laid: LaidText) -> Reading:
    """The reading with a grade at every character that has a template.

    Args:
        reading: of the line.
        laid: its text in the templates of a font.
    """
    felt_layers = np.abs(laid.image).max(axis=(0, 1)) > 0.0
    image = np.pad(_steps(laid.image, felt_layers), ((0, 0), (PIXELS, PIXELS), (PIXELS, PIXELS)))
    characters = []
    for character, row, column in zip(reading.characters, laid.rows, laid.columns, strict=True):
        if character.char in laid.glyphs.chars:
            template = laid.glyphs.images[laid.glyphs.chars.index(character.char)]
            tall, side = min(template.shape[0] // 2, round(TALL_HEIGHTS * PIXELS)), template.shape[1] // 2
            middle = template.shape[0] // 2
            want = _steps(template[middle - tall : middle + tall + 1], felt_layers)
            r, c = int(row) + PIXELS - tall, int(column) + PIXELS - side
            felt = image[:, r : r + want.shape[1], c : c + want.shape[2]]
            character = _graded(character, felt, want)
        characters.append(character)
    return replace(reading, characters=tuple(characters))


def _steps(layers: Image, felt: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(2, rows, columns) half differences of opposite directions, which answer steps of the surface; of those felt."""
    known = np.moveaxis(layers * felt, 2, 0)
    return np.asarray(0.5 * (known[:2] - known[2:]))


def explained(reading: Reading, *, by_font: bool) -> Reading:
    """What may be said of a reading's marks by the font that they were graded and measured by.

    A font explains the marks where it was named, or suits them. One that only stands for a font that nobody named
    grades nothing: strokes that another font does not have are not missing. It measures depth where its strokes are
    the part's, too.
    """
    if by_font:
        return reading
    characters = tuple(
        replace(c, grade=None, depth=c.depth if _is_alike(c) else None) for c in reading.characters
    )
    return replace(reading, characters=characters)


def _is_alike(character: CharacterReading) -> bool:
    parameters = () if character.grade is None else character.grade.parameters
    return any(p.name == "completeness" and p.letter in ALIKE_LETTERS for p in parameters)


def _graded(
    character: CharacterReading, felt: NDArray[np.float32], want: NDArray[np.float32]
) -> CharacterReading:
    if felt.shape != want.shape:
        return character  # it stands beyond the map
    try:
        return replace(character, grade=grade_character(felt, want))
    except GradeError:
        return character
