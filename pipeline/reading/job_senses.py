"""The senses of one job: what is loaded, seen and felt of a part, each within the limits.

Frames. A photograph by itself is read in its own frame: x, y in mm from its first pixel, where its scale is known. A
plan for touch is made in that frame, and a recording of that plan comes in it, too. A height map has a frame of its
own; the middle of the picture is then taken to lie over the middle of the map, as with `tactile-marks read`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from pipeline.common.records import ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.files.limits import check_map, check_photo, check_scan
from pipeline.reading.jobs import Job, Limits, told
from pipeline.reading.photo_sizes import read_at_sizes
from pipeline.reading.vision_file import KeptVision, load_vision, moved

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import HeightMap
    from pipeline.reading.part_reader import Sensed
    from pipeline.reading.readers import Readers
    from recognition.lattice import Lattice
    from recognition.reader import ReadingTrace
    from recognition.vision import VisionReading


@dataclass(frozen=True, eq=False)
class Seen:
    """What the camera's reader made of a photograph.

    Attributes:
        sensed: its reading, held against the text expected if there is one.
        photo: as it was read: in the frame and at the size.
        kept: what a later job needs of it.
        seconds: it took.
    """

    sensed: Sensed
    photo: Photo
    kept: KeptVision
    seconds: float

    @property
    def vision(self) -> VisionReading:
        """As the reader gave it."""
        return self.kept.vision

    @property
    def height_mm(self) -> float:
        """Of the characters; 0 where no line was found."""
        return self.vision.place.height_mm if self.vision.place is not None else 0.0


class JobSenses:
    """Sees and feels the part of one job."""

    def __init__(self, job: Job, readers: Readers, limits: Limits, settings: ReadSettings) -> None:
        """Take the job.

        Raises:
            FileError: an expected text that the format does not allow.
        """
        self.job, self.readers, self.limits, self.settings = job, readers, limits, settings
        self.expected = job.expected.strip()
        if self.expected and readers.grammar is not None:
            broken = readers.grammar.objections(self.expected)
            if broken:
                raise FileError("expected", f"is {self.expected!r}, but {'; '.join(broken)}", "mend it")

    def load_photo(self) -> Photo:
        """The photograph.

        Raises:
            FileError: it cannot be used.
        """
        from pipeline.files.photos import read_photo

        path = self._path("photo")
        with told(self.job, "photo", path):
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
        from pipeline.reading.part_reader import Sensed

        started = time.perf_counter()
        photo = photo if photo is not None else self.load_photo()
        if over is not None and photo.pitch_mm is not None:
            width, height = over.size_mm
            photo = replace(photo, centre_mm=(0.5 * width, 0.5 * height))
        with told(self.job, "photo", self.job.photo):
            photo, vision = read_at_sizes(photo, self.readers.vision.read_photo)
            open_lattice = None
            if self.expected and self.readers.grammar is not None:
                open_lattice = self.readers.open_vision(self.expected).read_photo(photo).lattice
        kept = KeptVision.of(vision, photo, open_lattice=open_lattice, expected=self.expected)
        sensed = Sensed(vision.reading, vision=vision, photo=photo, lattice=vision.lattice)
        sensed = self._verified(sensed, kept.open_for(self.expected))
        return Seen(sensed, photo, kept, time.perf_counter() - started)

    def remembered(self) -> KeptVision:
        """What an earlier job saw.

        Raises:
            FileError: it cannot be used.
        """
        path = self._path("vision")
        with told(self.job, "vision", path):
            return load_vision(path)

    def feel(self) -> ReadingTrace:
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
        with told(job, what, path):
            if job.scan is not None:
                check_scan(path, most=self.limits.max_scan_samples)
                return felt(Part(name, scan=path), self.readers.touch)
            named = _with_suffix(path, Path(job.name_of(what)).suffix, job.folder)
            check_map(named, most=self.limits.max_map_samples)
            return felt(Part(name, height_map=named), self.readers.touch, unit=self.readers.unit)

    def of_touch(self, touch: ReadingTrace) -> Sensed:
        """Touch's word, held against the text expected.

        Raises:
            FileError: a text that cannot be looked for.
        """
        from pipeline.reading.part_reader import Sensed

        return self._verified(Sensed(touch.reading, touch, lattice=touch.lattice), touch.open_lattice)

    def fused(self, touch: ReadingTrace, seen: Seen | KeptVision) -> Sensed:
        """Both senses' word.

        Raises:
            FileError: a text that cannot be looked for, or beliefs that cannot be joined.
        """
        from pipeline.reading.part_reader import Sensed
        from recognition.fuse import fuse, fused_lattice

        kept = seen if isinstance(seen, KeptVision) else seen.kept
        if isinstance(seen, KeptVision) and touch.height_map is not None and kept.middle_mm is not None:
            width, height = touch.height_map.size_mm
            kept = moved(kept, 0.5 * width - kept.middle_mm[0], 0.5 * height - kept.middle_mm[1])
        told_readers, fonts = self.readers.told, self.readers.fonts
        with told(self.job, "vision", self.job.vision):
            reading = fuse(touch, kept.vision, told_readers, fonts=fonts)
            sensed = Sensed(reading, touch, kept.vision)
            felt = touch.open_lattice
            if not self.expected or felt is None:
                return self._verified(sensed, kept.open_for(self.expected))
            freely = replace(told_readers, grammar=None, mask=None)
            vision = replace(kept.vision, lattice=kept.open_for(self.expected))
            both = fused_lattice(replace(touch, lattice=felt), vision, freely, fonts=fonts)
        if both is None:
            return self._verified(sensed, felt)
        return self._verified(sensed, both[0], contradicted=bool(both[1]))

    def record(self, sensed: Sensed, seconds: float) -> ReadingRecord:
        """The record of a reading of this job."""
        from pipeline.reading.as_record import reading_record

        settings = self.settings
        if self.job.database is not None:
            settings = settings.model_copy(update={"database": self.job.database})
        return reading_record(
            sensed, settings, self.readers.grammar, part=self.job.part_name, seconds=seconds
        )

    def _verified(self, sensed: Sensed, lattice: Lattice | None, *, contradicted: bool = False) -> Sensed:
        if not self.expected:
            return sensed
        from pipeline.reading.expected import verify_reading

        with told(self.job, "expected", None):
            reading, verification = verify_reading(
                sensed.reading,
                lattice,
                self.expected,
                grammar=self.readers.grammar,
                contradicted=contradicted,
            )
        return replace(sensed, reading=reading, verification=verification)

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
