"""`tactile-marks glyphs` and `synth`: fonts, and parts stamped with them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from glyphs.errors import FileError
from pipeline.cli.exit_status import UsageError
from pipeline.cli.shared import Flag, Positive, write_picture
from pipeline.common.output_paths import PICTURES, check_writable
from pipeline.common.stamping import Stamping
from pipeline.common.texts import split_commas

if TYPE_CHECKING:
    from glyphs.fonts.glyph import Font


def list_fonts(database: Path | None = None) -> None:
    """List the built-in fonts, or those of a glyph database, with the number of their characters.

    Args:
        database: Glyph database.
    """
    from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
    from pipeline.formats.glyph_database import load_database

    content = None if database is None else load_database(database)
    for font in map(load_font, BUILTIN_FONTS) if content is None else content.fonts.values():
        stroke = f"stroke h x {font.stroke_ratio:.3g}" if font.stroke_ratio else "outlines"
        print(f"{font.name:<20} {len(font.glyphs):4d} characters  {stroke:<18}  {font.source}")
    if content is not None:
        print(f"{len(content.exemplars)} enrolled exemplars")


def show(*font: str, out: Path | None = None) -> None:
    """Draw every character of fonts.

    Args:
        font: Built-in names, TTF/OTF files or glyph databases (.glyphs); by default all built-in fonts.
        out: Picture to write, .png, .svg or .pdf (default: NAME.png in the working folder if one file or font is named,
            else fonts.png).
    """
    from glyphs.fonts.outlines import BUILTIN_FONTS
    from pipeline.plots.fonts_picture import sheet_figure

    out = out or Path(f"{Path(font[0]).stem if len(font) == 1 else 'fonts'}.png")
    check_writable(out, PICTURES)
    fonts = list(chain.from_iterable(map(_fonts_of, font or BUILTIN_FONTS)))
    write_picture(sheet_figure(fonts), out)


def build(out: Path, /, *font: str) -> None:
    """Write a glyph database of fonts for `read --database`.

    Args:
        out: Database to write.
        font: Built-in names or TTF/OTF files.
    """
    if not font:
        raise UsageError("glyphs build: name at least one font")
    from glyphs.fonts.outlines import load_font
    from pipeline.formats.glyph_database import GlyphDatabase, save_database

    check_writable(out)
    fonts = [load_font(name) for name in font]
    save_database(GlyphDatabase(fonts={f.name: f for f in fonts}), out)
    print(f"wrote {out}: " + ", ".join(f"{f.name} ({len(f.glyphs)})" for f in fonts))


def _fonts_of(name: str) -> list[Font]:
    from glyphs.fonts.outlines import load_font
    from pipeline.formats.glyph_database import load_database

    if Path(name).suffix.lower() != ".glyphs":
        return [load_font(name)]
    fonts = list(load_database(Path(name)).fonts.values())
    if not fonts:
        raise FileError(name, "holds no font", "enroll parts, or build it from fonts")
    return fonts


def synth(
    out: Path,
    /,
    *,
    parts: int,
    stamping: Annotated[Stamping, Parameter(name="*")],
    dirt: float = 0.0,
    soil: str = "workshop",
    mix: str = "",
    photo: bool = True,
    jobs: Positive = None,
    overwrite: Flag = False,
) -> None:
    """Stamp serials on plates: part-000.npz, part-000.png and so on, and truth.csv.

    Args:
        out: Folder for the parts.
        parts: Number of parts.
        dirt: Severity of the dirt, 0 to 1.
        soil: Kinds of dirt, separated by commas, the lowest layer first: workshop, caked, rust, paint, weld, mud, wear,
            casting, or module:function of your own. Workshop dirt is a mixture of seven kinds.
        mix: Amounts of these seven, 0 to 1, in place of their shares of the mixture, such as grime=0.5,oil=0: grime
            (caked into the grooves), oil, swarf, scratches, pits, paint (chipped), burr (a ragged rim).
        photo: Take a photograph of every part.
        jobs: Worker processes (default: one for each core), or none for a few parts.
        overwrite: Write into a folder that is not empty.
    """
    from dataclasses import replace
    from functools import partial

    from glyphs.soiling.soiled import Soiling
    from glyphs.soiling.workshop.mixture import Dirt
    from pipeline.formats.synth import SynthSpec, write_parts
    from pipeline.workers.executors import ordered_map
    from pipeline.workers.options import WorkerSettings

    mixture = replace(Dirt.of(dirt), **_amounts(mix, vars(Dirt.of(0.0)))) if mix else None
    spec = SynthSpec(**vars(stamping), soiling=Soiling(split_commas(soil), dirt, mixture=mixture))
    with WorkerSettings(jobs=jobs).opened(parts) as executor:
        each = partial(ordered_map, executor)
        written = write_parts(spec, out, parts=parts, photos=photo, overwrite=overwrite, each=each)
    print(f"wrote {len(written)} part{'s' if len(written) != 1 else ''} and truth.csv to {out}")


def _amounts(mix: str, kinds: Iterable[str]) -> dict[str, float]:
    try:
        amounts = {
            kind.strip(): float(amount) for kind, amount in (words.split("=") for words in split_commas(mix))
        }
    except ValueError as error:
        raise UsageError(f"--mix is {mix!r}", "write kinds and amounts, such as grime=0.5,oil=0") from error
    if unknown := [kind for kind in amounts if kind not in kinds]:
        raise UsageError(f"--mix has the unknown kind {unknown[0]!r}", f"the kinds are {', '.join(kinds)}")
    return amounts
