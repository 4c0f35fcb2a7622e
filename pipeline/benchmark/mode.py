"""What a mode is, and the senses that all modes share.

A part is felt once and looked at once, whatever the number of modes: `Senses` keeps what was sensed, and how long
that took, so that every mode is charged for all it used.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

from glyphs.errors import MarksError
from pipeline.benchmark.specimens import Specimen
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from recognition.reader import Reader, ReaderSettings, ReadingTrace
    from recognition.reading import Reading
    from recognition.vision import VisionReader, VisionReading
    from whisker_array.scan.scan import Scan


class ModeUnavailableError(MarksError):
    """A mode that cannot run here."""


@dataclass(frozen=True)
class ModeSettings:
    """What the readers are told.

    Attributes:
        fonts: names or files; empty for all built-ins.
        mask: format of the serial; None where none is told.
        height_mm: character height; None where it is not told.
        fidelity: how touch is simulated.
    """

    fonts: tuple[str, ...] = ()
    mask: str | None = None
    height_mm: float | None = None
    fidelity: Fidelity = Fidelity.CONTACT


class Readers:
    """The readers of touch and of sight, made when first needed, kept with their templates."""

    def __init__(self, settings: ModeSettings) -> None:
        self.settings = settings

    @cached_property
    def touch(self) -> Reader:
        """Reads height maps.

        Raises:
            MarksError: a font or mask that cannot be used.
        """
        from recognition.reader import Reader

        return Reader(self._told())

    @cached_property
    def vision(self) -> VisionReader:
        """Reads photographs.

        Raises:
            MarksError: a font or mask that cannot be used, an engine that is not installed.
        """
        from recognition.vision import VisionReader

        return VisionReader(self._told())

    def _told(self) -> ReaderSettings:
        from recognition.reader import ReaderSettings

        told = self.settings
        return ReaderSettings(
            fonts=told.fonts, mask=told.mask, height_mm=told.height_mm, fidelity=told.fidelity
        )


class Senses:
    """One part, felt and looked at when a mode first asks for it.

    Attributes:
        specimen: the part.
        seconds: what each sense took.
    """

    def __init__(self, specimen: Specimen, readers: Readers) -> None:
        self.specimen = specimen
        self.seconds: dict[str, float] = {}
        self._readers = readers

    @cached_property
    def felt(self) -> ReadingTrace:
        """Scanned and read by touch."""
        part = self.specimen
        felt: ReadingTrace = self._timed(
            "touch",
            lambda: self._readers.touch.read_height_map(part.height_map, soil=part.soil, part_id=part.part),
        )
        return felt

    @cached_property
    def photo(self) -> Photo:
        """The photograph.

        Raises:
            MarksError: there is none.
        """
        if self.specimen.take_photo is None:
            raise MarksError(f"{self.specimen.part} has no photograph")
        photo: Photo = self._timed("photograph", self.specimen.take_photo)
        return photo

    @cached_property
    def seen(self) -> VisionReading:
        """Read by sight."""
        photo = self.photo
        seen: VisionReading = self._timed("vision", lambda: self._readers.vision.read_photo(photo))
        return seen

    def _timed(self, name: str, act: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        result = act()
        self.seconds[name] = time.perf_counter() - start
        return result

    @property
    def scan_s(self) -> float:
        """What the real array would take for the scan; 0 if the part was not felt."""
        scan = self.felt.scan if "touch" in self.seconds else None
        return 0.0 if scan is None else scan_seconds(scan)


def scan_seconds(scan: Scan, *, turnaround_s: float = RasterPlan.turnaround_s) -> float:
    """Time of a scan on the real array: every pass with its lead and its samples in the air, and a turnaround.

    Args:
        scan: as felt.
        turnaround_s: to lift, move and set down between passes.
    """
    passes = ((s.plan.line_mm.shape[0], s.plan.n_samples + s.air_n_mm.shape[-1]) for s in scan.sweeps)
    return float(sum(n * (samples / scan.sample_rate_hz + turnaround_s) for n, samples in passes))


class ModeReader(Protocol):
    """A mode.

    Attributes:
        uses: the senses it needs: "touch", "sight"; the others' time is not charged to it.
    """

    uses: tuple[str, ...]

    def read(self, senses: Senses) -> Reading:
        """Read the part."""
