"""Reasons why the depth of a character was not measured."""

from __future__ import annotations

from glyphs.surface.display import WordedEnum


class NoDepth(WordedEnum):
    """Reasons why touch measured no depth, and what to do."""

    # no known font has the strokes that were felt, or dirt makes their depth uneven
    FONT = "font", "name the font"
    # too little of the character, or of the land beside it, was felt
    NOT_FELT = "not felt", "scan it again"
    SATURATED = "saturated", "lower the gain, scan it again"
