"""Warm up a worker by a clean part in the settings' format, so that its first part takes no longer."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.common.settings import Limits, ReadSettings

PLAIN = "K4X7H2"  # not easily confused
PIXELS = 60.0  # per character height in the photograph


def warm_up(settings: ReadSettings, limits: Limits) -> None:
    """Load the libraries, make the readers and read a clean part by vision and touch; jobs report what is unusable."""
    from glyphs.camera.pose import Camera
    from glyphs.errors import FileError
    from glyphs.opencv import cv2
    from glyphs.part import stamp
    from glyphs.stamping.variation import StampingVariation
    from pipeline.formats.npz import write_npz
    from pipeline.formats.part_files import PartFiles
    from pipeline.formats.photos import write_photo
    from pipeline.reading.part_job import PartJob, read_sent

    cv2.setNumThreads(1)
    height_mm = settings.height_mm or 5.0
    part = stamp(_a_text(settings), height_mm=height_mm, variation=StampingVariation.none(), seed=1)
    photo = part.photograph(camera=Camera(pitch_mm=height_mm / PIXELS))
    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as name:
        folder = Path(name)
        files = PartFiles("part", str(folder / "part.npz"), photos=(str(folder / "part.png"),))
        write_npz(Path(files.height_map), part.height_map)
        write_photo(Path(files.photo), photo)
        with contextlib.suppress(FileError):
            read_sent(PartJob(files, settings, limits=limits, folder=folder))


def _a_text(settings: ReadSettings) -> str:
    from glyphs.errors import MarksError
    from glyphs.fonts.outlines import load_font
    from pipeline.common.serial_format import serial_format

    with contextlib.suppress(MarksError):
        grammar = serial_format(settings)
        lengths = None if grammar is None else grammar.lengths()
        places = grammar.places(min(lengths)) if grammar is not None and lengths else None
        known = load_font("gothic").glyphs
        if places and all(any(c in known for c in allowed) for allowed in places):
            return "".join(
                next(c for c in (*PLAIN, *allowed) if c in allowed and c in known) for allowed in places
            )
    return PLAIN[:4]
