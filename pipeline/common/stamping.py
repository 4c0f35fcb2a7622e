"""Settings of stamped parts, with the help texts of their flags; the registries of `glyphs` are too heavy for help."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

FaceName = Literal["sharp", "flat", "round", "dotted"]
DieName = Literal["flat", "sharp", "blunt-v", "round", "dotted", "lopsided", "double", "one-flank"]
PlateName = Literal[
    "machined", "cylinder", "ring", "saddle", "bow", "milled", "turned", "faced", "ground", "sand"
]
PracticeName = Literal["press", "hand", "ideal"]
LayoutName = Literal["straight", "turned", "arc", "two-lines"]


@dataclass(frozen=True)
class Stamping:
    """Stamping and photographs of the parts.

    Attributes:
        format: Mask of the serials: A letter, 9 digit, * either, any other character itself.
        font: Built-in name or TTF/OTF file.
        seed: Random seed: the same seed gives the same parts.
        height_mm: Character height in mm.
        depth_mm: Depth of the marks in mm (default: the usual one for the height).
        face: Face of the die.
        bevel_deg: Slope of the walls, degrees.
        raised: Raised marks instead of sunk ones.
        variation: Let blows and plates differ as in a shop.
        practice: Way of stamping: by a press (default), by hand with single stamps, or ideally.
        die: In place of a face: also a V with a blunt edge, pile-up on one side, double strikes, one wall missing.
        plate: Surface of the part: bent (cylinder: line along its axis; ring: around it), or left rough by a tool.
        layout: A straight line, one turned by up to 5 degrees, an arc, or another line above or below.
        pixel_mm: Size of a pixel on the part, mm.
        light_azimuth_deg: Direction of the lamp: 0 right, 90 below, 270 above (default: drawn at random).
        light_elevation_deg: Elevation of the lamp over the plate (default: drawn from 25 to 65).
        lights: Photographs of each part, PART.light-1.png and so on, each with the lamp on another side.
    """

    format: str
    font: str = "gothic"
    seed: int = 0
    height_mm: float = 5.0
    depth_mm: float | None = None
    face: FaceName = "flat"
    bevel_deg: float = 45.0
    raised: bool = False
    variation: bool = True
    practice: PracticeName | None = None
    die: DieName | None = None
    plate: PlateName | None = None
    layout: LayoutName | None = None
    pixel_mm: float = 0.06
    light_azimuth_deg: float | None = None
    light_elevation_deg: float | None = None
    lights: int = 1
