"""Modes, and the readings that all modes share: a part is read once by each sense, with its time. Readers of pictures
see maps of a simulated scan, set for the true character height if it is known, as in a plant."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

from glyphs.errors import MarksError
from glyphs.surface.display import one_line
from glyphs.surface.maps import EdgeMap, MapError
from pipeline.benchmark.exam.specimens import Specimen, perturb
from pipeline.reading.perturbation import Perturbation
from pipeline.reading.scan_plan import USUAL_HEIGHT_MM
from whisker_array.whisker.array import RasterPlan

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from recognition.decide.evidence import SenseEvidence
    from recognition.decide.reading import Reading
    from recognition.reader import Reader
    from recognition.see.virtual_array import VirtualArray
    from whisker_array.estimation.relief import Relief
    from whisker_array.scan.scan import Scan


R = TypeVar("R")
# values and times of each sense that `PartReadings` keeps
_OF_SENSE = {"touch": ("touch", "felt"), "vision": ("photo", "photograph", "vision", "photographs", "lights")}


@dataclass(frozen=True, eq=False)
class FeltMaps:
    """A scan, by the default plan or the part's own, with its maps; None if none can be made of the scan."""

    scan: Scan
    edges: EdgeMap | None
    relief: Relief | None
    simulated_s: float

    __repr__ = one_line


def feel_part(specimen: Specimen, array: VirtualArray) -> FeltMaps:
    """Scan a part by the default plan, or its own; a MapError if the surface cannot be scanned."""
    from recognition.see.view import relief_of
    from recognition.see.virtual_bench import VirtualBench
    from whisker_array.estimation.edges import edge_map

    start = time.perf_counter()
    surface, height_mm = specimen.height_map, specimen.height_mm or USUAL_HEIGHT_MM
    if specimen.feel is not None:
        scan = specimen.feel(surface, height_mm)
    else:
        scan = VirtualBench(surface, height_mm, array, soil=specimen.soil).mounted().scan()
    simulated_s = time.perf_counter() - start
    try:
        edges = edge_map(scan)
    except MapError:
        return FeltMaps(scan, None, None, simulated_s)
    return FeltMaps(scan, edges, relief_of(scan, edges), simulated_s)


class ModeUnavailableError(MarksError):
    """The mode cannot run here."""


class PartReadings:
    """Readings of one part, each made when a mode first needs it, or a MarksError; and the time of each sense."""

    def __init__(self, specimen: Specimen, reader: Reader) -> None:
        self.specimen = specimen
        self.seconds: dict[str, float] = {}
        self._reader = reader

    def again(self, how: Perturbation) -> PartReadings:
        """The readings of the perturbed part; senses that the perturbation does not change are not read again."""
        shown = perturb(self.specimen, how, array=self._reader.settings.array)
        other = PartReadings(shown, self._reader)
        for sense, names in _OF_SENSE.items():
            if not how.reaches((sense,)):
                vars(other).update({name: value for name, value in vars(self).items() if name in names})
                other.seconds.update({name: s for name, s in self.seconds.items() if name in names})
        return other

    @cached_property
    def touch(self) -> Reading:
        from recognition.surface import Surface

        part = self.specimen
        surface = Surface(part.height_map, part.soil, part.rows_known, part.part, part.feel)
        return self._time("touch", lambda: self._decide(self._reader.feel(surface)))

    @cached_property
    def felt(self) -> FeltMaps:
        """The scan with its maps, without reading it; a MapError if the surface cannot be scanned."""
        return self._time("felt", lambda: feel_part(self.specimen, self._reader.settings.array))

    @property
    def edges(self) -> EdgeMap:
        return self._there("edges", self.felt.edges)

    @property
    def relief(self) -> Relief:
        return self._there("heights", self.felt.relief)

    @cached_property
    def photo(self) -> Photo:
        return self._take_photo("photograph", self.specimen.take_photo)

    @cached_property
    def vision(self) -> Reading:
        photo = self.photo
        return self._time("vision", lambda: self._decide(self._reader.look_at(photo)))

    @cached_property
    def lights(self) -> Reading:
        """Reading of photographs under several lights together; a MarksError without them."""
        photo = self._take_photo("photographs", self.specimen.take_lights)
        return self._time("lights", lambda: self._decide(self._reader.look_at(photo)))

    def _decide(self, evidence: SenseEvidence) -> Reading:
        from recognition.decide.evidence import Evidence

        return self._reader.decide(Evidence.of(evidence))

    @staticmethod
    def _there(what: str, value: R | None) -> R:
        if value is None:
            raise MarksError(f"touch has found no {what}")
        return value

    def _take_photo(self, name: str, take: Callable[[], Photo] | None) -> Photo:
        from recognition.reader import centre_on

        if take is None:
            several = " under several lights" if name == "photographs" else ""
            raise MarksError(f"{self.specimen.part} has no {name}{several}")
        photo = self._time(name, take)
        # as in `pipeline.reading.part_reader`
        return photo if photo.centre_mm is not None else centre_on(photo, self.specimen.height_map)

    def _time(self, name: str, act: Callable[[], R]) -> R:
        start = time.perf_counter()
        result = act()
        self.seconds[name] = time.perf_counter() - start
        return result

    @property
    def scan_s(self) -> float:
        """Time that the real array would take for the scan; 0 if the part was not scanned."""
        scan = self.touch.trace.scan if "touch" in self.seconds else None
        if scan is None and "felt" in self.seconds:
            scan = self.felt.scan
        return 0.0 if scan is None else scan_seconds(scan)


def scan_seconds(scan: Scan, *, turnaround_s: float = RasterPlan.turnaround_s) -> float:
    """Time of a scan on the real array: every pass with its lead, its samples in the air, and a turnaround."""
    passes = ((s.plan.line_mm.shape[0], s.plan.n_samples + s.air_n_mm.shape[-1]) for s in scan.sweeps)
    return float(sum(n * (samples / scan.sample_rate_hz + turnaround_s) for n, samples in passes))


@dataclass(frozen=True)
class Mode:
    """A mode: the readings that it `uses`, to whose time it is charged ("touch", "vision", "lights", "felt"). `read`
    returns the reading, and fields of the trial that replace those of the run."""

    uses: tuple[str, ...]
    read: Callable[[PartReadings], tuple[Reading, Mapping[str, Any]]]

    @classmethod
    def of(cls, uses: tuple[str, ...], read: Callable[[PartReadings], Reading]) -> Mode:
        return cls(uses, lambda senses: (read(senses), {}))
