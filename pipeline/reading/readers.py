"""From settings to the readers that they ask for."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from glyphs.fonts.outlines import Font
from pipeline.common.settings import ReadSettings
from pipeline.files.units import Unit
from recognition.depth_rules import DepthRule, depth_rule, least_depth
from recognition.reader import Reader, ReaderSettings

if TYPE_CHECKING:
    from recognition.grammar import Grammar
    from recognition.vision import VisionReader


class Readers:
    """The readers of touch and of sight, made when first needed and kept with their templates."""

    def __init__(self, settings: ReadSettings) -> None:
        """Take the settings; load fonts and lexicon.

        With a glyph database its fonts compete, or those of them that `font` names; other names are built-in
        fonts or font files as without one.

        Raises:
            FileError: a lexicon that cannot be used.
            SettingsError: settings that contradict each other.
            ValueError: a database that cannot be used.
        """
        from pipeline.common.serial_format import serial_format
        from whisker_array.simulation.traces import Fidelity

        names, self.fonts = _fonts(settings)
        self.unit = Unit(settings.unit)
        self._open: dict[tuple[str, ...], VisionReader] = {}
        thresholds: dict[str, Any] = {
            key: value
            for key in ("accept_confidence", "accept_margin")
            if (value := getattr(settings, key)) is not None
        }
        self.grammar: Grammar | None = serial_format(settings)
        self.told = ReaderSettings(
            fonts=names,
            grammar=self.grammar,
            height_mm=settings.height_mm,
            fidelity=Fidelity(settings.fidelity),
            depth_rules=_depth_rules(settings),
            **thresholds,
        )

    @cached_property
    def touch(self) -> Reader:
        """Reads height maps and scans.

        Raises:
            ValueError: a font that cannot be used, or that lacks what the format needs.
        """
        return Reader(self.told, fonts=self.fonts)

    @cached_property
    def vision(self) -> VisionReader:
        """Reads photographs.

        Raises:
            ValueError: as `touch`.
        """
        from recognition.vision import VisionReader

        return VisionReader(self.told, fonts=_whole(self.fonts))

    def open_vision(self, expected: str) -> VisionReader:
        """Reads photographs for verification: any character at as many places as the text has.

        Raises:
            ValueError: as `touch`.
        """
        from recognition.grammar import Grammar
        from recognition.remainders import ALPHANUMERIC
        from recognition.vision import VisionReader

        text = "".join(expected.split())
        chars = "".join(sorted({*ALPHANUMERIC, *text}))
        sets = (chars,) * len(text)
        if sets not in self._open:
            told = replace(self.told, grammar=Grammar(sets=sets))
            self._open[sets] = VisionReader(told, fonts=_whole(self.fonts))
        return self._open[sets]


def open_reader(settings: ReadSettings) -> Reader:
    """The reader of touch for these settings.

    Raises:
        FileError: a lexicon that cannot be used.
        SettingsError: settings that contradict each other.
        ValueError: a font, format or database that cannot be used.
    """
    return Readers(settings).touch


def _fonts(settings: ReadSettings) -> tuple[tuple[str, ...], tuple[Font, ...]]:
    """Names still to be loaded, and the fonts out of the database."""
    if settings.database is None:
        return settings.font, ()
    from glyphs.stamping.database import DatabaseError, load_database

    kept = load_database(settings.database).fonts
    if not kept and not settings.font:
        raise DatabaseError(
            f"{settings.database} holds no font", hint="add one with: tactile-marks glyphs build"
        )
    fonts = tuple(font for name, font in kept.items() if not settings.font or name in settings.font)
    return tuple(name for name in settings.font if name not in kept), fonts


def _whole(fonts: tuple[Font, ...]) -> tuple[Font, ...]:
    """The fonts without those learned in part, unless there are no others.

    Touch doubts what may be a character that was never felt (`recognition.unseen_glyphs`); sight cannot.
    """
    from recognition.reader import ALPHABET

    whole = tuple(f for f in fonts if not any(f.glyphs[c].guessed for c in ALPHABET if c in f.glyphs))
    return whole or fonts


def _depth_rules(settings: ReadSettings) -> tuple[DepthRule, ...]:
    """The rule named and the depth given; either, both or none."""
    rules = []
    if settings.depth_rule is not None:
        rules.append(depth_rule(settings.depth_rule))
    if settings.min_depth_mm is not None:
        rules.append(least_depth(settings.min_depth_mm))
    return tuple(rules)
