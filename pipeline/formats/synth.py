"""Make test parts: stamped plates, dirt, photographs, and the table of their texts (`truth.csv`). A part depends on the
seed and its number only, so the first ten of fifty are the same as ten."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.camera.appearance import draw_light
from glyphs.camera.photo import Photo
from glyphs.camera.pose import Camera
from glyphs.errors import FileError
from glyphs.fonts.outlines import load_font
from glyphs.fonts.serials import allowed_characters, random_text
from glyphs.part import Part, stamp
from glyphs.soiling.soil import Soil
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.dies import DIES
from glyphs.stamping.errors import pick
from glyphs.stamping.faces import Face, default_die
from glyphs.stamping.layouts import LAYOUTS
from glyphs.stamping.plates import PLATES
from glyphs.stamping.variation import PRACTICES, StampingVariation
from glyphs.surface.maps import HeightMap
from pipeline.common.output_paths import make_folder, write_table
from pipeline.common.settings import SettingsError
from pipeline.common.stamping import Stamping
from pipeline.formats.npz import soil_members, write_npz
from pipeline.formats.photos import write_photo

TRUTH_FILE = "truth.csv"
MAX_PARTS = 1_000_000
MOST_LIGHTS = 12
# settings of a part that are passed to `stamp` unchanged
_STAMP_SETTINGS = (
    *("format", "height_mm", "depth_mm", "face", "bevel_deg", "raised"),
    *("practice", "die", "plate", "layout"),
)


@dataclass(frozen=True)
class SynthSpec(Stamping):
    """Settings of the parts to stamp, and the dirt on them. With two lines, the truth is the line in the format. Raises
    SettingsError: an impossible or contradictory setting. StampError: unknown practice, die, plate or layout."""

    soiling: Soiling = field(default_factory=Soiling)

    def __post_init__(self) -> None:
        if not 1 <= self.lights <= MOST_LIGHTS:
            raise SettingsError(f"lights is {self.lights}", hint=f"it lies between 1 and {MOST_LIGHTS}")
        if self.seed < 0:
            raise SettingsError(f"seed is {self.seed}", hint="it must not be negative")
        allowed_characters(self.format)
        rng = np.random.default_rng(0)
        draw_light(rng, azimuth_deg=self.light_azimuth_deg, elevation_deg=self.light_elevation_deg)
        Camera(pitch_mm=self.pixel_mm)
        if self.practice is not None and not self.variation:
            what = "a practice makes blows differ, and 'no variation' makes them equal"
            raise SettingsError(what, hint="leave out one of the two")
        known: Mapping[str, Any]
        for kind, known in (("practice", PRACTICES), ("die", DIES), ("plate", PLATES), ("layout", LAYOUTS)):
            if (name := getattr(self, kind)) is not None:
                pick(kind, known, name)
        if self.die is not None and Face(self.face) is not Face.FLAT:
            raise SettingsError(f"a die {self.die!r} has its own face", hint="leave out the face")
        default_die(
            self.height_mm,
            font=load_font(self.font),
            face=Face(self.face),
            bevel_deg=self.bevel_deg,
            depth_mm=self.depth_mm,
        )

    def photograph(self, part: Part) -> Photo:
        return part.photograph(
            light_azimuth_deg=self.light_azimuth_deg,
            light_elevation_deg=self.light_elevation_deg,
            pixel_mm=self.pixel_mm,
            lights=self.lights,
        )


def make_part(spec: SynthSpec, number: int) -> Part:
    """Make the part with a number; it does not depend on parts made before."""
    return stamp(
        **{name: getattr(spec, name) for name in _STAMP_SETTINGS},
        fonts=spec.font,
        variation=None if spec.variation else StampingVariation.none(),
        dirt=spec.soiling.severity if spec.soiling.mixture is None else spec.soiling.mixture,
        soil=spec.soiling.soils,
        seed=(spec.seed, number),
    )


def text_of(spec: SynthSpec, number: int) -> str:
    """The text of the part with a number, without making the part."""
    return random_text(spec.format, rng=np.random.default_rng((spec.seed, number)))


def write_parts(
    spec: SynthSpec,
    folder: Path,
    *,
    parts: int,
    photos: bool = True,
    overwrite: bool = False,
    each: Callable[[Callable[[int], str], Iterable[int]], Iterable[str]] = map,
) -> list[tuple[str, str]]:
    """Write the parts as `.npz`, their photographs as `.png` and the truth as `truth.csv`; return (name, text) of each.

    `each` calls a function with every number and gives the results in order, as `map` does. Raises FileError: the
    folder cannot be written, or is not empty without `overwrite`. MapError: a photograph too large. SettingsError: no
    such number.
    """
    if not 1 <= parts <= MAX_PARTS:
        raise SettingsError(f"the number of parts is {parts}", hint=f"it must be between 1 and {MAX_PARTS:,}")
    make_folder(folder)
    if any(folder.iterdir()) and not overwrite:
        raise FileError(folder, "is not empty", "name another folder or give --overwrite")
    digits = max(3, len(str(parts - 1)))
    texts = each(partial(_write_numbered, spec, folder, digits, photos), range(parts))
    truth = [(_name(number, digits), text) for number, text in enumerate(texts)]
    write_table(folder / TRUTH_FILE, [("part", "text"), *truth])
    return truth


def _name(number: int, digits: int) -> str:
    return f"part-{number:0{digits}d}"


def _write_numbered(spec: SynthSpec, folder: Path, digits: int, photos: bool, number: int) -> str:
    return write_part(spec, folder / _name(number, digits), number, photos=photos)


def write_part(spec: SynthSpec, stem: Path, number: int, *, photos: bool) -> str:
    """Write one part as `stem`.npz and .png; for a clean one only the surface. Return its text."""
    part = make_part(spec, number)
    write_surface(stem.with_suffix(".npz"), part.height_map, part.soil)
    if photos:
        photo = spec.photograph(part)
        for light, picture in enumerate((photo, *photo.others), start=1):
            of_several = f".light-{light}" if photo.others else ""
            write_photo(stem.with_name(f"{stem.name}{of_several}.png"), picture)
    return part.text


def write_surface(path: Path, height_map: HeightMap, soil: Soil | None) -> None:
    """Write the top of a part and its soil; for a clean part only the surface."""
    members = {} if soil is None else soil_members(soil)
    # half precision resolves a tenth of a millimetre to a micrometre, at half the size
    more = {name: np.asarray(values).astype(np.float16) for name, values in members.items()}
    write_npz(path, height_map, more=more)
