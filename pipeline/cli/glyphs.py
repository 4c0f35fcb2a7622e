"""`tactile-marks glyphs`: the fonts."""

from __future__ import annotations

from pathlib import Path

from pipeline.cli.choices import FaceName
from pipeline.cli.exit_status import USAGE, CommandError, failures_reported


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


def show(*font: str, out: Path, face: FaceName = "flat", height_mm: float = 5.0) -> int:
    """Draw every character of fonts, and some as stamped relief.

    Parameters
    ----------
    font
        Built-in names or TTF/OTF files; all built-in fonts unless given.
    out
        Picture to write, .png, .svg or .pdf.
    face
        Face of the die.
    height_mm
        Character height.
    """
    with failures_reported():
        from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
        from glyphs.stamping.die import Face
        from glyphs.stamping.sheet import sheet_figure
        from pipeline.plots.pictures import check_picture, save_figure

        check_picture(out)
        fonts = [load_font(name) for name in font or BUILTIN_FONTS]
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
        from glyphs.fonts.outlines import load_font
        from glyphs.stamping.database import GlyphDatabase, save_database
        from pipeline.common.atomic import check_writable

        check_writable(out)
        fonts = [load_font(name) for name in font]
        save_database(GlyphDatabase(fonts={f.name: f for f in fonts}), out)
    print(f"wrote {out}: " + ", ".join(f"{f.name} ({len(f.glyphs)})" for f in fonts))
    return 0
