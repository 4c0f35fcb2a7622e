"""From settings to the reader that they ask for."""

from __future__ import annotations

from glyphs.outlines import Font
from pipeline.settings import ReadSettings
from recognition.depth_rules import DepthRule, depth_rule, least_depth
from recognition.reader import Reader, ReaderSettings
from whisker_array.traces import Fidelity


def open_reader(settings: ReadSettings) -> Reader:
    """The reader for these settings.

    With a glyph database its fonts compete, or those of them that `font` names; other names are built-in
    fonts or font files as without one.

    Raises:
        ValueError: a font, mask or database that cannot be used.
    """
    names = settings.font
    fonts: tuple[Font, ...] = ()
    if settings.database is not None:
        from glyphs.database import DatabaseError, load_database

        kept = load_database(settings.database).fonts
        if not kept and not names:
            raise DatabaseError(
                f"{settings.database} holds no font; add one with: tactile-marks glyphs build"
            )
        fonts = tuple(font for name, font in kept.items() if not names or name in names)
        names = tuple(name for name in names if name not in kept)
    return Reader(
        ReaderSettings(
            fonts=names,
            mask=settings.format,
            height_mm=settings.height_mm,
            fidelity=Fidelity(settings.fidelity),
            depth_rules=_depth_rules(settings),
        ),
        fonts=fonts,
    )


def _depth_rules(settings: ReadSettings) -> tuple[DepthRule, ...]:
    """The rule named and the depth given; either, both or none."""
    rules = []
    if settings.depth_rule is not None:
        rules.append(depth_rule(settings.depth_rule))
    if settings.min_depth_mm is not None:
        rules.append(least_depth(settings.min_depth_mm))
    return tuple(rules)
