"""Relief of a glyph cut by a die, and one perfect character on a flat plate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.fonts.glyph import Glyph, Points, signed_distance, with_stroke
from glyphs.ranges import require_not_negative, require_positive
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import Die, Face, relief_mm
from glyphs.surface.display import OneLine
from glyphs.surface.maps import MAX_PIXELS, HeightMap, MapError

Box = tuple[float, float, float, float]
"""x0, y0, x1, y1."""
_CORNER_RAD = math.radians(35.0)  # flattened arcs turn by a few degrees per segment, Hershey's by up to 30


@dataclass(frozen=True, eq=False, repr=False)
class IdealGlyph(OneLine):
    """The relief of one perfect character; `centre_mm` is the middle of the ink's width at mid cap height."""

    height_map: HeightMap
    centre_mm: tuple[float, float]


def die_glyph(glyph: Glyph, die: Die, *, height_mm: float) -> Glyph:
    """The shape that the die cuts: centre lines refitted to its stroke, and for DOTTED dots at the ends and corners of
    every stroke and evenly between, about `dot_pitch_mm` apart. Raises StampError: DOTTED with an outlined glyph (its
    strokes are not known), or a stroke wider than the glyph is high."""
    require_positive(StampError, height_mm=height_mm)
    stroke = die.stroke_mm / height_mm
    if glyph.contours:
        if die.face is Face.DOTTED:
            raise StampError(
                f"glyph {glyph.char!r} comes from an outlined font and has no strokes to set dots along",
                hint="use a built-in font or another face",
            )
        return glyph
    if stroke >= 1.0:
        raise StampError(
            f"stroke_mm {die.stroke_mm} is not narrower than the height {height_mm} mm",
            hint="use a finer die",
        )
    fitted = with_stroke(glyph, stroke)
    if die.face is not Face.DOTTED:
        return fitted
    return replace(fitted, strokes=tuple(_dots(fitted.strokes, die.dot_pitch_mm / height_mm)))


def shape_relief_mm(
    shape: Glyph,
    die: Die,
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    *,
    height_mm: float,
) -> NDArray[np.float32]:
    """Relief of a shape that `die_glyph` returned, for callers that cut the same shape more than once."""
    return relief_mm(
        shape_distance_mm(shape, die, x_mm, y_mm, height_mm=height_mm),
        die,
        half_width_mm=None if shape.contours else die.stroke_mm / 2,
    )


def shape_distance_mm(
    shape: Glyph, die: Die, x_mm: ArrayLike, y_mm: ArrayLike, *, height_mm: float
) -> NDArray[np.float32]:
    """Signed distance from the ink of a shape that `die_glyph` returned, mm, negative inside it."""
    x = np.asarray(x_mm, dtype=np.float64) / height_mm
    y = np.asarray(y_mm, dtype=np.float64) / height_mm
    return signed_distance(shape, x, y, stroke=die.stroke_mm / height_mm) * np.float32(height_mm)


def ideal_relief(
    glyph: Glyph,
    die: Die,
    *,
    height_mm: float,
    pitch_mm: float,
    margin_mm: float,
    raised: bool = False,
) -> IdealGlyph:
    """Make one perfect character on a flat plate, its reference point at the middle of an odd map. Raises MapError."""
    require_not_negative(StampError, margin_mm=margin_mm)
    require_positive(StampError, pitch_mm=pitch_mm)
    shape = die_glyph(glyph, die, height_mm=height_mm)
    middle = middle_mm(shape, height_mm)
    x0, y0, x1, y1 = plate_box(shape, (0.0, 0.0), 0.0, height_mm=height_mm, grow_mm=0.0)
    half_cols = max(1, math.ceil((max(-x0, x1) + margin_mm) / pitch_mm))
    half_rows = max(1, math.ceil((max(-y0, y1) + margin_mm) / pitch_mm))
    if (2 * half_cols + 1) * (2 * half_rows + 1) > MAX_PIXELS:
        raise MapError(
            f"pitch_mm {pitch_mm} gives more than {MAX_PIXELS:,} samples, the limit", hint="use a coarser one"
        )
    gx = (np.arange(2 * half_cols + 1) - half_cols) * pitch_mm
    gy = (np.arange(2 * half_rows + 1) - half_rows) * pitch_mm
    z = shape_relief_mm(
        shape,
        replace(die, burr_height_mm=0.0) if raised else die,
        gx[None, :] + middle[0],
        middle[1] - gy[:, None],
        height_mm=height_mm,
    )
    centre = half_cols * pitch_mm, half_rows * pitch_mm
    return IdealGlyph(HeightMap(-z if raised else z, pitch_mm), centre)


def to_plate(
    x_mm: ArrayLike, y_mm: ArrayLike, *, rotation_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Convert glyph-frame offsets (y up) to the plate frame (y down), or back: the map is its own inverse."""
    c, s = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    x, y = np.asarray(x_mm, dtype=np.float64), np.asarray(y_mm, dtype=np.float64)
    return c * x + s * y, s * x - c * y


def middle_mm(shape: Glyph, height_mm: float) -> tuple[float, float]:
    """Reference point of a character in its own frame: middle of the ink's width at mid cap height, mm."""
    x0, _, x1, _ = shape.ink_box
    return ((x0 + x1) / 2 * height_mm, height_mm / 2)


def plate_box(
    shape: Glyph, centre: tuple[float, float], rotation_deg: float, *, height_mm: float, grow_mm: float
) -> Box:
    """Box around the ink of a rotated character in the plate frame, mm."""
    points = ink_points_mm(shape, height_mm=height_mm) - middle_mm(shape, height_mm)
    px, py = to_plate(points[:, 0], points[:, 1], rotation_deg=rotation_deg)
    half = (shape.stroke / 2 * height_mm if shape.inked else 0.0) + grow_mm
    x0, y0 = (np.add(centre, [px.min(), py.min()]) - half).tolist()
    x1, y1 = (np.add(centre, [px.max(), py.max()]) + half).tolist()
    return x0, y0, x1, y1


def ink_points_mm(shape: Glyph, *, height_mm: float) -> NDArray[np.float64]:
    """(n, 2) points whose hull, grown by half a stroke, contains the ink; without ink, the corners of the cell."""
    if not shape.inked:
        x0, y0, x1, y1 = shape.ink_box
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) * height_mm
    return np.concatenate(shape.strokes + shape.contours) * height_mm


def _dots(strokes: tuple[Points, ...], pitch: float) -> list[Points]:
    dots = np.empty((0, 2))
    for line in strokes:
        for run in _runs(line):
            along = np.append(0.0, np.cumsum(np.hypot(*np.diff(run, axis=0).T)))
            stations = np.linspace(0.0, along[-1], max(1, round(float(along[-1]) / pitch)) + 1)
            points = np.column_stack(
                [np.interp(stations, along, run[:, 0]), np.interp(stations, along, run[:, 1])]
            )
            for point in points:
                if (np.hypot(*(point - dots).T) > 0.6 * pitch).all():
                    dots = np.vstack([dots, point])
    return [dot[None] for dot in dots]


def _runs(line: Points) -> list[Points]:
    heading = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
    corners = np.flatnonzero(np.abs(np.diff(heading)) > _CORNER_RAD) + 1
    ends = [0, *(int(c) for c in corners), len(line) - 1]
    return [line[a : b + 1] for a, b in pairwise(ends)]
