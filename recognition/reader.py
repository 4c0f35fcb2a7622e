"""The reader: from the data of a part to its reading.

    scan, surface --touch--> evidence --\\
                                         Evidence --decide--> Reading: accept, review or reject
    photographs ----camera-> evidence --/
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, Unpack

import numpy as np
from numpy.typing import NDArray

from glyphs.signatures import lists_options
from recognition.language.grammar import Grammar
from recognition.settings import ReaderOptions, ReaderSettings, Repertoire

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.part import Part
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from recognition.camera import VisionReader
    from recognition.decide.evidence import Evidence, SenseEvidence
    from recognition.decide.reading import Reading
    from recognition.surface import Surface
    from recognition.touch import TactileReader
    from whisker_array.scan.scan import Scan

    Readable: TypeAlias = HeightMap | Scan | Photo | Part | NDArray[Any]

T = TypeVar("T")


class Reader:
    """Reads parts one after the other. Raises FontError, FormatError, TypeError or ValueError.

    Example::

        reading = Reader(fonts="gothic", format="AA999999").read(part)
    """

    @lists_options(ReaderSettings, ReaderOptions.__annotations__)
    def __init__(self, settings: ReaderSettings | None = None, /, **options: Unpack[ReaderOptions]) -> None:
        self.settings = replace(settings or ReaderSettings(), **options)
        self._touch_settings = self.settings
        Repertoire(self.settings)

    @property
    def grammar(self) -> Grammar | None:
        """Format of the serials; None without one."""
        return self.settings.grammar

    @cached_property
    def touch(self) -> TactileReader:
        """Reads height maps and scans."""
        from recognition.touch import TactileReader

        return TactileReader(self._touch_settings)

    @cached_property
    def vision(self) -> VisionReader:
        """Reads photographs."""
        from recognition.camera import VisionReader

        return VisionReader(self.settings)

    def after_photo(self) -> Reader:
        """A reader whose regions apply only to photographs: a scan covers only the line that the camera found."""
        reader = Reader(self.settings)
        lines = {name: replace(line, region=None) for name, line in self.settings.line_formats.items()}
        reader._touch_settings = replace(self.settings, region=None, lines=lines)
        return reader

    def read(
        self,
        part: Readable,
        /,
        *more: Readable,
        pitch_mm: float | None = None,
        soil: Soil | None = None,
        part_id: str = "",
    ) -> Reading:
        """Read one part from all given data; files are read by `pipeline.read`.

        A scan goes before a height map; touch and photographs are fused. Several photographs, from one place under
        other lights or at other exposures, are read as one. The middle of a photograph of known scale is taken to lie
        over the middle of the height map. A simulated part is felt with its dirt; its photograph is given beside it.

        An array of floats is a map of heights in mm, one of uint8 or uint16 a photograph. `soil` is dirt on the height
        map into which the tip sinks, and the part's friction, if known.

        Raises MapError for a map that cannot be scanned, TypeError for anything else, ValueError without a pitch.
        """
        from glyphs.part import Part
        from glyphs.surface.maps import HeightMap
        from recognition.decide.evidence import Evidence
        from recognition.surface import Surface
        from whisker_array.scan.scan import Scan

        data = [_typed(item, pitch_mm) for item in (part, *more)]
        surface, scan = _only(HeightMap, data), _only(Scan, data)
        photo = _joined_photo(data, surface)
        soil = next((item.soil for item in (part, *more) if isinstance(item, Part)), None) or soil
        touch, vision = None, None
        if scan is not None:
            touch = self.feel_scan(scan)
        elif surface is not None:
            touch = self.feel(Surface(surface, soil, part_id=part_id))
        if photo is not None:
            vision = self.look_at(photo)
        return self.decide(Evidence(touch, vision))

    def feel(self, surface: Surface) -> SenseEvidence:
        """Evidence by touch of a surface that the virtual array scans. Raises MapError if it cannot be."""
        from recognition.surface import evidence_of_surface

        return evidence_of_surface(self.touch, surface)

    def feel_scan(self, scan: Scan) -> SenseEvidence:
        """Evidence by touch of a recorded scan; one with a log of passes stays marked as felt pass by pass."""
        from recognition.active.felt_log import logged_evidence

        return self.touch.of_recording(scan) if scan.log is None else logged_evidence(self.touch, scan)

    def look_at(self, photo: Photo) -> SenseEvidence:
        """Evidence by camera of a photograph with its others."""
        return self.vision.of_photo(photo)

    def decide(self, evidence: Evidence) -> Reading:
        """Decide on the evidence of a part. Raises VerifyError."""
        from recognition.decide.decide import decide

        return decide(evidence, self.settings)

    def fuse(self, touch: Reading, vision: Reading) -> Reading:
        """Decide on the evidence of two readings of one part together. Raises ValueError for one without evidence."""
        if touch.evidence is None or vision.evidence is None:
            raise ValueError("only readings of this reader can be fused: others have no evidence")
        return self.decide(touch.evidence.joined(vision.evidence))

    def verify(self, reading: Reading, expected: str) -> Reading:
        """Decide again on a part that should read a text (`trace.verification`). Raises ValueError, VerifyError."""
        if reading.evidence is None:
            raise ValueError("only readings of this reader can be verified: others have no evidence")
        return self.decide(replace(reading.evidence, expected=expected))


def _only(kind: type[T], data: Sequence[object]) -> T | None:
    of_kind = [item for item in data if isinstance(item, kind)]
    if len(of_kind) > 1:
        raise ValueError(f"two of {kind.__name__} are given; read one part at a time")
    return of_kind[0] if of_kind else None


def _joined_photo(data: Sequence[object], surface: HeightMap | None) -> Photo | None:
    from glyphs.camera.photo import Photo

    photos = [item for item in data if isinstance(item, Photo)]
    if not photos:
        return None
    photo = replace(photos[0], others=(*photos[0].others, *photos[1:]))
    return photo if surface is None else centre_on(photo, surface)


def _typed(item: Readable, pitch_mm: float | None) -> HeightMap | Scan | Photo:
    from glyphs.camera.photo import Photo
    from glyphs.part import Part
    from glyphs.surface.maps import HeightMap
    from whisker_array.scan.scan import Scan

    if isinstance(item, Part):
        return item.height_map
    if isinstance(item, np.ndarray):
        if item.dtype in (np.uint8, np.uint16):
            return Photo(item, pitch_mm)
        if pitch_mm is None:
            raise ValueError("an array of heights has no pitch; give pitch_mm, the distance of its samples")
        return HeightMap(item, pitch_mm)
    if isinstance(item, HeightMap | Scan | Photo):
        return item
    hint = (
        "pipeline.read reads files"
        if isinstance(item, str | PurePath)
        else "give a HeightMap, Scan, Photo or Part"
    )
    raise TypeError(f"a {type(item).__name__} cannot be read; {hint}")


def centre_on(photo: Photo, surface: HeightMap) -> Photo:
    """Centre a photograph on the height map, if its scale is known."""
    if photo.pitch_mm is None:
        return photo
    width, height = surface.size_mm
    return replace(photo, centre_mm=(0.5 * width, 0.5 * height))
