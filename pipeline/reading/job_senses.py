"""The senses of one job: what is loaded, seen and felt of a part, each within the limits.

Frames. A photograph by itself is read in its own frame: x, y in mm from its first pixel, where its scale is known. A
plan for touch is made in that frame, and a recording of that plan comes in it, too. A height map has a frame of its
own; the middle of the picture is then taken to lie over the middle of the map, as with `tactile-marks read`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from pipeline.common.records import ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.files.limits import check_map, check_photo, check_scan
from pipeline.files.units import Unit
from pipeline.reading.jobs import Job, Limits, named_problems
from pipeline.reading.photo_sizes import read_at_sizes
from pipeline.reading.vision_file import KeptVision, load_vision, moved

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import HeightMap
    from recognition.reader import Reader
    from recognition.reading import Reading


@dataclass(frozen=True, eq=False)
class Seen:
    """What the camera's reader made of a photograph.

    Attributes:
        vision: its reading, with the verdict on the text expected if there is one.
        kept: what a later job needs of it.
        seconds: it took.
    """

    vision: Reading
    kept: KeptVision
    seconds: float

    @property
    def photo(self) -> Photo:
        """As it was read: in the frame and at the size."""
        assert self.vision.trace.photo is not None
        return self.vision.trace.photo

    @property
    def height_mm(self) -> float:
        """Of the characters; 0 where no line was found."""
        return self.vision.trace.place.height_mm if self.vision.trace.place is not None else 0.0


class JobSenses:
    """Sees and feels the part of one job."""

    def __init__(self, job: Job, reader: Reader, limits: Limits, settings: ReadSettings) -> None:
        """Take the job.

        Raises:
            FileError: an expected text that the format does not allow.
        """
        self.job, self.reader, self.limits, self.settings = job, reader, limits, settings
        self.expected = job.expected.strip()
        if self.expected and reader.grammar is not None:
            broken = reader.grammar.objections(self.expected)
            if broken:
                raise FileError("expected", f"is {self.expected!r}, but {'; '.join(broken)}", "correct it")

    def load_photo(self) -> Photo:
        """The photograph.

        Raises:
            FileError: it cannot be used.
        """
        from pipeline.files.photos import read_photo

        path = self._path("photo")
        with named_problems(self.job, "photo", path):
            check_photo(path, most=self.limits.max_photo_pixels)
            return read_photo(path)

    def see(self, photo: Photo | None = None, *, over: HeightMap | None = None) -> Seen:
        """Read the photograph.

        Args:
            photo: already loaded; loaded unless given.
            over: height map whose middle lies under the middle of the picture.

        Raises:
            FileError: it cannot be used.
        """
        from recognition.reader import centred

        started = time.perf_counter()
        photo = photo if photo is not None else self.load_photo()
        if over is not None:
            photo = centred(photo, over)
        with named_problems(self.job, "photo", self.job.photo):
            vision = read_at_sizes(photo, self.reader.vision.read_photo)
            if self.expected:
                vision = self.reader.opened(vision, self.expected)
        kept = KeptVision.of(vision, expected=self.expected)
        return Seen(self.verified(vision), kept, time.perf_counter() - started)

    def remembered(self) -> KeptVision:
        """What an earlier job saw.

        Raises:
            FileError: it cannot be used.
        """
        path = self._path("vision")
        with named_problems(self.job, "vision", path):
            return load_vision(path)

    def feel(self) -> Reading:
        """Read by touch; a recorded scan goes before a height map.

        Raises:
            FileError: the file cannot be used.
        """
        from pipeline.files.parts import Part
        from pipeline.reading.part_reader import felt

        job = self.job
        what = "scan" if job.scan is not None else "height_map"
        path = self._path(what)
        name = job.part_name or Path(job.name_of(what)).stem
        with named_problems(job, what, path):
            if job.scan is not None:
                check_scan(path, most=self.limits.max_scan_samples)
                return felt(Part(name, scan=path), self.reader.touch)
            named = _with_suffix(path, Path(job.name_of(what)).suffix, job.folder)
            check_map(named, most=self.limits.max_map_samples)
            return felt(Part(name, height_map=named), self.reader.touch, unit=Unit(self.settings.unit))

    def fused(self, touch: Reading, seen: Seen | KeptVision) -> Reading:
        """Both senses' word.

        Raises:
            FileError: a text that cannot be looked for, or beliefs that cannot be joined.
        """
        kept = seen if isinstance(seen, KeptVision) else seen.kept
        surface = touch.trace.height_map
        if isinstance(seen, KeptVision) and surface is not None and kept.middle_mm is not None:
            width, height = surface.size_mm
            kept = moved(kept, 0.5 * width - kept.middle_mm[0], 0.5 * height - kept.middle_mm[1])
        with named_problems(self.job, "vision", self.job.vision):
            return self.verified(self.reader.fuse(touch, kept.vision_for(self.expected)))

    def record(self, reading: Reading, seconds: float) -> ReadingRecord:
        """The record of a reading of this job."""
        from pipeline.reading.as_record import reading_record

        settings = self.settings
        if self.job.database is not None:
            settings = settings.model_copy(update={"database": self.job.database})
        return reading_record(
            reading, settings, self.reader.grammar, part=self.job.part_name, seconds=seconds
        )

    def verified(self, reading: Reading) -> Reading:
        """The reading, with the verdict on the text expected if there is one.

        Raises:
            FileError: a text that cannot be looked for.
        """
        if not self.expected:
            return reading
        with named_problems(self.job, "expected", None):
            return self.reader.verify(reading, self.expected)

    def _path(self, what: str) -> Path:
        path: Path | None = getattr(self.job, what)
        if path is None:
            raise ValueError(f"the job has no {what}")
        return path


def _with_suffix(path: Path, suffix: str, folder: Path) -> Path:
    """The file under the suffix that its sender gave it, which tells its format."""
    from pipeline.files.touch_file import is_height_map

    named = Path(f"height_map{suffix.lower()}")
    if not is_height_map(named):
        raise FileError(
            path,
            f"is of no format known for height maps ({suffix or 'no suffix'})",
            "save it as .npz or .x3p",
        )
    if path.suffix.lower() == suffix.lower():
        return path
    link = folder / named
    link.unlink(missing_ok=True)
    link.symlink_to(path.resolve())
    return link
