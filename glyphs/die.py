"""The die: its face turns a distance from the ink into a height.

Everything here is a pure function of the signed distance, so the same die cuts strokes and outlines alike.
Bevels are measured from the land: a wall falls by tan(bevel) per millimetre. A corner with radius r is a
circular fillet tangent to both its sides, r tan(bevel/2) long on each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.glyph import Font, Glyph, signed_distance, transformed, with_stroke
from glyphs.maps import HeightMap

DEPTH_TABLE_MM: tuple[tuple[float, float], ...] = (
    (3.2, 0.15),
    (4.8, 0.20),
    (6.35, 0.25),
    (9.5, 0.41),
    (12.7, 0.43),
)
"""Usual (character height, depth of mark), mm, from physics.md."""

DEFAULT_STROKE_RATIO = 0.15
"""Stroke over height when no stroke font says otherwise: about 1.0 mm at 6.35 mm."""


class DieError(ValueError):
    """A die that cannot be cut, or cannot cut this glyph: the message says what is wrong and how to mend it."""


class Face(StrEnum):
    """Shape of the die's edge, hence of the groove's floor."""

    SHARP = "sharp"
    FLAT = "flat"
    ROUND = "round"
    DOTTED = "dotted"


@dataclass(frozen=True)
class Die:
    """A die's cutting geometry, as the mark it leaves.

    Attributes:
        face: shape of the floor.
        bevel_deg: slope of the walls from the land, degrees, 5 < bevel < 85 (30 to 60 is usual).
        depth_mm: depth of the floor below the land, > 0.
        stroke_mm: width of the groove at the land, > 0; for DOTTED the diameter of a dot. Outlined fonts have
            their own widths; there it only tells how far a ROUND floor may reach.
        root_radius_mm: fillet between wall and floor, or at the bottom of a V, >= 0.
        edge_radius_mm: rounding between wall and land, >= 0.
        burr_height_mm: height of the rim that the displaced metal raises along the groove, >= 0.
        burr_width_mm: width of that rim, > 0.
        dot_pitch_mm: distance of dots along the stroke, > 0; only DOTTED uses it.

    Raises:
        DieError: a value outside its range.
    """

    face: Face
    bevel_deg: float
    depth_mm: float
    stroke_mm: float
    root_radius_mm: float = 0.0
    edge_radius_mm: float = 0.0
    burr_height_mm: float = 0.0
    burr_width_mm: float = 0.2
    dot_pitch_mm: float = 0.6

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "face", Face(self.face))
        except ValueError:
            raise DieError(f"unknown face {self.face!r}; use one of {', '.join(Face)}") from None
        for name in ("bevel_deg", "depth_mm", "stroke_mm", "burr_width_mm", "dot_pitch_mm"):
            value = float(getattr(self, name))
            if not math.isfinite(value) or value <= 0.0:
                raise DieError(f"{name} is {value}; it must be positive")
            object.__setattr__(self, name, value)
        for name in ("root_radius_mm", "edge_radius_mm", "burr_height_mm"):
            value = float(getattr(self, name))
            if not math.isfinite(value) or value < 0.0:
                raise DieError(f"{name} is {value}; it must be zero or positive")
            object.__setattr__(self, name, value)
        if not 5.0 < self.bevel_deg < 85.0:
            raise DieError(f"bevel_deg is {self.bevel_deg}; it must lie between 5 and 85 (30 to 60 is usual)")


@dataclass(frozen=True, eq=False)
class IdealGlyph:
    """The relief of one faultless character.

    Attributes:
        height_map: the relief, plate frame.
        centre_mm: (x, y) in that map of the reference point, middle of the ink's width at mid cap height.
        ink_box_mm: (x0, y0, x1, y1) around the ink, plate frame of that map.
    """

    height_map: HeightMap
    centre_mm: tuple[float, float]
    ink_box_mm: tuple[float, float, float, float]


def default_depth_mm(height_mm: float) -> float:
    """Usual depth of a mark of that character height: linear in the table, proportional outside it.

    Raises:
        DieError: the height is not positive.
    """
    _check_height(height_mm)
    heights, depths = np.array(DEPTH_TABLE_MM).T
    nearest = float(np.clip(height_mm, heights[0], heights[-1]))
    return float(np.interp(nearest, heights, depths)) * height_mm / nearest


def default_die(
    height_mm: float,
    *,
    font: Font | None = None,
    face: Face = Face.FLAT,
    bevel_deg: float = 45.0,
    depth_mm: float | None = None,
) -> Die:
    """A well-kept die without burr for characters of that height.

    The stroke is the font's. FLAT and ROUND are widened, by a quarter at most, if the walls would meet before
    the floor; SHARP takes the width at which its V reaches the depth, between 0.4 and 1.25 of the font's
    stroke; DOTTED has dots of two thirds of the stroke, set 1.3 diameters apart.

    Raises:
        DieError: height, bevel or depth out of range.
    """
    depth = default_depth_mm(height_mm) if depth_mm is None else float(depth_mm)
    _check_height(height_mm)
    ratio = font.stroke_ratio if font is not None and font.stroke_ratio > 0.0 else DEFAULT_STROKE_RATIO
    nominal = ratio * height_mm
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
        stroke = min(max(reach, 0.4 * nominal), 1.25 * nominal)
    elif face is Face.DOTTED:
        stroke = nominal * 2 / 3
    else:
        stroke = max(nominal, min(reach, 1.25 * nominal))
    return replace(die, stroke_mm=stroke)


def relief_mm(
    signed_distance_mm: ArrayLike, die: Die, *, extra_depth_mm: ArrayLike | None = None
) -> NDArray[np.float32]:
    """Height over the land at a signed distance from the ink: the profile, ramped once.

    Args:
        signed_distance_mm: any shape, mm, negative inside the ink.
        die: the die.
        extra_depth_mm: how much deeper (or, negative, shallower) than its depth the die went in, mm, broadcast
            against the distance. A deeper blow widens the groove along its walls; less than nothing left of
            the depth leaves no mark.

    Returns:
        float32, mm, of the same shape: 0 on the land, -depth on the floor, a burr above 0 outside. A V
        follows the walls to the medial axis but never below the depth; a fillet at its root takes
        root_radius (1/cos bevel - 1) off its tip.
    """
    sd = np.asarray(signed_distance_mm, dtype=np.float32)
    bevel = math.radians(die.bevel_deg)
    slope = math.tan(bevel)
    depth: NDArray[np.float32] | float = die.depth_mm
    half: NDArray[np.float32] | float = die.stroke_mm / 2
    if extra_depth_mm is not None:
        depth = np.maximum(np.asarray(extra_depth_mm, dtype=np.float32) + np.float32(die.depth_mm), np.float32(1e-6))
        sd = sd - (depth - np.float32(die.depth_mm)) / np.float32(slope)
        half = np.maximum(half + (depth - np.float32(die.depth_mm)) / np.float32(slope), np.float32(1e-6))
    root = _root_radius_mm(die, depth, half, bevel)
    sunk = _filleted_ramp(-sd, slope, depth, root, die.edge_radius_mm, bevel, die, half)
    out = -sunk
    if die.burr_height_mm > 0.0:
        u = np.sqrt(np.clip(sd / np.float32(die.burr_width_mm), 0.0, 1.0))
        fade = np.minimum(depth / np.float32(die.depth_mm), 1.0)
        out = out + np.float32(die.burr_height_mm) * fade * np.sin(np.float32(math.pi) * u) ** 2
    return np.asarray(out, dtype=np.float32)


def die_glyph(glyph: Glyph, die: Die, *, height_mm: float) -> Glyph:
    """The shape that the die cuts: centre lines refitted to its stroke, and for DOTTED a row of dots.

    Dots sit at both ends of every stroke and evenly between, `dot_pitch_mm` apart as nearly as that allows.

    Raises:
        DieError: DOTTED with an outlined glyph (its strokes are not known), or a stroke as wide as the glyph
            is high.
    """
    _check_height(height_mm)
    stroke = die.stroke_mm / height_mm
    if glyph.contours:
        if die.face is Face.DOTTED:
            raise DieError(
                f"glyph {glyph.char!r} comes from an outlined font and has no strokes to set dots along; "
                "use a built-in font or another face"
            )
        return glyph
    if stroke >= 1.0:
        raise DieError(f"stroke_mm {die.stroke_mm} is not narrower than the height {height_mm} mm; use a finer die")
    fitted = with_stroke(glyph, stroke)
    if die.face is not Face.DOTTED:
        return fitted
    return replace(fitted, strokes=tuple(_dots(fitted.strokes, die.dot_pitch_mm / height_mm)))


def glyph_relief_mm(
    glyph: Glyph, die: Die, x_mm: ArrayLike, y_mm: ArrayLike, *, height_mm: float
) -> NDArray[np.float32]:
    """Relief of a glyph of that height at positions in its frame (x right, y up from the baseline), mm.

    Raises:
        DieError: as `die_glyph`.
    """
    shape = die_glyph(glyph, die, height_mm=height_mm)
    return shape_relief_mm(shape, die, x_mm, y_mm, height_mm=height_mm)


def shape_relief_mm(
    shape: Glyph,
    die: Die,
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    *,
    height_mm: float,
    extra_depth_mm: ArrayLike | None = None,
) -> NDArray[np.float32]:
    """Relief of what `die_glyph` returned, for callers that cut the same shape more than once."""
    x = np.asarray(x_mm, dtype=np.float64) / height_mm
    y = np.asarray(y_mm, dtype=np.float64) / height_mm
    distance = signed_distance(shape, x, y, stroke=die.stroke_mm / height_mm)
    return relief_mm(distance * np.float32(height_mm), die, extra_depth_mm=extra_depth_mm)


def ideal_relief(
    glyph: Glyph,
    die: Die,
    *,
    height_mm: float,
    pitch_mm: float,
    margin_mm: float,
    rotation_deg: float = 0.0,
    raised: bool = False,
    x_scale: float = 1.0,
    shear: float = 0.0,
) -> IdealGlyph:
    """One faultless character on a flat plate.

    Args:
        glyph: the character.
        die: the die.
        height_mm: character height.
        pitch_mm: sample pitch of the map.
        margin_mm: land around the ink, at least, >= 0.
        rotation_deg: from +x towards +y of the plate frame (clockwise as seen), about the reference point.
        raised: turn the relief over: a raised character, without burr.
        x_scale: widening of the glyph, > 0.
        shear: lean to the right, x per y.

    Returns:
        A map with an odd number of rows and columns whose middle pixel is the reference point.

    Raises:
        DieError: as `die_glyph`, or a number out of range.
        MapError: pitch not positive, or too fine for the size.
    """
    if not math.isfinite(margin_mm) or margin_mm < 0.0:
        raise DieError(f"margin_mm is {margin_mm}; it must be zero or positive")
    if not math.isfinite(x_scale) or x_scale <= 0.0:
        raise DieError(f"x_scale is {x_scale}; it must be positive")
    if not math.isfinite(pitch_mm) or pitch_mm <= 0.0:
        raise DieError(f"pitch_mm is {pitch_mm}; it must be positive")
    shape = transformed(die_glyph(glyph, die, height_mm=height_mm), x_scale=x_scale, shear=shear)
    box = shape.ink_box
    middle = ((box[0] + box[2]) / 2 * height_mm, 0.5 * height_mm)
    points = ink_points_mm(shape, height_mm=height_mm) - middle
    px, py = to_plate(points[:, 0], points[:, 1], rotation_deg=rotation_deg)
    half_ink = shape.stroke / 2 * height_mm
    x0, y0 = float(px.min()) - half_ink, float(py.min()) - half_ink
    x1, y1 = float(px.max()) + half_ink, float(py.max()) + half_ink
    half_cols = max(1, math.ceil((max(-x0, x1) + margin_mm) / pitch_mm))
    half_rows = max(1, math.ceil((max(-y0, y1) + margin_mm) / pitch_mm))
    gx = (np.arange(2 * half_cols + 1) - half_cols) * pitch_mm
    gy = (np.arange(2 * half_rows + 1) - half_rows) * pitch_mm
    u, v = to_plate(gx[None, :], gy[:, None], rotation_deg=rotation_deg)
    z = shape_relief_mm(
        shape, replace(die, burr_height_mm=0.0) if raised else die, u + middle[0], v + middle[1], height_mm=height_mm
    )
    cx, cy = half_cols * pitch_mm, half_rows * pitch_mm
    return IdealGlyph(HeightMap(-z if raised else z, pitch_mm), (cx, cy), (cx + x0, cy + y0, cx + x1, cy + y1))


def to_plate(
    x_mm: NDArray[np.float64], y_mm: NDArray[np.float64], *, rotation_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turn glyph-frame offsets (y up) into plate-frame offsets (y down), or back: the map is its own inverse."""
    c, s = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    return c * x_mm + s * y_mm, s * x_mm - c * y_mm


def ink_points_mm(shape: Glyph, *, height_mm: float) -> NDArray[np.float64]:
    """(n, 2) points whose hull, grown by half a stroke, holds the ink; the cell's corners if there is none."""
    if not shape.inked:
        x0, y0, x1, y1 = shape.ink_box
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) * height_mm
    return np.concatenate(shape.strokes + shape.contours) * height_mm


def _check_height(height_mm: float) -> None:
    if not math.isfinite(height_mm) or height_mm <= 0.0:
        raise DieError(f"height_mm is {height_mm}; it must be positive")


