"""The quality of every mark that was read: the felt cell against the template of what it was read as."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from recognition.decision.grade import GradeError, grade_character
from recognition.decision.reading import CharacterReading, Reading
from recognition.experts.templates.frames import LineImage, is_edge_channel, resampled
from recognition.experts.templates.judge import JudgedLine
from recognition.experts.templates.predicted import PIXELS
from recognition.experts.templates.refine import Cell, fine_templates

ALIKE_LETTERS = "AB"
"""Grades of completeness from which strokes of a font that nobody named are those of the part."""
TALL_HEIGHTS, SIDE_HEIGHTS = 0.58, 0.12
"""What is graded with a character: rows about its middle, land beside its ink."""


def graded(reading: Reading, judged: JudgedLine, directions: tuple[TraceDirection, ...]) -> Reading:
    """The reading with a grade at every character that has a template.

    Args:
        reading: of the line.
        judged: the line by templates, one cell a character.
        directions: of the edge map.
    """
    line, templates, cells = judged.line, judged.line.templates, judged.cells
    if len(cells) != len(reading.characters):
        return reading
    pixel = line.height_mm / PIXELS
    fine = resampled(line.image, pitch_u_mm=pixel, pitch_v_mm=pixel)
    edge = is_edge_channel(directions)
    predicted = fine_templates(templates, directions)[0.0]
    characters = []
    for character, cell in zip(reading.characters, cells, strict=True):
        if character.char not in templates.chars:
            characters.append(character)
            continue
        best = templates.chars.index(character.char)
        half = float(templates.half_width[best])
        characters.append(_graded(character, cell, predicted[best][edge], fine, edge, half))
    return replace(reading, characters=tuple(characters))


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
    character: CharacterReading,
    cell: Cell,
    template: NDArray[np.float32],
    fine: LineImage,
    edge: NDArray[np.bool_],
    half_width: float,
) -> CharacterReading:
    tall = min(template.shape[1] // 2, round(TALL_HEIGHTS * PIXELS))
    side = min(template.shape[2] // 2, round((half_width + SIDE_HEIGHTS) * PIXELS))
    row, col = template.shape[1] // 2, template.shape[2] // 2
    want = template[:, row - tall : row + tall + 1, col - side : col + side + 1]
    r = round((cell.v_mm - fine.origin_mm[1]) / fine.pitch_v_mm) - tall
    c = round((cell.u_mm - fine.origin_mm[0]) / fine.pitch_u_mm) - side
    felt = np.zeros_like(want)
    known = np.zeros(want.shape[1:], dtype=np.bool_)
    _, rows, cols = fine.channels.shape
    rr, cc = slice(max(0, r), min(rows, r + want.shape[1])), slice(max(0, c), min(cols, c + want.shape[2]))
    if rr.stop > rr.start and cc.stop > cc.start:
        inside = (slice(rr.start - r, rr.stop - r), slice(cc.start - c, cc.stop - c))
        felt[:, inside[0], inside[1]] = fine.channels[edge][:, rr, cc]
        known[inside] = True
    try:
        grade = grade_character(felt, want, known)
    except GradeError:
        return character
    return replace(character, grade=grade)
