"""`tactile-marks glyphs`: the fonts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.choices import FaceName
from pipeline.cli.exit_status import USAGE, CommandError, failures_reported

if TYPE_CHECKING:
    from glyphs.fonts.glyph import Font


def list_fonts(database: Path | None = None) -> int:
    """List the built-in fonts, or those of a glyph database, with the number of their characters.

    Parameters
    ----------
    database
        Glyph database.
    """
    with failures_reported():
        from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
        from glyphs.stamping.database import load_database

        if database is not None:
            content = load_database(database)
            fonts = list(content.fonts.values())
        else:
            fonts = [load_font(name) for name in BUILTIN_FONTS]
    for font in fonts:
        stroke = f"stroke h x {font.stroke_ratio:.3g}" if font.stroke_ratio else "outlines"
        print(f"{font.name:<20} {len(font.glyphs):4d} characters  {stroke:<18}  {font.source}")
    if database is not None:
        print(f"{len(content.dies)} dies, {len(content.exemplars)} enrolled exemplars")
    return 0


def show(*font: str, out: Path | None = None, face: FaceName = "flat", height_mm: float = 5.0) -> int:
    """Draw every character of fonts, and some as stamped relief.

    Parameters
    ----------
    font
        Built-in names, TTF/OTF files or glyph databases (.glyphs); by default all built-in fonts.
    out
        Picture to write, .png, .svg or .pdf. By default NAME.png here, of the only file or font that is named; else
        fonts.png.
    face
        Face of the die.
    height_mm
        Character height.
    """
    with failures_reported():
        from glyphs.fonts.outlines import BUILTIN_FONTS
        from glyphs.stamping.faces import Face
        from pipeline.plots.font_sheet import sheet_figure
        from pipeline.plots.pictures import check_picture, save_figure

        out = out or Path(f"{Path(font[0]).stem if len(font) == 1 else 'fonts'}.png")
        check_picture(out)
        fonts = [one for name in font or BUILTIN_FONTS for one in _fonts_of(name)]
        save_figure(sheet_figure(fonts, die_face=Face(face), height_mm=height_mm), out)
    print(f"wrote {out}")
    return 0


def build(out: Path, *font: str) -> int:
    """Write a glyph database of fonts, to be given to `read --database`.

    Parameters
    ----------
    out
        Database to write.
    font
        Built-in names or TTF/OTF files.
    """
    if not font:
        raise CommandError("glyphs build: name at least one font", status=USAGE)
    with failures_reported():
        from glyphs.atomic import check_writable
        from glyphs.fonts.outlines import load_font
        from glyphs.stamping.database import GlyphDatabase, save_database

        check_writable(out)
        fonts = [load_font(name) for name in font]
        save_database(GlyphDatabase(fonts={f.name: f for f in fonts}), out)
    print(f"wrote {out}: " + ", ".join(f"{f.name} ({len(f.glyphs)})" for f in fonts))
    return 0


def _fonts_of(name: str) -> list[Font]:
    """The fonts of a glyph database, or the one that a name or file means."""
    from glyphs.fonts.outlines import load_font
    from glyphs.stamping.database import DatabaseError, load_database

    if Path(name).suffix.lower() != ".glyphs":
        return [load_font(name)]
    fonts = list(load_database(Path(name)).fonts.values())
    if not fonts:
        raise DatabaseError(f"{name} holds no font", hint="enroll parts, or build it from fonts")
    return fonts
