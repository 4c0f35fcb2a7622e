"""Fonts whose templates find and read lines, and how far they are searched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face

if TYPE_CHECKING:
    from recognition.glyph_match.predicted import TemplateKey, TemplateSet


@dataclass(frozen=True)
class MarkStyle:
    """Appearance of a font on a part: kind of face, and whether the marks are raised."""

    face: Face = Face.FLAT
    raised: bool = False


STYLES = (MarkStyle(), MarkStyle(raised=True), MarkStyle(face=Face.DOTTED))
"""Appearances that are searched, most frequent first."""


@dataclass(frozen=True, kw_only=True)
class MatchingLimits:
    """Resolution and range of a search by templates."""

    sketch_pixels: int = 8  # for each character height, to compare sizes and rows
    coarse_pixels: int = 16  # to find lines
    fine_pixels: int = 32  # to read them
    smallest: float = 0.13  # and largest character height, shares of the view's smaller side
    largest: float = 0.95
    size_step: float = 1.1
    first_sizes: int = 3
    most_sizes: int = 9
    # share of what the best size, or line in another layout, explains from which another one is looked at
    least_explained: float = 0.6
    most_lines: int = 3
    apart_heights: float = 1.1
    # margin that is read before and after a line, in case it has more characters; character heights
    beyond_heights: float = 1.0
    most_rereads: int = 3
    # a line is read again if a character lies further from its row than this, character heights
    off_heights: float = 0.06


@dataclass(frozen=True, eq=False)
class TemplateFonts:
    """Fonts whose templates find and read lines; `predict` should cache them."""

    fonts: Sequence[Font]
    predict: Callable[[Font, str, TemplateKey], TemplateSet]
    matching: MatchingLimits = MatchingLimits()

    def in_style(self, style: MarkStyle) -> list[Font]:
        """Fonts that can have a style: dots need strokes."""
        return [font for font in self.fonts if style.face is not Face.DOTTED or font.stroke_ratio > 0.0]
