"""Which senses read a part, and what they say of it together.

mode       height map or scan   photograph only   both
none       touch                sight             touch
tactile    touch                -                 touch
vision     -                    sight             sight
fused      -                    -                 touch and sight, fused
auto       touch                sight             touch and sight, fused
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from pipeline.files.parts import Part
from pipeline.files.touch_file import read_height_map, read_scan, row_order_matters
from pipeline.files.units import Unit

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from pipeline.files.listed import ListedPart
    from pipeline.reading.expected import Expected
    from recognition.reader import Reader
    from recognition.reading import Reading
    from recognition.tactile_reader import TactileReader


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
    """Reads parts with the senses that the mode asks for, and verifies what is expected of them."""

    def __init__(
        self,
        reader: Reader,
        *,
        mode: Mode | None = None,
        expected: Expected | None = None,
        unit: Unit = Unit.MM,
    ) -> None:
        self.reader, self.mode, self.expected, self.unit = reader, mode, expected, unit

    def sense(self, part: Part) -> Reading:
        """Load the part, read it, and verify it if a text is expected of it.

        Raises:
            FileError: a file of the part cannot be used.
            VerifyError: an expected text that cannot be looked for.
        """
        if part.problem is not None:
            raise part.problem
        senses = senses_of(part, self.mode)
        if senses == (Sense.TOUCH,):
            found = felt(part, self.reader.touch, unit=self.unit)
        elif senses == (Sense.VISION,):
            found = self.reader.vision.read_photo(load_photo(part))
        else:
            found = self._fused(part)
        if self.expected is None:
            return found
        text = self.expected.of(part.name)
        if text is None:
            unknown = "not verified: the table of expected texts has no such part"
            return _noted(found, unknown)
        return self.reader.verify(found, text)

    def _fused(self, part: Part) -> Reading:
        touch = felt(part, self.reader.touch, unit=self.unit)
        try:
            photo = load_photo(part, over=touch.trace.height_map)
        except FileError as problem:
            if self.mode is not Mode.AUTO:
                raise
            return _noted(touch, f"read by touch alone: {problem}")
        return self.reader.fuse(touch, self.reader.vision.read_photo(photo))


def felt(part: Part, reader: TactileReader, *, unit: Unit = Unit.MM) -> Reading:
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
    if not row_order_matters(part.height_map) or not found.text or found.decision == "accept":
        return found
    from pipeline.files.instruments import RowOrder

    turned = read_height_map(part.height_map, row_order=RowOrder.TOP_FIRST)
    other = reader.read_height_map(turned, part_id=part.name)
    return max(found, other, key=lambda reading: reading.confidence)


def load_photo(part: Part, *, over: HeightMap | None = None) -> Photo:
    """The photograph of a part.

    Args:
        part: with a photograph.
        over: its height map, whose middle the camera's stage brings under the middle of the picture.

    Raises:
        FileError: the file cannot be used.
    """
    from pipeline.files.photos import read_photo
    from recognition.reader import centred

    if part.photo is None:
        raise FileError(part.name, "has no photograph", "add one of the same stem")
    if part.photo_problem is not None:
        raise part.photo_problem
    photo = read_photo(part.photo)
    return photo if over is None else centred(photo, over)


def _noted(reading: Reading, note: str) -> Reading:
    return replace(reading, notes=(*reading.notes, note))


def _soil(path: Path) -> Soil | None:
    """What lies on the part, where the file tells."""
    from pipeline.files.npz import read_soil

    return read_soil(path) if path.suffix.lower() == ".npz" else None
