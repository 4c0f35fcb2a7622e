"""The photograph laid over the map of touch."""

from __future__ import annotations

import numpy as np

from glyphs.fonts.glyph import Font, FontError
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from recognition.reader_settings import ReaderSettings
from recognition.reading import Reading
from recognition.register import Registration, matched_boxes, register, same_field
from recognition.register_line import register_line
from recognition.tactile_line import FeltLine, felt_line
from recognition.vision_templates import VisionBasis, predict_basis


def registered(touch: Reading, vision: Reading, line: FeltLine | None = None) -> Registration | None:
    """Vision laid over touch, by touch's characters where there are any; None without edge maps of both."""
    ours, theirs = touch.trace, vision.trace
    if ours.edge_map is None or theirs.edge_map is None:
        return None
    starts = [np.eye(3), same_field(ours.edge_map, theirs.edge_map)]
    if (
        ours.lattice is not None
        and theirs.lattice is not None
        and ours.lattice.boxes
        and len(ours.lattice.boxes) == len(theirs.lattice.boxes)
    ):
        from_boxes = matched_boxes(ours.lattice.boxes, theirs.lattice.boxes)
        if from_boxes is not None:
            starts.append(from_boxes)
    if line is not None:
        return register_line(line, theirs.edge_map, starts)
    return register(ours.edge_map, theirs.edge_map, height_mm=touch.height_mm, starts=starts)


def line_of(touch: Reading, settings: ReaderSettings) -> FeltLine | None:
    """The line of touch with pictures of its font; None where that is not known or does not fit the marks."""
    lattice = touch.trace.lattice
    if lattice is None or touch.height_mm <= 0.0:
        return None
    font = _font(touch.font, settings)
    if font is None:
        return None
    chars = tuple(c for c in lattice.chars if c in font.glyphs)
    return felt_line(
        lattice, _basis(font, "".join(chars)), height_mm=touch.height_mm, rotation_deg=touch.rotation_deg
    )


def _font(name: str, settings: ReaderSettings) -> Font | None:
    for given in settings.fonts or BUILTIN_FONTS:
        try:
            font = given if isinstance(given, Font) else load_font(given)
        except FontError:
            continue
        if font.name == name:
            return font
    return None


_BASES: dict[tuple[str, str], VisionBasis] = {}
_MOST_BASES = 8


def _basis(font: Font, chars: str) -> VisionBasis:
    """Pictures of a font, kept from part to part."""
    key = (font.name, chars)
    if key not in _BASES:
        while len(_BASES) >= _MOST_BASES:
            _BASES.pop(next(iter(_BASES)))
        _BASES[key] = predict_basis(font, chars)
    return _BASES[key]
