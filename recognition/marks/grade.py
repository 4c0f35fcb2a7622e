"""Grade of a character's mark, 4 to 0 by the worst of its parameters, and the action, in the spirit of ISO/IEC 29158.

    template predicts   ..../^\\____/^\\....     contrast       strength of its edges where they are felt
    felt                ..../^\\____.........     completeness   share of its edges that is felt
                          felt   filled  swarf    contamination  share of its cell where something else is felt

The limits are ours, chosen for touch; those of the standard grade two-dimensional codes by sight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from glyphs.surface.display import WordedEnum
from recognition.glyph_match.correlation import SMOOTH, Image, correlate, glyph_images
from recognition.glyph_match.predicted import PIXELS, TemplateSet
from recognition.marks.laid_text import LaidText
from recognition.see.view import EDGES, KNOWN

LIMITS = {
    "contrast": (0.7, 0.55, 0.4, 0.25),
    "completeness": (0.92, 0.84, 0.75, 0.6),
    "contamination": (0.02, 0.05, 0.08, 0.15),
}
"""Limits of the grades 4, 3, 2 and 1: minimum values, but for contamination maximum values."""
PASSING = 2
"""Lowest grade that needs no action: C, as usual."""
OWN_FIT = 0.75
"""Minimum mean correlation of edges at which an unnamed font counts as that of the part."""
LETTERS = "FDCBA"
Edges: TypeAlias = tuple[Image, Image]
"""Felt and predicted edges, (rows, columns, layers) each."""


class Action(WordedEnum):
    """Action for a mark."""

    NONE = "none", "nothing to do"
    CLEAN = "clean", "clean it: there is dirt or damage beside its strokes"
    CLEAN_FIRST = (
        "clean first",
        "strokes are missing: clean it and scan it again; if they are still missing, strike it again and check the die",
    )
    RE_STRIKE = "re-strike", "strike it again: it is too shallow"


@dataclass(frozen=True)
class Parameter:
    """One measure of a mark: its value, 0 to 1, and its grade, 4 to 0."""

    name: str
    value: float
    grade: int


@dataclass(frozen=True)
class MarkGrade:
    """The grade of one character."""

    parameters: tuple[Parameter, ...]
    action: Action

    def __repr__(self) -> str:
        values = ", ".join(f"{p.name} {p.grade}" for p in self.parameters)
        return f"MarkGrade({self.letter}: {values}; {self.action.value})"

    @property
    def worst(self) -> Parameter:
        return min(self.parameters, key=lambda p: p.grade)

    @property
    def grade(self) -> int:
        return self.worst.grade

    @property
    def letter(self) -> str:
        return LETTERS[self.grade]

    @property
    def limiting(self) -> str:
        return self.worst.name if self.grade < 4 else ""

    def value(self, name: str) -> float | None:
        return next((p.value for p in self.parameters if p.name == name), None)


def edges_of(laid: LaidText, templates: TemplateSet, *, tall_heights: float = 0.58) -> list[Edges | None]:
    """Felt and predicted edges at each place of a text, `tall_heights` up and down; None if either is missing."""
    glyphs, tall = glyph_images(templates, pixels=PIXELS), round(tall_heights * PIXELS)
    images = dict(zip(glyphs.chars, glyphs.images, strict=True))
    edges: list[Edges | None] = []
    for k, char in enumerate(laid.text):
        image = images.get(char)
        template = (
            None if image is None else image[max(len(image) // 2 - tall, 0) : len(image) // 2 + tall + 1]
        )
        felt = None if template is None else _felt_edges(laid, k, template.shape)
        edges.append((felt, template) if felt is not None and template is not None and felt.any() else None)
    return edges


def edge_fit(edges: Sequence[Edges | None]) -> float:
    """Mean correlation of felt with predicted edges; 0 if either is missing."""
    return float(
        np.mean([correlate(pair[0], [pair[1]])[0, 0, 0] if pair is not None else 0.0 for pair in edges])
    )


def grades_of(edges: Sequence[Edges | None], *, least_felt: float = 0.2) -> tuple[MarkGrade | None, ...]:
    """Grades of a text's characters; a direction is felt if its strongest edge has `least_felt` of the strongest."""
    known = [np.abs(pair[0]).max(axis=(0, 1)) for pair in edges if pair is not None]
    peaks = np.max(known, axis=0) if known else np.zeros(0)
    felt = peaks >= least_felt * peaks.max(initial=0.0)
    return tuple(
        None if pair is None else grade_character(_steps(pair[0], felt), _steps(pair[1], felt))
        for pair in edges
    )


