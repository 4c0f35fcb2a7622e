"""One stamped part, from its text to its photograph::

    text, font, die --stamp_line--> StampedPart --soil_part--> SoiledPart --photograph--> Photo

Separate random streams, so that the same part can be clean or dirty and be seen in different lights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from glyphs.camera.appearance import draw_light, photograph
from glyphs.camera.photo import Photo
from glyphs.camera.pose import DEFAULT_PIXEL_MM, Camera, draw_camera
from glyphs.camera.shading import Light
from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import load_font
from glyphs.fonts.serials import random_text
from glyphs.soiling.soil import Soil
from glyphs.soiling.soiled import WORKSHOP, SoiledPart, Soiling, soil_part
from glyphs.soiling.workshop.mixture import Dirt
from glyphs.stamping.dies import DIES
from glyphs.stamping.errors import StampError, pick
from glyphs.stamping.faces import Face, default_die
from glyphs.stamping.layouts import LAYOUTS, Layout
from glyphs.stamping.plates import PLATES
from glyphs.stamping.stamp import StampedPart, stamp_line
from glyphs.stamping.variation import PRACTICES, PlateVariation, StampingVariation
from glyphs.surface.display import picture_html
from glyphs.surface.maps import HeightMap

_SOIL_STREAM, _PHOTO_STREAM, _LAYOUT_STREAM, _NOISE_STREAM = 1, 2, 3, 4


@dataclass(frozen=True, eq=False)
class Part:
    """A stamped part; dirt draws from (*seed, 1), a photograph from (*seed, 2), a layout from (*seed, 3)."""

    stamped: StampedPart
    soiling: Soiling
    seed: tuple[int, ...]

    def __repr__(self) -> str:
        words = f"{self.text!r}, {self.stamped.font_name!r}, {self.height_mm:g} mm"
        return f"Part({words}, {self.soiling}, seed={self.seed})"

    def _repr_html_(self) -> str:
        return picture_html(self, self.height_map.z_mm)

    @property
    def text(self) -> str:
        return self.stamped.text

    @property
    def height_mm(self) -> float:
        return self.stamped.height_mm

    @property
    def height_map(self) -> HeightMap:
        return self.stamped.height_map if self.soiling.clean else self.soiled.height_map

    @property
    def soil(self) -> Soil | None:
        """The soft dirt and the friction of the surface; None for a clean part."""
        return None if self.soiling.clean else self.soiled.soil

    @cached_property
    def soiled(self) -> SoiledPart:
        return soil_part(self.stamped, self.soiling, rng=self._rng(_SOIL_STREAM))

    def photograph(
        self,
        *,
        light: Light | None = None,
        camera: Camera | None = None,
        light_azimuth_deg: float | None = None,
        light_elevation_deg: float | None = None,
        pixel_mm: float = DEFAULT_PIXEL_MM,
        lights: int = 1,
    ) -> Photo:
        """Take a picture of the part; by default light and camera are drawn at random, independent of the dirt. Of
        several `lights`, at even angles all round, those after the first become its `others`. Raises MapError."""
        rng = self._rng(_PHOTO_STREAM)
        drawn = draw_light(rng, azimuth_deg=light_azimuth_deg, elevation_deg=light_elevation_deg)
        camera_drawn = draw_camera(rng, pitch_mm=pixel_mm)
        first, stands = light or drawn, camera or camera_drawn
        picture = photograph(self.soiled, first, stands, rng=rng)
        noise = self._rng(_NOISE_STREAM)
        around = ((first.azimuth_deg + 360.0 * k / lights) % 360.0 for k in range(1, lights))
        turned = (replace(first, azimuth_deg=azimuth_deg) for azimuth_deg in around)
        others = tuple(photograph(self.soiled, each, stands, rng=noise) for each in turned)
        return replace(picture, others=others)

    def _rng(self, stream: int) -> np.random.Generator:
        return np.random.default_rng([*self.seed, stream])


def stamp(
    text: str | None = None,
    *,
    format: str | None = None,
    fonts: str | Path | Font | Sequence[str | Path | Font] = "gothic",
    height_mm: float = 5.0,
    depth_mm: float | None = None,
    face: Face | str = Face.FLAT,
    bevel_deg: float = 45.0,
    raised: bool = False,
    line_rotation_deg: float = 0.0,
    pitch_mm: float | None = None,
    variation: StampingVariation | None = None,
    practice: str | None = None,
    die: str | None = None,
    plate: str | PlateVariation | None = None,
    layout: str | Layout | None = None,
    dirt: float | Dirt = 0.0,
    soil: str | Sequence[str] = WORKSHOP,
    seed: int | Sequence[int] = 0,
) -> Part:
    """Stamp a serial on a plate: `text`, or one drawn from a `format` (`A` a letter, `9` a digit, `*` either).

    Args:
        fonts: built-in name, font file or font; only one, alone or in a list.
        line_rotation_deg: rotation of the line on the plate, clockwise as the picture shows it.
        pitch_mm: sample pitch; default: a hundredth of the height.
        variation: variation of blows and plate, `StampingVariation.none()` for an ideal part; or name a `practice`.
        plate: a name of `PLATES`, or a plate, in place of the variation's.
        layout: a name of `LAYOUTS`, or a layout; with two lines, `text` is the first.
        dirt: severity 0 (clean) to 1, or the amount of each kind of workshop dirt.
        soil: a name of `glyphs.SOILS` or module:function, or several, the bottom layer first.
        seed: the same seed gives the same part.

    Raises StampError, FontError, FormatError or MapError.
    """
    if (text is None) == (format is None):
        raise StampError("give the text to stamp, or the format of a serial to draw")
    key = tuple(int(number) for number in np.atleast_1d(seed))
    if min(key, default=-1) < 0:
        raise StampError(f"seed is {seed}", hint="give one or more numbers that are not negative")
    rng = np.random.default_rng(key)
    several = (fonts,) if isinstance(fonts, str | Path | Font) else tuple(fonts)
    if len(several) != 1:
        raise StampError(f"{len(several)} fonts are given", hint="give one: a line is stamped in one font")
    letters = several[0] if isinstance(several[0], Font) else load_font(several[0])
    line = random_text(format, rng=rng) if format is not None else text or ""
    if variation is not None and practice is not None:
        raise StampError(
            "give either a variation of blows or a practice", hint="leave out variation or practice"
        )
    how = variation or pick("practice", PRACTICES, practice or "press")()
    face, measures = Face(face), {"font": letters, "bevel_deg": bevel_deg, "depth_mm": depth_mm}
    if die is None:
        cutting = default_die(height_mm, face=face, **measures)  # type: ignore[arg-type]
    elif face is not Face.FLAT:
        raise StampError(f"the die {die!r} has its own face", hint="leave out the face")
    else:
        kind = pick("die", DIES, die)
        how, cutting = kind.applied(how), kind.die(height_mm, **measures)  # type: ignore[arg-type]
    # stamp_line refuses characters that the font lacks
    length_mm = height_mm * sum(letters.glyphs[char].advance for char in line if char in letters.glyphs)
    if isinstance(plate, str):
        plate = pick("plate", PLATES, plate)(height_mm, length_mm)
    if isinstance(layout, str):
        layout_rng = np.random.default_rng([*key, _LAYOUT_STREAM])
        layout = pick("layout", LAYOUTS, layout)(layout_rng, height_mm, length_mm, letters, line)
    stamped = stamp_line(
        line,
        letters,
        cutting,
        height_mm=height_mm,
        pitch_mm=pitch_mm,
        line_rotation_deg=line_rotation_deg,
        layout=layout,
        variation=how if plate is None else replace(how, plate=plate),
        raised=raised,
        rng=rng,
    )
    soils = (soil,) if isinstance(soil, str) else tuple(soil)
    soiling = Soiling(soils, mixture=dirt) if isinstance(dirt, Dirt) else Soiling(soils, dirt)
    return Part(stamped, soiling, key)
