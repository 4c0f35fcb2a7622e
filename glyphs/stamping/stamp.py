"""A serial on a plate, as hammers and presses leave it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, Glyph
from glyphs.stamping.die import Die, die_glyph, ink_points_mm, shape_relief_mm, to_plate
from glyphs.stamping.plate import plate_form, plate_texture
from glyphs.stamping.variation import PlateVariation, StampError, StampingVariation
from glyphs.surface.display import one_line
from glyphs.surface.maps import MAX_PIXELS, HeightMap, MapError

__all__ = ["PlateVariation", "StampError", "StampedPart", "StampingVariation", "stamp_line"]

Box = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class StampedPart:
    """A stamped plate and what is known about it.

    Attributes:
        height_map: the surface.
        text: what was stamped.
        height_mm: character height.
        boxes_mm: (x0, y0, x1, y1) around the ink of each character, plate frame; a space has its empty cell.
        font_name: the font's name.

    Raises:
        ValueError: as many boxes as characters are needed.
    """

    height_map: HeightMap
    text: str
    height_mm: float
    boxes_mm: tuple[Box, ...]
    font_name: str

    __repr__ = one_line

    def __post_init__(self) -> None:
        if len(self.boxes_mm) != len(self.text):
            raise ValueError(
                f"{len(self.boxes_mm)} boxes for the {len(self.text)} characters of {self.text!r}"
            )


@dataclass(frozen=True)
class _Blow:
    """One character's blow: where it lands (plate offset of the ink's centre, mm) and how."""

    x_mm: float
    y_mm: float
    rotation_deg: float
    depth_factor: float
    tilt_x: float
    tilt_y: float
    worn: bool
    faint_deg: float
    second_mm: tuple[float, float] | None
    burr_fraction: float


def stamp_line(
    text: str,
    font: Font,
    die: Die,
    *,
    height_mm: float,
    pitch_mm: float | None = None,
    spacing: float = 0.0,
    margin_mm: float | None = None,
    line_rotation_deg: float = 0.0,
    variation: StampingVariation | None = None,
    raised: bool = False,
    rng: np.random.Generator,
) -> StampedPart:
    """Stamp a line of text.

    Args:
        text: at least one character, all of them in the font.
        font: the letters.
        die: face, bevel, depth and so on, common to all of them.
        height_mm: character height, ink to ink.
        pitch_mm: sample pitch; a hundredth of the height if not given.
        spacing: gap added to the font's own advance, cap heights; may be negative.
        margin_mm: land around the line, 0.8 of the height if not given.
        line_rotation_deg: of the whole line, from +x towards +y of the plate frame (clockwise as seen).
        variation: how the blows differ; the defaults of `StampingVariation` if not given.
        raised: characters stand out of the plate (no burr).
        rng: the only source of randomness; the same state gives the same part.

    Raises:
        FontError: a character that the font lacks.
        StampError: no text, a number out of range, or a die that cannot cut the glyphs.
        MapError: pitch not positive or too fine for the size.
    """
    pitch = height_mm / 100 if pitch_mm is None else pitch_mm
    margin = 0.8 * height_mm if margin_mm is None else margin_mm
    how = StampingVariation() if variation is None else variation
    _check(text, height_mm=height_mm, pitch_mm=pitch, margin_mm=margin, spacing=spacing)
    shapes = [die_glyph(font.glyph(char), die, height_mm=height_mm) for char in text]
    if raised:
        die, how = replace(die, burr_height_mm=0.0), replace(how, burr_fraction=0.0)

    centres, extent = _layout(shapes, height_mm=height_mm, spacing=spacing, rotation_deg=line_rotation_deg)
    x_low, y_low, x_high, y_high = extent
    cols = max(2, math.ceil((x_high - x_low + 2 * margin) / pitch - 1e-6) + 1)
    rows = max(2, math.ceil((y_high - y_low + 2 * margin) / pitch - 1e-6) + 1)
    if rows * cols > MAX_PIXELS:
        raise MapError(
            f"{rows} x {cols} samples exceed the limit of {MAX_PIXELS:,}",
            hint=f"use a coarser pitch_mm than {pitch}",
        )
    x = np.arange(cols, dtype=np.float64) * np.float64(pitch)
    y = np.arange(rows, dtype=np.float64) * np.float64(pitch)

    relief = np.zeros((rows, cols), dtype=np.float32)
    boxes: list[Box] = []
    for shape, (cx, cy) in zip(shapes, centres, strict=True):
        blow = _draw_blow(
            how, rng, x_mm=cx + margin - x_low, y_mm=cy + margin - y_low,
            height_mm=height_mm, rotation_deg=line_rotation_deg,
        )  # fmt: skip
        boxes.append(_strike(relief, x, y, shape, die, blow, height_mm=height_mm))
    texture = plate_texture(x, y, how.plate, rng=rng)
    if how.plate.ironing > 0.0:
        texture *= 1.0 - np.float32(how.plate.ironing) * np.clip(-relief / np.float32(die.depth_mm), 0.0, 1.0)
    z = plate_form(x, y, how.plate, rng=rng) + texture + (-relief if raised else relief)
    return StampedPart(HeightMap(z, pitch), text, height_mm, tuple(boxes), font.name)


def _check(text: str, *, height_mm: float, pitch_mm: float, margin_mm: float, spacing: float) -> None:
    if not text:
        raise StampError("there is no text to stamp", hint="give at least one character")
    for name, value, least in (("height_mm", height_mm, 0.0), ("pitch_mm", pitch_mm, 0.0)):
        if not math.isfinite(value) or value <= least:
            raise StampError(f"{name} is {value}", hint="it must be positive")
    if not math.isfinite(margin_mm) or margin_mm < 0.0:
        raise StampError(f"margin_mm is {margin_mm}", hint="it must be zero or positive")
    if not math.isfinite(spacing):
        raise StampError(f"spacing is {spacing}", hint="it must be a finite number of cap heights")


def _middle(shape: Glyph, height_mm: float) -> tuple[float, float]:
    """Reference point of a character in its own frame: middle of the ink's width at mid cap height, mm."""
    x0, _, x1, _ = shape.ink_box
    return ((x0 + x1) / 2 * height_mm, height_mm / 2)


