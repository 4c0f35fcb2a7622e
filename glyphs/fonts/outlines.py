"""Sources of glyphs: the built-in gothic, Hershey's engraving letters, and TrueType or OpenType files. `rowmans`,
`rowmand` and `rowmant` are left out: their strokes are those of `futural`, `futuram` and `timesrb`."""

from __future__ import annotations

import json
import logging
import string
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from glyphs.fonts.font_files import is_font_file
from glyphs.fonts.glyph import Font, FontError, Glyph, Points, with_stroke

BUILTIN_FONTS: tuple[str, ...] = ("gothic", "futural", "futuram", "timesr", "timesrb")
"""Names of built-in fonts, the usual steel-stamp letter first."""

SERIAL_CHARACTERS = string.ascii_uppercase + string.digits

_GOTHIC = Path(__file__).with_name("gothic.json")
"""Centre lines of the gothic font, with a description of the format."""
_HERSHEY_STROKE = {"futural": 0.14, "futuram": 0.10, "timesr": 0.075, "timesrb": 0.075}
_HERSHEY_CHARACTERS = string.ascii_letters + string.digits + "-/.+&()#*:,=' "
_FONT_CHARACTERS = string.ascii_letters + string.digits + string.punctuation + " "
_FLATNESS = 0.002  # cap heights: a hundredth of a millimetre at 5 mm, far below a die's edge radius
_ARC_STEP_DEG = 6.0  # sagitta 0.0007 cap heights on the largest arc


def load_font(name_or_path: str | Path) -> Font:
    """Load a font by its built-in name, or from a TTF, OTF or TTC (its first face) file; cached. Raises FontError."""
    name = str(name_or_path)
    if name in BUILTIN_FONTS:
        return _builtin(name)
    path = Path(name_or_path)
    known = ", ".join(BUILTIN_FONTS)
    if isinstance(name_or_path, str) and not is_font_file(name):
        hint = f"the built-in fonts are {known}; anything else must be the path of a .ttf, .otf or .ttc file"
        raise FontError(f"unknown font {name!r}", hint=hint)
    if not path.is_file():
        raise FontError(f"font file {name!r} is missing", hint=f"check the path or use a built-in: {known}")
    stat = path.stat()
    return _from_file(str(path.resolve()), stat.st_mtime_ns, stat.st_size)


@cache
def _builtin(name: str) -> Font:
    return _gothic_font() if name == "gothic" else _hershey_font(name)


def _flatten(stroke: list[list[float]]) -> Points:
    parts: list[Points] = []
    for step in stroke:
        if len(step) > 2:
            cx, cy, rx, ry, start_deg, end_deg = step
            count = max(2, int(np.ceil(abs(end_deg - start_deg) / _ARC_STEP_DEG)) + 1)
            angle = np.radians(np.linspace(start_deg, end_deg, count))
            parts.append(np.column_stack([cx + rx * np.cos(angle), cy + ry * np.sin(angle)]))
        else:
            parts.append(np.array([step], dtype=np.float64))
    points = np.concatenate(parts)
    fresh = np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-9)
    return np.asarray(points[fresh], dtype=np.float64)


def _gothic_font() -> Font:
    drawn, glyphs = json.loads(_GOTHIC.read_text(encoding="utf-8")), {}
    bearing, ratio = drawn["bearing"], drawn["stroke_ratio"]
    for char, (width, strokes) in drawn["characters"].items():
        lines = tuple(_flatten(s) + np.array([bearing, 0.0]) for s in strokes)
        glyphs[char] = with_stroke(Glyph(char, strokes=lines, advance=width + 2 * bearing), ratio)
    return Font("gothic", glyphs, ratio, "built in, after ISO 3098 type B and DIN 1451")


def _hershey_font(name: str) -> Font:
    from HersheyFonts import HersheyFonts

    hershey = HersheyFonts()
    hershey.load_default_font(name)
    source = hershey.all_glyphs
    ratio = _HERSHEY_STROKE[name]
    glyphs = {}
    for char in _HERSHEY_CHARACTERS:
        raw = source.get(char)
        if raw is None:
            continue
        unit = float(raw.base_line - raw.cap_line)
        lines = []
        for stroke in raw.strokes:
            p = np.asarray(stroke, dtype=np.float64)
            # Hershey's y runs down from mid cap height.
            lines.append(np.column_stack([p[:, 0] - raw.left_offset, raw.base_line - p[:, 1]]) / unit)
        plain = Glyph(char, strokes=tuple(lines), advance=raw.char_width / unit)
        glyphs[char] = with_stroke(plain, ratio)
    return Font(name, glyphs, ratio, f"Hershey {name}")


@lru_cache(maxsize=32)
def _from_file(path: str, mtime_ns: int, size: int) -> Font:
    from fontTools.ttLib import TTFont

    # fontTools warns of odd dates in a font's header, which are not used here
    logging.getLogger("fontTools.ttLib.tables._h_e_a_d").setLevel(logging.ERROR)
    try:
        with TTFont(path, fontNumber=0, lazy=True) as file:
            return _outlined_font(file, path)
    except FontError:
        raise
    except Exception as error:  # on a damaged file, fontTools raises any exception
        raise FontError(
            f"font file {path!r} cannot be read ({type(error).__name__}: {error})",
            hint="it is damaged or not a TrueType or OpenType font, get a fresh copy",
        ) from error


def _outlined_font(file: object, path: str) -> Font:
    from glyphs.fonts.flatten import read_outlines

    face, outlines = read_outlines(file, _FONT_CHARACTERS, flatness=_FLATNESS)
    glyphs = {
        char: Glyph(char, contours=contours, advance=advance)
        for char, (contours, advance) in outlines.items()
        if contours or char == " "
    }
    if not set(SERIAL_CHARACTERS) & set(glyphs):
        raise FontError(f"font file {path!r} has none of the characters A-Z and 0-9", hint="use a Latin font")
    return Font(face or Path(path).stem, glyphs, 0.0, path)
