"""Make readers from settings, and check jobs before they are used, in a worker, whose work is limited. A worker caches
readers, because making templates takes longer than reading a part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.errors import FileError, MarksError
from pipeline.common.file_stamp import FileStamp, stamp_if_there
from pipeline.common.job_file import SUFFIX, JobFile, files_of, job_of
from pipeline.common.serial_format import serial_format
from pipeline.common.settings import NamedLine, ReadSettings
from pipeline.errors import OwnFileError

if TYPE_CHECKING:
    from glyphs.fonts.glyph import Font
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from recognition.find.request import LineFormat
    from recognition.reader import Reader
    from recognition.see.virtual_array import VirtualArray

MOST_KEPT = 8  # readers; the least recently used is evicted


def reader_of(settings: ReadSettings, *, after_photo: bool = False) -> Reader:
    """The reader for these settings and the content of their files. `after_photo`: scans cover only the line that the
    camera saw, so that regions do not apply. Raises FileError, ValueError: as in `open_reader`."""
    # a file that is not there is reported when the reader is opened
    return _cached_reader(settings, tuple(map(stamp_if_there, files_of(settings))), after_photo)


@lru_cache(maxsize=MOST_KEPT)
def _cached_reader(settings: ReadSettings, _: tuple[FileStamp | None, ...], after_photo: bool) -> Reader:
    reader = open_reader(settings)
    return reader.after_photo() if after_photo else reader


def open_reader(settings: ReadSettings) -> Reader:
    """Open the reader of these settings.

    With a glyph database its fonts are used, or those of them that `font` names. Raises FileError: the lexicon or
    certificate cannot be used. MarksError: no sense in use keeps the accepted risk. SettingsError: settings contradict
    each other. ValueError: a font or the database cannot be used, or a font lacks characters of the format.
    """
    from pipeline.reading.certificate import acceptance_of
    from recognition.decide.depth_rules import depth_rule
    from recognition.language.orientation import Orientation
    from recognition.reader import Reader

    settings.check_accept_risk()
    return Reader(
        fonts=_fonts(settings),
        format=serial_format(settings),
        height_mm=settings.height_mm,
        array=virtual_array(settings),
        depth_rules=tuple(map(depth_rule, settings.depth_rule)),
        experts=settings.experts,
        region=settings.region,
        lines=lines_of(settings),
        certified=acceptance_of(settings),
        orientation=Orientation(settings.orientation),
        accept_risk=settings.accept_risk,
        limit_s=settings.limit_s,
    )


def virtual_array(settings: ReadSettings) -> VirtualArray:
    """The array that feels height maps. Raises FileError: the whisker's file cannot be used."""
    from recognition.see.virtual_array import VirtualArray
    from whisker_array.scan.sensor import Sensors

    usual = VirtualArray(sensors=Sensors(settings.sensors), given_speed_mm_s=settings.speed_mm_s)
    return usual if settings.whisker is None else with_whisker_file(usual, settings.whisker)


def with_whisker_file(array: VirtualArray, path: Path) -> VirtualArray:
    """The array with the whisker of a file and its speed, unless one is given. Raises FileError."""
    from pipeline.formats.whisker_file import read_whisker_file

    built = read_whisker_file(path)
    return replace(array, whisker=built.touch, whisker_speed_mm_s=built.speed_mm_s)


def find_height_mm(height_map: HeightMap, *, soil: Soil | None = None) -> float:
    """Find the character height by reading the part: dirt makes bands of its own. Raises MarksError: none found."""
    from recognition.reader import Reader

    reading = Reader().read(height_map, soil=soil)
    if not reading.characters or reading.decision.value == "reject":
        raise MarksError("no characters were found, so the scale is unknown", hint="give --height-mm")
    return float(f"{reading.height_mm:.3g}")


def lines_of(settings: ReadSettings) -> dict[str, LineFormat]:
    """The expected lines beside the serial, by name."""
    from recognition.find.request import LineFormat
    from recognition.language.grammar import Grammar

    lines = map(NamedLine.parse, settings.line)
    return {line.name: LineFormat(Grammar.parse(line.format), line.region) for line in lines}


def _fonts(settings: ReadSettings) -> tuple[str | Font, ...]:
    if settings.database is None:
        return settings.font
    from pipeline.formats.glyph_database import load_database

    enrolled = load_database(settings.database).fonts
    if not enrolled and not settings.font:
        raise FileError(settings.database, "holds no font", "add one with: tactile-marks glyphs build")
    fonts = tuple(font for name, font in enrolled.items() if not settings.font or name in settings.font)
    return (*fonts, *(name for name in settings.font if name not in enrolled))


def check_job(path: Path, written: Mapping[str, Any], digest: str = "") -> JobFile:
    """Read a job with these keys (its file need not exist), and check that everything named in it can be used. Raises
    OwnFileError: a file cannot be used. FileError: its settings cannot be used."""
    job = job_of(path, written, digest)
    try:
        open_reader(job.settings)
    except MarksError as error:
        if not isinstance(error, FileError):
            raise FileError(f"{job.name}{SUFFIX}", error.what, error.hint) from error
        is_ours = error.path in files_of(job.settings)
        raise (OwnFileError if is_ours else FileError)(error.path, error.what, error.hint) from error
    return job


def check_line(line_format: str, text: str) -> tuple[str, ...]:
    """Why a text does not match a format, in words; empty if it matches. Raises FormatError: an invalid format."""
    from recognition.language.grammar import Grammar

    return Grammar.parse(line_format).objections(text)
