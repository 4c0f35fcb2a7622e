"""The photograph laid over what was felt: registration, and sight's beliefs at the places of touch."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, FontError
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.reader import ReaderSettings, ReadingTrace
from recognition.register import Registration, matched_boxes, register, same_field
from recognition.register_line import register_line
from recognition.tactile_line import FeltLine, felt_line
from recognition.vision import VisionReading
from recognition.vision_at import vision_at
from recognition.vision_templates import VisionBasis, predict_basis


def registered(
    touch: ReadingTrace, vision: VisionReading, line: FeltLine | None = None
) -> Registration | None:
    """Sight laid over touch, by the characters felt where there are any; None without edge maps of both."""
    if touch.edge_map is None or vision.edges is None:
        return None
    starts = [np.eye(3), same_field(touch.edge_map, vision.edges)]
    if (
        touch.lattice is not None
        and vision.lattice is not None
        and touch.lattice.boxes
        and len(touch.lattice.boxes) == len(vision.lattice.boxes)
    ):
        from_boxes = matched_boxes(touch.lattice.boxes, vision.lattice.boxes)
        if from_boxes is not None:
            starts.append(from_boxes)
    if line is not None:
        return register_line(line, vision.edges, starts)
    return register(touch.edge_map, vision.edges, height_mm=touch.reading.height_mm, starts=starts)


def seen_at(
    line: FeltLine, vision: VisionReading, where: Registration, allowed: NDArray[np.bool_] | None = None
) -> Lattice:
    """Posteriors of sight at the places of touch; "nothing readable" competes as a character of no edges.

    Raises:
        ValueError: sight has no edge map.
    """
    if vision.edges is None:
        raise ValueError("sight has no edge map; read the photograph first")
    evidence = vision_at(line, vision.edges, where.plate_from_photo, allowed=allowed)
    if allowed is not None:
        evidence = np.where(allowed, evidence, -np.inf)
    count = np.isfinite(evidence).sum(axis=1)
    total = np.logaddexp.reduce(evidence, axis=1)
    nothing = np.log(np.maximum(count, 1))
    return Lattice(line.basis.chars, evidence - np.logaddexp(total, nothing)[:, None])


def line_of(touch: ReadingTrace, settings: ReaderSettings, fonts: Sequence[Font]) -> FeltLine | None:
    """The line of touch with pictures of its font; None where that is not known or does not fit the marks."""
    if touch.lattice is None or touch.reading.height_mm <= 0.0:
        return None
    font = _font(touch.reading.font, settings, fonts)
    if font is None:
        return None
    chars = tuple(c for c in touch.lattice.chars if c in font.glyphs)
    return felt_line(
        touch.lattice,
        _basis(font, "".join(chars)),
        height_mm=touch.reading.height_mm,
        rotation_deg=touch.reading.rotation_deg,
    )


def _font(name: str, settings: ReaderSettings, fonts: Sequence[Font]) -> Font | None:
    for font in fonts:
        if font.name == name:
            return font
    for given in settings.fonts or BUILTIN_FONTS:
        try:
            font = _loaded(given)
        except FontError:
            continue
        if font.name == name:
            return font
    return None


@lru_cache(maxsize=16)
def _loaded(name: str) -> Font:
    return load_font(name)


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


def allowed_at(grammar: Grammar | None, n_places: int, chars: tuple[str, ...]) -> NDArray[np.bool_] | None:
    """(places, chars) what the format lets stand where; None where it says nothing of so many places."""
    if grammar is None:
        return None
    lengths = grammar.lengths()
    if lengths is not None and n_places not in lengths:
        return None
    sets = grammar.strings(n_places, chars).places()
    table = np.array([[c in place for c in chars] for place in sets], dtype=np.bool_)
    return table if table.shape == (n_places, len(chars)) and table.any(axis=1).all() else None
