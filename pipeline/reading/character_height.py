"""The character height of a height map that is scanned without one."""

from __future__ import annotations

from glyphs.errors import MarksError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from recognition.decide.decision import Decision
from recognition.reader import Reader


def find_height_mm(height_map: HeightMap, *, soil: Soil | None = None) -> float:
    """Find the character height by reading the part. Raises MarksError: no characters were found.

    Dirt makes bands of its own, and only a reading finds the band that is the line.
    """
    reading = Reader().read(height_map, soil=soil)
    if not reading.characters or reading.decision is Decision.REJECT:
        raise MarksError("no characters were found, so the scale is unknown", hint="give --height-mm")
    return float(f"{reading.height_mm:.3g}")
