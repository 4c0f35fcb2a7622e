"""Make readers from settings; a worker caches them, because making templates takes longer than reading a part."""

from __future__ import annotations

from functools import lru_cache

from glyphs.errors import FileError
from glyphs.fonts.glyph import Font
from pipeline.common.file_stamp import FileStamp, stamp_if_there
from pipeline.common.job_file import files_of
from pipeline.common.serial_format import serial_format
from pipeline.common.settings import NamedLine, ReadSettings
from pipeline.reading.certificate import acceptance_of
from recognition.decide.depth_rules import DepthRule, depth_rule, least_depth
from recognition.find.request import LineFormat
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from whisker_array.scan.sensor import Sensors
from whisker_array.simulation.traces import Fidelity

MOST_KEPT = 8
"""Most readers kept; the least recently used is evicted."""


def reader_of(settings: ReadSettings, *, after_photo: bool = False) -> Reader:
    """The reader for these settings and the present content of the files that they name.

    Args:
        settings: settings of the readers.
        after_photo: whether scans cover only the line that the camera saw, so that regions do not apply.

    Raises:
        FileError: the lexicon cannot be used.
        ValueError: the database or a font cannot be used.
    """
    # a file that is not there is reported when the reader is opened
    return _cached_reader(settings, tuple(map(stamp_if_there, files_of(settings))), after_photo)


@lru_cache(maxsize=MOST_KEPT)
def _cached_reader(settings: ReadSettings, _: tuple[FileStamp | None, ...], after_photo: bool) -> Reader:
    reader = open_reader(settings)
    return reader.after_photo() if after_photo else reader


def open_reader(settings: ReadSettings) -> Reader:
    """Open the reader of these settings.

    With a glyph database its fonts are used, or those of them that `font` names. Other names in `font` are built-in
    fonts or font files.

    Raises:
        FileError: the lexicon or certificate cannot be used.
        MarksError: no sense in use keeps the accepted risk.
        SettingsError: settings contradict each other.
        ValueError: a font cannot be used or lacks characters of the format, or the database cannot be used.
    """
    settings.check_accept_risk()
    return Reader(
        fonts=_fonts(settings),
        format=serial_format(settings),
        height_mm=settings.height_mm,
        array=virtual_array(settings),
        depth_rules=_depth_rules(settings),
        experts=settings.experts,
        region=settings.region,
        lines=lines_of(settings),
        certified=acceptance_of(settings),
        orientation=Orientation(settings.orientation),
        accept_risk=settings.accept_risk,
    )


def virtual_array(settings: ReadSettings) -> VirtualArray:
    """The array that feels height maps.

    Raises:
        FileError: the whisker's file cannot be used.
    """
    whisker = None
    if settings.whisker is not None:
        from pipeline.formats.whisker_file import read_whisker_file

        whisker = read_whisker_file(settings.whisker).touch
    return VirtualArray(whisker, Sensors(settings.sensors), Fidelity(settings.fidelity))


def lines_of(settings: ReadSettings) -> dict[str, LineFormat]:
    """The expected lines beside the serial, by name."""
    lines = map(NamedLine.parse, settings.line)
    return {line.name: LineFormat(Grammar.parse(line.format), line.region) for line in lines}


def _fonts(settings: ReadSettings) -> tuple[str | Font, ...]:
    """Fonts from the database, and names of others to load."""
    if settings.database is None:
        return settings.font
    from pipeline.formats.glyph_database import load_database

    kept = load_database(settings.database).fonts
    if not kept and not settings.font:
        raise FileError(settings.database, "holds no font", "add one with: tactile-marks glyphs build")
    fonts = tuple(font for name, font in kept.items() if not settings.font or name in settings.font)
    return (*fonts, *(name for name in settings.font if name not in kept))


def _depth_rules(settings: ReadSettings) -> tuple[DepthRule, ...]:
    """The depth rules of the settings, and the least depth as one more."""
    rules = [depth_rule(text) for text in settings.depth_rule]
    if settings.min_depth_mm is not None:
        rules.append(least_depth(settings.min_depth_mm))
    return tuple(rules)