def _layout(
    shapes: list[Glyph], *, height_mm: float, spacing: float, rotation_deg: float
) -> tuple[list[tuple[float, float]], Box]:
    """Reference points in the plate frame about the line's origin, and the extent of faultless ink, mm."""
    origin = 0.0
    centres: list[tuple[float, float]] = []
    corners = []
    for shape in shapes:
        mx, my = _middle(shape, height_mm)
        cx, cy = to_plate(origin + mx, my, rotation_deg=rotation_deg)
        centres.append((float(cx), float(cy)))
        corners.append(_plate_box(shape, centres[-1], rotation_deg, height_mm=height_mm, grow_mm=0.0))
        origin += (shape.advance + spacing) * height_mm
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return centres, (float(low[0]), float(low[1]), float(high[2]), float(high[3]))


def _plate_box(
    shape: Glyph, centre: tuple[float, float], rotation_deg: float, *, height_mm: float, grow_mm: float
) -> Box:
    """Box around the ink of a rotated character in the plate frame, mm."""
    points = ink_points_mm(shape, height_mm=height_mm) - _middle(shape, height_mm)
    px, py = to_plate(points[:, 0], points[:, 1], rotation_deg=rotation_deg)
    half = (shape.stroke / 2 * height_mm if shape.inked else 0.0) + grow_mm
    return (
        centre[0] + float(px.min()) - half,
        centre[1] + float(py.min()) - half,
        centre[0] + float(px.max()) + half,
        centre[1] + float(py.max()) + half,
    )


def _draw_blow(
    how: StampingVariation,
    rng: np.random.Generator,
    *,
    x_mm: float,
    y_mm: float,
    height_mm: float,
    rotation_deg: float,
) -> _Blow:
    """Draw one blow. The number of draws never depends on the values, so parts differ only where asked."""
    normal = np.clip(rng.standard_normal(8), -2.5, 2.5)
    chance = rng.uniform(size=4)
    along, rise = normal[0] * how.spacing_fraction * height_mm, normal[1] * how.baseline_fraction * height_mm
    dx, dy = to_plate(along, rise, rotation_deg=rotation_deg)
    worn = bool(chance[0] < how.worn_probability)
    heading = 2 * math.pi * float(chance[2])
    step = how.double_strike_fraction * height_mm * (1.0 + 0.3 * float(normal[6]))
    double = bool(chance[1] < how.double_strike_probability)
    return _Blow(
        x_mm=x_mm + float(dx),
        y_mm=y_mm + float(dy),
        rotation_deg=rotation_deg + how.rotation_deg * float(normal[2]),
        depth_factor=max(0.2, 1.0 + how.depth_fraction * float(normal[3])) * (0.75 if worn else 1.0),
        tilt_x=how.tilt_fraction * float(normal[4]),
        tilt_y=how.tilt_fraction * float(normal[5]),
        worn=worn,
        faint_deg=360.0 * float(chance[3]),
        second_mm=(step * math.cos(heading), step * math.sin(heading)) if double else None,
        burr_fraction=how.burr_fraction * max(0.0, 1.0 + 0.4 * float(normal[7])),
    )