def _felt_edges(laid: LaidText, place: int, shape: Sequence[int]) -> Image:
    from glyphs.opencv import cv2

    rows, columns = shape[:2]
    v, u = (np.indices((rows, columns)).reshape(2, -1) - [[rows // 2], [columns // 2]]) / PIXELS
    places = laid.points_mm(place, np.column_stack([u, v])).reshape(rows, columns, 2)
    across, down = places[rows // 2, -1] - places[rows // 2, 0]
    seen = laid.felt.view.sample(places, math.degrees(math.atan2(down, across)))
    edges = np.ascontiguousarray(seen[EDGES:KNOWN].transpose(1, 2, 0))
    return np.asarray(cv2.GaussianBlur(edges, (0, 0), SMOOTH), dtype=np.float32)


def _steps(layers: Image, felt: NDArray[np.bool_]) -> NDArray[np.float32]:
    known = np.moveaxis(layers * felt, 2, 0)
    return np.asarray(0.5 * (known[:2] - known[2:]))


def grade_character(
    # (channels, rows, cols) edge map of its cell; equals the template's where the mark is as it should be
    felt: NDArray[np.floating],
    predicted: NDArray[np.floating],
    *,
    tolerance_px: int = 1,
    stroke_share: float = 0.3,
    felt_share: float = 0.4,
    least_felt: float = 0.1,
    # an edge where none is predicted is foreign from this share of the strongest predicted edge times the
    # contrast
    foreign_share: float = 0.5,
    # minimum of the contrast for `foreign_share`: noise about a faint mark is not dirt
    least_contrast: float = 0.3,
) -> MarkGrade | None:
    """Grade one character; None if the template predicts no edge."""
    felt, size = felt.astype(np.float64), np.abs(predicted).astype(np.float64)
    peak = float(size.max(initial=0.0))
    if peak == 0.0:
        return None
    stroke = size >= stroke_share * peak
    near = partial(ndimage.maximum_filter, size=(1, *(2 * tolerance_px + 1,) * 2), mode="nearest")
    along = size[stroke]
    answer = np.clip(np.where(predicted > 0.0, near(felt), near(-felt))[stroke] / along, 0.0, None)
    # the upper quartile: the filled strokes of a mark do not lower its contrast
    contrast = min(1.0, float(np.quantile(answer, 0.75, weights=along, method="inverted_cdf")))
    there = answer >= max(felt_share * contrast, least_felt)
    beside = ~near(size >= 0.1 * peak).any(axis=0)
    foreign = np.abs(felt).max(axis=0) >= foreign_share * peak * max(contrast, least_contrast)
    values = {
        "contrast": contrast,
        "completeness": float(along[there].sum() / along.sum()),
        "contamination": float((beside & foreign).mean()),
    }
    grades = {name: grade_value(name, value) for name, value in values.items()}
    parameters = tuple(Parameter(name, value, grades[name]) for name, value in values.items())
    return MarkGrade(parameters, _action(**grades))


def grade_value(name: str, value: float) -> int:
    """The grade, 4 to 0, of a parameter's value."""
    return sum(value <= limit if name == "contamination" else value >= limit for limit in LIMITS[name])


def _action(*, contrast: int, completeness: int, contamination: int) -> Action:
    shallow = contrast < PASSING
    if contamination < PASSING:
        return Action.CLEAN
    if completeness < PASSING:
        # if there is dirt beside the strokes, or the felt ones are deep enough, the missing ones are likely filled
        return Action.RE_STRIKE if shallow and contamination == 4 else Action.CLEAN_FIRST
    return Action.RE_STRIKE if shallow else Action.NONE
