"""The die's face: its dimensions, and the profile that turns a signed distance from the ink into a height.

Bevels are measured from the land: a wall falls by tan(bevel) per millimetre. A corner with radius r is a circular
fillet tangent to both its sides, r tan(bevel/2) long on each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.fonts.glyph import Font
from glyphs.ranges import NotNegative, Positive, Range, Validated, require_positive
from glyphs.stamping.errors import StampError
from glyphs.stamping.profile import Number, round_radius, sunk_depth
from glyphs.surface.display import OneLine

DEPTH_TABLE_MM: tuple[tuple[float, float], ...] = (
    (3.2, 0.15),
    (4.8, 0.20),
    (6.35, 0.25),
    (9.5, 0.41),
    (12.7, 0.43),
)
"""Usual (character height, depth of mark), mm, from docs/pages/physics.md."""

DEFAULT_STROKE_RATIO = 0.15
"""Ratio of stroke to height for fonts without their own: about 1.0 mm at 6.35 mm."""
WIDEST = 1.25
"""Greatest width of a groove, in strokes of the font."""


class Face(StrEnum):
    """Shape of the die's edge, hence of the groove's floor."""

    SHARP = "sharp"
    FLAT = "flat"
    ROUND = "round"
    DOTTED = "dotted"

    @classmethod
    def _missing_(cls, value: object) -> Face:
        raise StampError(f"unknown face {value!r}", hint=f"use one of {', '.join(cls)}")


@dataclass(frozen=True, repr=False)
class Die(OneLine, Validated, error=StampError):
    """Geometry of a die, described by the mark that it makes. Raises StampError.

    Attributes:
        bevel_deg: slope of the walls from the land, degrees, 5 to 85 (30 to 60 is usual).
        stroke_mm: width of the groove at the land, > 0; for DOTTED the diameter of a dot. Outlined fonts have
            their own widths; for them it only limits the radius of a ROUND floor.
        root_radius_mm: fillet between wall and floor, or at the bottom of a V, >= 0.
        edge_radius_mm: rounding between wall and land, >= 0.
    """

    face: Face
    bevel_deg: Annotated[float, Range(5.0, 85.0)]
    depth_mm: Positive
    stroke_mm: Positive
    root_radius_mm: NotNegative = 0.0
    edge_radius_mm: NotNegative = 0.0
    burr_height_mm: NotNegative = 0.0
    burr_width_mm: Positive = 0.2
    dot_pitch_mm: Positive = 0.6

    def __post_init__(self) -> None:
        object.__setattr__(self, "face", Face(self.face))
        super().__post_init__()


def default_depth_mm(height_mm: float) -> float:
    """Usual depth of a mark for a character height, proportional outside the table. Raises StampError."""
    require_positive(StampError, height_mm=height_mm)
    heights, depths = np.array(DEPTH_TABLE_MM).T
    nearest = float(np.clip(height_mm, heights[0], heights[-1]))
    return float(np.interp(nearest, heights, depths)) * height_mm / nearest


def nominal_stroke_mm(height_mm: float, font: Font | None) -> float:
    """Stroke of a font at a character height."""
    ratio = font.stroke_ratio if font is not None and font.stroke_ratio > 0.0 else DEFAULT_STROKE_RATIO
    return ratio * height_mm


def default_die(
    height_mm: float,
    *,
    font: Font | None = None,
    face: Face | str = Face.FLAT,
    bevel_deg: float = 45.0,
    depth_mm: float | None = None,
) -> Die:
    """A well-kept die without burr for a character height.

    The stroke is the font's. FLAT and ROUND are widened, by a quarter at most, if the walls would meet above the floor.
    SHARP has the width at which its V reaches the depth, between 0.4 and 1.25 of the font's stroke. DOTTED has dots of
    two thirds of the stroke, 1.3 diameters apart. Raises StampError.
    """
    require_positive(StampError, height_mm=height_mm)
    face = Face(face)
    depth = default_depth_mm(height_mm) if depth_mm is None else float(depth_mm)
    nominal = nominal_stroke_mm(height_mm, font)
    die = Die(
        face=face,
        bevel_deg=bevel_deg,
        depth_mm=depth,
        stroke_mm=nominal,
        root_radius_mm=0.05 * depth if face is Face.SHARP else 0.15 * depth,
        edge_radius_mm=0.1 * depth,
        burr_width_mm=0.3 * nominal,
        dot_pitch_mm=1.3 * nominal * 2 / 3,
    )
    bevel = math.radians(bevel_deg)
    reach = 2 * (depth + die.root_radius_mm * (1 / math.cos(bevel) - 1)) / math.tan(bevel)
    if face is Face.SHARP:
        stroke = min(max(reach, 0.4 * nominal), WIDEST * nominal)
    elif face is Face.DOTTED:
        stroke = nominal * 2 / 3
    else:
        stroke = max(nominal, min(reach, WIDEST * nominal))
    return replace(die, stroke_mm=stroke)


def relief_mm(
    signed_distance_mm: ArrayLike,  # any shape, mm, negative inside the ink
    die: Die,
    *,
    # half the stroke, if the ink is a stroke; the root of a V is then rounded, which makes it shallower by
    # root_radius (1/cos bevel - 1). None for outlines: a V runs to the medial axis.
    half_width_mm: float | None = None,
    # depth of the blow beyond the nominal depth (negative: less), mm, broadcast against the distance. A
    # deeper blow widens the groove along its walls; where the depth vanishes there is no mark.
    extra_depth_mm: ArrayLike | None = None,
) -> NDArray[np.float32]:
    """Height of the profile over the land, float32, mm: 0 on the land, never below -depth, a burr above 0 outside."""
    sd = np.asarray(signed_distance_mm, dtype=np.float32)
    bevel = math.radians(die.bevel_deg)
    depth: Number = die.depth_mm
    half: Number = die.stroke_mm / 2 if half_width_mm is None else half_width_mm
    if extra_depth_mm is not None:
        depth = np.maximum(
            np.asarray(extra_depth_mm, dtype=np.float32) + np.float32(die.depth_mm), np.float32(1e-6)
        )
        widening = (depth - np.float32(die.depth_mm)) / np.float32(math.tan(bevel))
        sd = sd - widening
        half = np.maximum(half + widening, np.float32(1e-6))
    root: Number = die.root_radius_mm
    if die.face is Face.ROUND:
        root = np.maximum(root, round_radius(depth, half, bevel_rad=bevel))
    out = -sunk_depth(
        -sd,
        depth=depth,
        half_width=None if half_width_mm is None else half,
        bevel_rad=bevel,
        root_radius=root,
        edge_radius=die.edge_radius_mm,
    )
    if die.burr_height_mm > 0.0:
        # The rim is highest a quarter of its width from the groove, and falls to zero at its width.
        u = np.sqrt(np.clip(sd / np.float32(die.burr_width_mm), 0.0, 1.0))
        fade = np.minimum(depth / np.float32(die.depth_mm), 1.0)
        out = out + np.float32(die.burr_height_mm / 2) * fade * (1 - np.cos(np.float32(2 * math.pi) * u))
    return np.asarray(out, dtype=np.float32)
