"""Parts of a design or a folder, each made once and read by every mode."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from pipeline.benchmark.exam.condition import Condition
from pipeline.reading.perturbation import Perturbation, Retake

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from pipeline.formats.part_files import PartFiles
    from recognition.find.first_pass import Feel
    from recognition.see.virtual_array import VirtualArray


Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Item:
    """A part of the exam that is not made yet, read with each of the `given` sets of facts."""

    part: str  # name, unique in the benchmark
    number: int  # among the parts of its condition; a designed part is made from it and the seed
    condition: Condition
    given: tuple[str, ...] = ("format",)
    files: PartFiles | None = None  # of a part from a folder, as the truth
    truth: str = ""


@dataclass(frozen=True, eq=False)
class Specimen:
    """A part to be scanned and photographed; what is not known is None or empty."""

    part: str
    truth: str
    height_map: HeightMap
    soil: Soil | None  # dirt and friction; None for a clean part
    take_photo: Callable[[], Photo] | None
    line_mm: Box | None  # (x0, y0, x1, y1) around the line, plate frame
    boxes_mm: tuple[Box, ...] = ()  # around each character of the truth
    height_mm: float | None = None  # of a character, for which a stage is set
    beside_mm: Box | None = None  # around a second line that is not to be read
    rows_known: bool = True
    feel: Feel | None = None  # scans it (default: the default plan)
    take_lights: Callable[[], Photo] | None = None  # takes photographs under several lights
    number: int = 0


class Parts(Protocol):
    """A source of parts."""

    def items(self) -> list[Item]:
        """All of them, in order."""

    def make(self, item: Item) -> Specimen: ...

    def font_of(self, condition: Condition) -> str:
        """The font of a kind of part, as given to readers; empty if unknown."""

    def description(self) -> dict[str, Any]:
        """Everything that determines each part, as JSON values; not their number."""


def perturb(specimen: Specimen, how: Perturbation, *, array: VirtualArray) -> Specimen:
    """Perturb a part, in the same way every time."""
    again = Retake(how, zlib.crc32(f"{specimen.part} {how.name}".encode()))
    grown, take = again.grown, specimen.take_photo
    take_lights = specimen.take_lights

    def larger(box: Box | None) -> Box | None:
        return None if box is None else (box[0] * grown, box[1] * grown, box[2] * grown, box[3] * grown)

    return replace(
        specimen,
        height_map=again.surface(specimen.height_map),
        take_photo=None if take is None else lambda: again.photo(take()),
        take_lights=None if take_lights is None else lambda: again.photo(take_lights()),
        line_mm=larger(specimen.line_mm),
        boxes_mm=tuple(b for b in map(larger, specimen.boxes_mm) if b is not None),
        beside_mm=larger(specimen.beside_mm),
        feel=again.feel(array, soil=specimen.soil, part_id=specimen.part),
    )
