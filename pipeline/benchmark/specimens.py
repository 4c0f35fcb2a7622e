"""What is tried: parts made from a seed, or parts in a folder, each made once and read by every mode.

severities x fonts x formats x numbers --SynthParts.make--> Specimen (height map, soil, photograph, truth)
NAME.npz, NAME.png, truth.csv ---------FolderParts.make--->
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from glyphs.errors import FileError
from glyphs.fonts.serials import allowed_characters
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.die import Face
from pipeline.common.settings import SettingsError
from pipeline.files.parts import Part, discover
from pipeline.files.synth import MAX_PARTS, SynthSpec
from pipeline.files.truth import load_truth

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Condition:
    """What parts of one kind have in common.

    Attributes:
        severity: of the dirt, 0 to 1; None where it is not known.
        font: of the mark: built-in name or file; empty where it is not known.
        format: of the serial; empty where it is not known.
    """

    severity: float | None
    font: str
    format: str

    @property
    def font_name(self) -> str:
        """The font without the folder and suffix of its file."""
        return Path(self.font).stem if "/" in self.font or "." in self.font else self.font


@dataclass(frozen=True)
class Item:
    """One part to be tried, not made yet.

    Attributes:
        part: its name, unique in the benchmark.
        number: among those of its condition.
        condition: its kind.
        files: its files, of a part in a folder.
        truth: what was stamped, of a part in a folder.
    """

    part: str
    number: int
    condition: Condition
    files: Part | None = None
    truth: str = ""


@dataclass(frozen=True, eq=False)
class Specimen:
    """A part to be scanned and photographed.

    Attributes:
        part: its name.
        truth: what was stamped.
        height_map: its top surface.
        soil: dirt and friction; None of a clean part.
        take_photo: photographs it; None without a camera.
        line_mm: (x0, y0, x1, y1) around the line, plate frame; None where it is not known.
        turned: the map with the other row first, as `pipeline.reading.part_reader.read_surface` takes it.
    """

    part: str
    truth: str
    height_map: HeightMap
    soil: Soil | None
    take_photo: Callable[[], Photo] | None
    line_mm: Box | None
    turned: Callable[[], HeightMap] | None = None


class Parts(Protocol):
    """Where the parts come from."""

    def items(self) -> list[Item]:
        """All of them, in order."""

    def make(self, item: Item) -> Specimen:
        """Make or load one."""

    def description(self) -> dict[str, Any]:
        """What decides over every one of them, in plain JSON values; not how many there are."""


@dataclass(frozen=True)
class SynthParts:
    """Parts made from a seed.

    Attributes:
        severities: of the dirt.
        fonts: built-in names or font files.
        formats: of serials.
        parts: of each severity, font and format.
        seed: of everything random.
        height_mm: character height.
        depth_mm: depth of the marks.
        face: face of the die.
        light_azimuth_deg: where the lamp stands; drawn for every part unless given.
        light_elevation_deg: how high it stands; likewise.

    Raises:
        SettingsError: a number out of range, a font or format that cannot be, two fonts of one name.
    """

    severities: tuple[float, ...]
    fonts: tuple[str, ...]
    formats: tuple[str, ...]
    parts: int
    seed: int = 0
    height_mm: float = 5.0
    depth_mm: float = 0.2
    face: Face = Face.FLAT
    light_azimuth_deg: float | None = None
    light_elevation_deg: float | None = None

    def __post_init__(self) -> None:
        for name in ("severities", "fonts", "formats"):
            values = getattr(self, name)
            if not values or len(set(values)) != len(values):
                raise SettingsError(f"{name} are {values}", hint="give at least one, each once")
        for severity in self.severities:
            _check_severity(severity)
        if not 1 <= self.parts <= MAX_PARTS:
            raise SettingsError(
                f"the number of parts is {self.parts}", hint=f"it lies between 1 and {MAX_PARTS:,}"
            )
        names = [Condition(None, font, "").font_name for font in self.fonts]
        if len(set(names)) != len(names):
            raise SettingsError(
                f"two fonts have one name ({', '.join(names)})", hint="rename one of the files"
            )
        for condition in self.conditions():
            self._spec(condition)

    def conditions(self) -> list[Condition]:
        """Every severity with every font and format."""
        return [Condition(s, f, m) for f in self.fonts for m in self.formats for s in self.severities]

    def items(self) -> list[Item]:
        """Part after part through all conditions, so that a run that is broken off has some of each."""
        return [
            Item(f"{c.font_name}-{c.format}-dirt{c.severity:g}-{number:04d}", number, c)
            for number in range(self.parts)
            for c in self.conditions()
        ]

    def make(self, item: Item) -> Specimen:
        """Stamp it, soil it, and have it ready for the camera."""
        from pipeline.files import synth

        spec = self._spec(item.condition)
        part = synth.make_part(spec, item.number)
        stamped = part.stamped
        boxes = [b for b, char in zip(stamped.boxes_mm, stamped.text, strict=True) if char != " "]
        return Specimen(
            part=item.part,
            truth="".join(stamped.text.split()),
            height_map=part.height_map,
            soil=part.soil,
            take_photo=lambda: spec.photograph(part),
            line_mm=_hull(boxes),
        )

    def description(self) -> dict[str, Any]:
        """See `Parts`."""
        return {
            "severities": list(self.severities),
            "fonts": [_font_mark(font) for font in self.fonts],
            "formats": list(self.formats),
            "seed": self.seed,
            "height_mm": self.height_mm,
            "depth_mm": self.depth_mm,
            "face": self.face.value,
            "light_azimuth_deg": self.light_azimuth_deg,
            "light_elevation_deg": self.light_elevation_deg,
        }

    def _spec(self, condition: Condition) -> SynthSpec:
        return SynthSpec(
            format=condition.format,
            font=condition.font,
            seed=self.seed,
            height_mm=self.height_mm,
            depth_mm=self.depth_mm,
            face=self.face,
            soiling=Soiling(severity=condition.severity or 0.0),
            light_azimuth_deg=self.light_azimuth_deg,
            light_elevation_deg=self.light_elevation_deg,
        )


@dataclass(frozen=True)
class FolderParts:
    """Parts in files, made by anyone.

    Attributes:
        found: the parts that have a truth.
        truth: text by part.
        condition: what they have in common.
    """

    found: tuple[Part, ...]
    truth: dict[str, str]
    condition: Condition

    @classmethod
    def load(cls, inputs: Sequence[str], truth: Path, condition: Condition) -> FolderParts:
        """The parts of folders, globs or files that a table tells the truth of.

        Args:
            inputs: folders, globs or files.
            truth: CSV with the columns part and text.
            condition: what the parts have in common, as far as known.

        Raises:
            FileError: no such table, or none of its parts is there.
            NothingFoundError: no part at all.
            SettingsError: a format or severity that cannot be.
        """
        if condition.format:
            allowed_characters(condition.format)
        _check_severity(condition.severity)
        truths = load_truth(truth)
        parts = tuple(p for p in discover(inputs) if p.name in truths)
        if not parts:
            raise FileError(truth, "tells the truth of none of the parts", "name the parts as their files")
        return cls(parts, {p.name: truths[p.name] for p in parts}, condition)

    def items(self) -> list[Item]:
        """All of them, by name."""
        return [
            Item(part.name, number, self.condition, part, "".join(self.truth[part.name].split()))
            for number, part in enumerate(self.found)
        ]

    def make(self, item: Item) -> Specimen:
        """Load its height map; the photograph when it is asked for."""
        from pipeline.files.npz import read_soil
        from pipeline.files.photos import read_photo
        from pipeline.files.touch_file import read_height_map
        from pipeline.reading.part_reader import other_rows

        files = item.files
        if files is None or files.problem is not None:
            raise (files.problem if files and files.problem else ValueError(f"{item.part} has no files"))
        if files.height_map is None:
            raise FileError(files.scan or item.part, "has no height map", "add one")
        photo = files.photo
        return Specimen(
            part=item.part,
            truth=item.truth,
            height_map=read_height_map(files.height_map),
            soil=read_soil(files.height_map) if files.height_map.suffix.lower() == ".npz" else None,
            take_photo=None if photo is None else lambda: read_photo(photo),
            line_mm=None,
            turned=other_rows(files.height_map),
        )

    def description(self) -> dict[str, Any]:
        """See `Parts`."""
        table = "\n".join(f"{name}\t{text}" for name, text in sorted(self.truth.items()))
        return {
            "folder": sorted({str((p.height_map or Path(p.name)).parent) for p in self.found}),
            "truth": hashlib.sha256(table.encode()).hexdigest()[:16],
            "severity": self.condition.severity,
            "format": self.condition.format,
        }


def _check_severity(severity: float | None) -> None:
    if severity is not None and not 0.0 <= severity <= 1.0:
        raise SettingsError(f"a severity is {severity}", hint="it lies between 0 and 1")


def _hull(boxes: Sequence[Box]) -> Box | None:
    if not boxes:
        return None
    x0, y0, x1, y1 = zip(*boxes, strict=True)
    return (min(x0), min(y0), max(x1), max(y1))


def _font_mark(font: str) -> str:
    """The font's name, and of a file its contents: another file of that name is another font."""
    path = Path(font)
    if not path.is_file():
        return font
    return f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()[:12]}"
