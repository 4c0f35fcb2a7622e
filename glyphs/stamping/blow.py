"""Draw a blow and strike it into the relief."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Glyph
from glyphs.stamping.die import Box, middle_mm, plate_box, shape_distance_mm, to_plate
from glyphs.stamping.faces import Die, relief_mm
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.display import OneLine


@dataclass(frozen=True, repr=False)
class Blow(OneLine):
    """The blow of one character: position (plate offset of the ink's centre, mm), depth, tilt and wear."""

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
    # direction in which the stamp leans, in the plate frame, and shares by which the burr on that side is higher and
    # the wall shallower
    lean_deg: float = 0.0
    pile_up_lean: float = 0.0
    flank_loss: float = 0.0


def draw_stances(how: StampingVariation, count: int, *, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw how a hand leans, degrees, and how far its baseline has shifted, heights: (count, 2)."""
    if how.pile_up_lean == how.flank_loss == how.jump_probability == 0.0:
        return np.zeros((count, 2))
    hand_rng = rng.spawn(1)[0]  # `rng` itself stays as it is
    # a hand leans in one direction all along a part
    leans = np.degrees(hand_rng.uniform(0.0, 2 * math.pi)) + 25.0 * hand_rng.standard_normal(count)
    jumps = hand_rng.uniform(size=count) < how.jump_probability
    steps = jumps * how.jump_fraction * np.clip(hand_rng.standard_normal(count), -2.0, 2.0)
    rises = np.zeros(count)
    for k in range(count):
        # the hand corrects itself: half of the shift is left after the next jump
        before = rises[k - 1] if k else 0.0
        rises[k] = before * (0.5 if jumps[k] else 1.0) + steps[k]
    return np.stack([leans, rises], axis=1)


def draw_blow(
    how: StampingVariation,
    stance: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    at_mm: tuple[float, float],
    height_mm: float,
    rotation_deg: float,
) -> Blow:
    """Draw one blow. The number of draws never depends on the values, so parts differ only where settings do."""
    normal = np.clip(rng.standard_normal(8), -2.5, 2.5)
    chance = rng.uniform(size=4)
    along = normal[0] * how.spacing_fraction * height_mm
    lean_deg, wandered = stance.tolist()
    rise = (normal[1] * how.baseline_fraction + wandered) * height_mm
    dx, dy = to_plate(along, rise, rotation_deg=rotation_deg)
    worn = bool(chance[0] < how.worn_probability)
    heading = 2 * math.pi * float(chance[2])
    step = how.double_strike_fraction * height_mm * (1.0 + 0.3 * float(normal[6]))
    double = bool(chance[1] < how.double_strike_probability)
    return Blow(
        x_mm=at_mm[0] + float(dx),
        y_mm=at_mm[1] + float(dy),
        rotation_deg=rotation_deg + how.rotation_deg * float(normal[2]),
        depth_factor=max(0.2, 1.0 + how.depth_fraction * float(normal[3])) * (0.75 if worn else 1.0),
        tilt_x=how.tilt_fraction * float(normal[4]),
        tilt_y=how.tilt_fraction * float(normal[5]),
        worn=worn,
        faint_deg=360.0 * float(chance[3]),
        second_mm=(step * math.cos(heading), step * math.sin(heading)) if double else None,
        burr_fraction=how.burr_fraction * max(0.0, 1.0 + 0.4 * float(normal[7])),
        lean_deg=lean_deg,
        pile_up_lean=how.pile_up_lean,
        flank_loss=how.flank_loss,
    )


def strike(
    relief: NDArray[np.float32],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    shape: Glyph,
    die: Die,
    blow: Blow,
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
        box = plate_box(shape, centre, blow.rotation_deg, height_mm=height_mm, grow_mm=widening)
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
        # where a blow cut, the deeper one counts; where both only raised a rim, the higher one
        relief[lines, columns] = np.where(
            (new < 0.0) | (old < 0.0), np.minimum(new, old), np.maximum(new, old)
        )
    hull = np.append(np.min(boxes, axis=0)[:2], np.max(boxes, axis=0)[2:])
    x0, y0, x1, y1 = np.clip(hull, 0.0, [x[-1], y[-1]] * 2).tolist()
    return x0, y0, x1, y1


def _blow_relief(
    shape: Glyph,
    die: Die,
    blow: Blow,
    factor: float,
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    *,
    height_mm: float,
) -> NDArray[np.float32]:
    middle = middle_mm(shape, height_mm)
    distance = shape_distance_mm(shape, die, u + middle[0], v + middle[1], height_mm=height_mm)
    leans = blow.pile_up_lean > 0.0 or blow.flank_loss > 0.0
    side = _towards(distance, blow.lean_deg) if leans else None
    extra = None
    if factor != 1.0 or blow.tilt_x != 0.0 or blow.tilt_y != 0.0:
        tilt = 1.0 + blow.tilt_x * (u / height_mm) + blow.tilt_y * (v / height_mm)
        extra = die.depth_mm * (factor * np.maximum(tilt, 0.0) - 1.0)
    half_width = None if shape.contours else die.stroke_mm / 2
    z = relief_mm(distance, die, half_width_mm=half_width, extra_depth_mm=extra)
    if side is not None and blow.flank_loss > 0.0:
        # position across the groove: 0 up to its middle, 1 at the wall that is missing
        across = side * np.clip(distance / np.float32(die.stroke_mm / 2) + 1.0, 0.0, 1.0)
        z = np.where(z < 0.0, z * (1.0 - np.float32(blow.flank_loss) * np.clip(across, 0.0, 1.0)), z)
    if side is not None and blow.pile_up_lean > 0.0:
        z = np.where(z > 0.0, z * (1.0 + np.float32(blow.pile_up_lean) * side), z)
    if blow.worn:
        # A chipped or rounded die prints faintly towards one side.
        heading = math.radians(blow.faint_deg)
        across = (u * math.cos(heading) + v * math.sin(heading)) / height_mm
        z = z * (1.0 - 0.6 / (1.0 + np.exp(-(across - 0.25) / 0.08))).astype(np.float32)
    return z


def _towards(distance_mm: NDArray[np.float32], lean_deg: float) -> NDArray[np.float32]:
    down, right = np.gradient(distance_mm)
    length = np.maximum(np.hypot(down, right), np.float32(1e-9))
    lean = math.radians(lean_deg)
    return np.asarray((right * math.cos(lean) + down * math.sin(lean)) / length, dtype=np.float32)