def _strike(
    relief: NDArray[np.float32],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    shape: Glyph,
    die: Die,
    blow: _Blow,
    *,
    height_mm: float,
) -> Box:
    """Add one character to the relief, in place, and return the box of its ink, clipped to the plate."""
    if blow.worn:
        die = replace(
            die,
            edge_radius_mm=die.edge_radius_mm + die.depth_mm,
            root_radius_mm=die.root_radius_mm + 0.5 * die.depth_mm,
        )
    burr = die.burr_height_mm + blow.burr_fraction * die.depth_mm
    die = replace(die, burr_height_mm=burr)
    blows = [((blow.x_mm, blow.y_mm), blow.depth_factor)]
    if blow.second_mm is not None:
        blows.append(
            ((blow.x_mm + blow.second_mm[0], blow.y_mm + blow.second_mm[1]), 0.7 * blow.depth_factor)
        )
    boxes = []
    for centre, factor in blows:
        deepest = max(0.0, factor * (1.0 + abs(blow.tilt_x) + abs(blow.tilt_y)) - 1.0) * die.depth_mm
        widening = deepest / math.tan(math.radians(die.bevel_deg))
        box = _plate_box(shape, centre, blow.rotation_deg, height_mm=height_mm, grow_mm=widening)
        boxes.append(box)
        if not shape.inked:
            continue
        reach = die.edge_radius_mm + (die.burr_width_mm if burr > 0.0 else 0.0) + (x[1] - x[0])
        columns = slice(*np.searchsorted(x, (box[0] - reach, box[2] + reach)))
        lines = slice(*np.searchsorted(y, (box[1] - reach, box[3] + reach)))
        if columns.start == columns.stop or lines.start == lines.stop:
            continue
        u, v = to_plate(
            x[None, columns] - centre[0], y[lines, None] - centre[1], rotation_deg=blow.rotation_deg
        )
        new = _blow_relief(shape, die, blow, factor, u, v, height_mm=height_mm)
        old = relief[lines, columns]
        # Where either blow cut, the deeper one shows; where both only raised a rim, the higher.
        relief[lines, columns] = np.where(
            (new < 0.0) | (old < 0.0), np.minimum(new, old), np.maximum(new, old)
        )
    low, high = np.min(boxes, axis=0), np.max(boxes, axis=0)
    return (
        float(np.clip(low[0], 0.0, x[-1])),
        float(np.clip(low[1], 0.0, y[-1])),
        float(np.clip(high[2], 0.0, x[-1])),
        float(np.clip(high[3], 0.0, y[-1])),
    )


def _blow_relief(
    shape: Glyph,
    die: Die,
    blow: _Blow,
    factor: float,
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    *,
    height_mm: float,
) -> NDArray[np.float32]:
    """Relief of one blow at offsets (u right, v up) from the character's reference point, mm."""
    middle = _middle(shape, height_mm)
    extra = None
    if factor != 1.0 or blow.tilt_x != 0.0 or blow.tilt_y != 0.0:
        tilt = 1.0 + blow.tilt_x * (u / height_mm) + blow.tilt_y * (v / height_mm)
        extra = die.depth_mm * (factor * np.maximum(tilt, 0.0) - 1.0)
    z = shape_relief_mm(shape, die, u + middle[0], v + middle[1], height_mm=height_mm, extra_depth_mm=extra)
    if blow.worn:
        # A chipped or rounded die prints faintly towards one side.
        heading = math.radians(blow.faint_deg)
        across = (u * math.cos(heading) + v * math.sin(heading)) / height_mm
        z = z * (1.0 - 0.6 / (1.0 + np.exp(-(across - 0.25) / 0.08))).astype(np.float32)
    return z
