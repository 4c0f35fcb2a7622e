"""Warming up: a worker's first part should take no longer than the next one."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.files.limits import Limits


def warm_up(settings: ReadSettings, limits: Limits) -> None:
    """Load the libraries, make the readers of these settings and read a small clean part by vision and touch.

    Settings or fonts that cannot be used do not matter here: every job tells.
    """
    from glyphs.camera.pose import Camera
    from glyphs.errors import FileError
    from glyphs.opencv import cv2
    from pipeline.files.npz import write_npz
    from pipeline.files.photos import write_photo
    from pipeline.files.synth import SynthSpec, make_part
    from pipeline.reading.jobs import Job, read_job

    cv2.setNumThreads(1)
    spec = SynthSpec("AA99", seed=1, height_mm=settings.height_mm or 5.0, variation=False)
    part = make_part(spec, 0)
    photo = part.photograph(camera=Camera(pitch_mm=spec.height_mm / 60.0))
    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as name:
        folder = Path(name)
        write_npz(folder / "part.npz", part.height_map)
        write_photo(folder / "part.png", photo)
        # with the format of the settings, of which this part is none: it is looked at all the same
        with contextlib.suppress(FileError):
            read_job(Job(folder, photo=folder / "part.png", height_map=folder / "part.npz"), settings, limits)
