"""Which senses read a part, and what they say of it together.

mode       height map or scan   photograph only   both
none       touch                sight             touch
tactile    touch                -                 touch
vision     -                    sight             sight
fused      -                    -                 touch and sight, fused
auto       touch                sight             touch and sight, fused
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from glyphs.errors import FileError
from pipeline.files.parts import Part
from pipeline.files.touch_file import read_height_map, read_scan, row_order_matters
from pipeline.files.units import Unit

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.fonts.glyph import Font
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from pipeline.files.listed import ListedPart
    from pipeline.reading.expected import Expected
    from recognition.grammar import Grammar
    from recognition.lattice import Lattice
    from recognition.reader import ReaderSettings, ReadingTrace
    from recognition.reading import Reading
    from recognition.verify import Verification
    from recognition.vision import VisionReading
    from whisker_array.scan.scan import Scan


class Mode(StrEnum):
    """Senses that read."""

    TACTILE = "tactile"
    VISION = "vision"
    FUSED = "fused"
    AUTO = "auto"


class Sense(StrEnum):
    """One sense."""

    TOUCH = "touch"
    VISION = "vision"


class TouchReader(Protocol):
    """What reads by touch: `recognition.reader.Reader` is one."""

    def read_height_map(
        self, height_map: HeightMap, *, soil: Soil | None = None, part_id: str = ""
    ) -> ReadingTrace:
        """Scan a height map with the virtual array and read it."""

    def read_scan(self, scan: Scan) -> ReadingTrace:
        """Read a recorded scan."""


class PhotoReader(Protocol):
    """What reads by sight: `recognition.vision.VisionReader` is one."""

    def read_photo(self, photo: Photo) -> VisionReading:
        """Read a photograph."""


class SenseReaders(Protocol):
    """The readers of both senses: `pipeline.reading.readers.Readers` are."""

    @property
    def told(self) -> ReaderSettings:
        """What the readers are told."""

    @property
    def grammar(self) -> Grammar | None:
        """What serials may be."""

    @property
    def fonts(self) -> tuple[Font, ...]:
        """Fonts of the database."""

    @property
    def unit(self) -> Unit:
        """Unit of height files that state none."""

    @property
    def touch(self) -> TouchReader:
        """Reads height maps and scans."""

    @property
    def vision(self) -> PhotoReader:
        """Reads photographs."""

    def open_vision(self, expected: str) -> PhotoReader:
        """Reads photographs for verification: any character at as many places as the text has."""


@dataclass(frozen=True, eq=False)
class Sensed:
    """A part as it was read, and what it was read from.

    Attributes:
        reading: the answer of the senses asked.
        touch: what was felt, if it was.
        vision: what was seen, if it was.
        photo: the photograph, if it was looked at.
        lattice: beliefs of places that the reading was chosen from, where there is one.
        verification: of the text expected, if one was.
    """

    reading: Reading
    touch: ReadingTrace | None = None
    vision: VisionReading | None = None
    photo: Photo | None = None
    lattice: Lattice | None = None
    verification: Verification | None = None


def senses_of(part: Part | ListedPart, mode: Mode | None) -> tuple[Sense, ...]:
    """The senses that read a part.

    Raises:
        FileError: a file that the mode needs is not there.
    """
    felt, seen = bool(part.height_map or part.scan), bool(part.photo)
    named = part.scan or part.height_map or part.photo or part.name
    if mode in (Mode.TACTILE, Mode.FUSED) and not felt:
        raise FileError(named, "has no height map and no scan", "add one, or read it with --mode vision")
    if mode in (Mode.VISION, Mode.FUSED) and not seen:
        raise FileError(named, "has no photograph", "add one of the same stem, or read with --mode tactile")
    if mode is Mode.FUSED or (mode is Mode.AUTO and felt and seen):
        return (Sense.TOUCH, Sense.VISION)
    if mode is Mode.VISION or not felt:
        return (Sense.VISION,)
    return (Sense.TOUCH,)


class Senses:
    """Reads parts with the senses that the mode asks for, and holds them against what is expected."""

    def __init__(
        self, readers: SenseReaders, *, mode: Mode | None = None, expected: Expected | None = None
    ) -> None:
        self.readers, self.mode, self.expected = readers, mode, expected

    def sense(self, part: Part) -> Sensed:
        """Load the part, read it, and verify it if a text is expected of it.

        Raises:
            FileError: a file of the part cannot be used.
            VerifyError: an expected text that cannot be looked for.
        """
        if part.problem is not None:
            raise part.problem
        senses = senses_of(part, self.mode)
        if senses == (Sense.TOUCH,):
            touch = felt(part, self.readers.touch, unit=self.readers.unit)
            found = Sensed(touch.reading, touch, lattice=touch.lattice)
        elif senses == (Sense.VISION,):
            photo = load_photo(part)
            vision = self.readers.vision.read_photo(photo)
            found = Sensed(vision.reading, vision=vision, photo=photo, lattice=vision.lattice)
        else:
            found = self._fused(part)
        if self.expected is None:
            return found
        text = self.expected.of(part.name)
        if text is None:
            unknown = "not verified: the table of expected texts has no such part"
            return replace(found, reading=_noted(found.reading, unknown))
        return self._verified(found, text)

    def _fused(self, part: Part) -> Sensed:
        touch = felt(part, self.readers.touch, unit=self.readers.unit)
        try:
            photo = load_photo(part, over=touch.height_map)
        except FileError as problem:
            if self.mode is not Mode.AUTO:
                raise
            reading = _noted(touch.reading, f"read by touch alone: {problem}")
            return Sensed(reading, touch, lattice=touch.lattice)
        from recognition.fuse import fuse

        vision = self.readers.vision.read_photo(photo)
        reading = fuse(touch, vision, self.readers.told, fonts=self.readers.fonts)
        return Sensed(reading, touch, vision, photo)

    def _verified(self, found: Sensed, text: str) -> Sensed:
        from pipeline.reading.expected import verify_reading

        grammar = self.readers.grammar
        lattice, contradicted = self._open_lattice(found, text)
        reading, verification = verify_reading(
            found.reading, lattice, text, grammar=grammar, contradicted=contradicted
        )
        return replace(found, reading=reading, verification=verification)

    def _open_lattice(self, found: Sensed, text: str) -> tuple[Lattice | None, bool]:
        """Beliefs that a wrong serial has its place in, and whether the senses contradict each other."""
        felt = None if found.touch is None else found.touch.open_lattice
        if found.vision is None or found.photo is None:
            return felt, False
        vision = found.vision
        if self.readers.grammar is not None:
            vision = self.readers.open_vision(text).read_photo(found.photo)
        if found.touch is None or felt is None:
            return vision.lattice, False
        from recognition.fuse import fused_lattice

        told = replace(self.readers.told, grammar=None, mask=None)
        touch = replace(found.touch, lattice=felt)
        fused = fused_lattice(touch, vision, told, fonts=self.readers.fonts)
        return (felt, False) if fused is None else (fused[0], bool(fused[1]))


def felt(part: Part, reader: TouchReader, *, unit: Unit = Unit.MM) -> ReadingTrace:
    """Load what there is to be felt and read it; a recorded scan goes before a height map.

    Of a format that is met with either row first, the other order is tried where the standards' is not
    accepted.

    Args:
        part: with a scan or a height map.
        reader: reads it.
        unit: of height files that state none.

    Raises:
        FileError: the file cannot be used.
    """
    if part.scan is not None:
        return reader.read_scan(read_scan(part.scan))
    if part.height_map is None:
        raise FileError(part.photo or part.name, "has no height map and no scan", "add one")
    found = reader.read_height_map(
        read_height_map(part.height_map, unit=unit), soil=_soil(part.height_map), part_id=part.name
    )
    if not row_order_matters(part.height_map) or not found.reading.text or found.reading.decision == "accept":
        return found
    from pipeline.files.instruments import RowOrder

    turned = read_height_map(part.height_map, row_order=RowOrder.TOP_FIRST)
    other = reader.read_height_map(turned, part_id=part.name)
    return max(found, other, key=lambda e: e.reading.confidence)


def load_photo(part: Part, *, over: HeightMap | None = None) -> Photo:
    """The photograph of a part.

    Args:
        part: with a photograph.
        over: its height map, whose middle the camera's stage brings under the middle of the picture.

    Raises:
        FileError: the file cannot be used.
    """
    from pipeline.files.photos import read_photo

    if part.photo is None:
        raise FileError(part.name, "has no photograph", "add one of the same stem")
    if part.photo_problem is not None:
        raise part.photo_problem
    photo = read_photo(part.photo)
    if over is None or photo.pitch_mm is None:
        return photo
    width, height = over.size_mm
    return replace(photo, centre_mm=(0.5 * width, 0.5 * height))


def _noted(reading: Reading, note: str) -> Reading:
    return replace(reading, notes=(*reading.notes, note))


def _soil(path: Path) -> Soil | None:
    """What lies on the part, where the file tells."""
    from pipeline.files.npz import read_soil

    return read_soil(path) if path.suffix.lower() == ".npz" else None
