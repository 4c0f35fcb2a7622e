"""Stamp a serial on a plate with a hammer or press."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.glyph import Font, Glyph
from glyphs.ranges import require_not_negative, require_positive
from glyphs.stamping.blow import draw_blow, draw_stances, strike
from glyphs.stamping.die import Box, die_glyph, middle_mm, plate_box, to_plate
from glyphs.stamping.errors import StampError
from glyphs.stamping.faces import Die
from glyphs.stamping.forms import PlateForm, along_skin_mm, seen_mm
from glyphs.stamping.layouts import Layout
from glyphs.stamping.plate import plate_form, plate_texture
from glyphs.stamping.variation import StampingVariation
from glyphs.surface.display import OneLine
from glyphs.surface.maps import MAX_PIXELS, HeightMap, MapError


@dataclass(frozen=True, eq=False, repr=False)
class StampedPart(OneLine):
    """A stamped plate and its ground truth; boxes (x0, y0, x1, y1) in the plate frame. Raises ValueError."""

    height_map: HeightMap
    text: str
    height_mm: float
    boxes_mm: tuple[Box, ...]
    font_name: str
    other_text: str = ""
    other_boxes_mm: tuple[Box, ...] = ()
    form: PlateForm = field(default_factory=PlateForm)

    def __post_init__(self) -> None:
        for text, boxes in ((self.text, self.boxes_mm), (self.other_text, self.other_boxes_mm)):
            if len(boxes) != len(text):
                raise ValueError(f"{len(boxes)} boxes for the {len(text)} characters of {text!r}")

    @property
    def inked_mm(self) -> tuple[Box, ...]:
        return self.boxes_mm + self.other_boxes_mm


def stamp_line(
    text: str,
    font: Font,
    die: Die,
    *,
    height_mm: float,
    pitch_mm: float | None = None,
    margin_mm: float | None = None,
    line_rotation_deg: float = 0.0,
    layout: Layout | None = None,
    variation: StampingVariation | None = None,
    raised: bool = False,
    rng: np.random.Generator,
) -> StampedPart:
    """Stamp a line of text, turned clockwise as seen. Raises FontError, StampError or MapError."""
    pitch = height_mm / 100 if pitch_mm is None else pitch_mm
    margin = 0.8 * height_mm if margin_mm is None else margin_mm
    how = StampingVariation() if variation is None else variation
    if not text:
        raise StampError("there is no text to stamp", hint="give at least one character")
    require_positive(StampError, height_mm=height_mm, pitch_mm=pitch)
    require_not_negative(StampError, margin_mm=margin)
    shapes = [die_glyph(font.glyph(char), die, height_mm=height_mm) for char in text]
    if raised:
        die, how = replace(die, burr_height_mm=0.0), replace(how, burr_fraction=0.0)

    lay = Layout() if layout is None else layout
    others = [die_glyph(font.glyph(char), die, height_mm=height_mm) for char in lay.other_text]
    rise = (1.0 + lay.gap) * height_mm * (1.0 if lay.other_above else -1.0)
    placed = partial(
        _places,
        layout=lay,
        height_mm=height_mm,
        length_mm=height_mm * sum(shape.advance for shape in shapes),
        rotation_deg=line_rotation_deg + lay.turned_deg,
    )
    places, extent = placed(shapes)
    if others:
        more, wider = placed(others, up_mm=rise)
        places = places + more
        extent = _hull(extent, wider)
    form = how.plate.form
    x = _axis(extent[2] - extent[0] + 2 * margin, pitch, form.radius_x_mm)
    y = _axis(extent[3] - extent[1] + 2 * margin, pitch, form.radius_y_mm)
    if x.seen_mm.size * y.seen_mm.size > MAX_PIXELS:
        raise MapError(
            f"{y.seen_mm.size} x {x.seen_mm.size} samples exceed the limit of {MAX_PIXELS:,}",
            hint=f"use a coarser pitch_mm than {pitch}",
        )

    relief = np.zeros((y.seen_mm.size, x.seen_mm.size), dtype=np.float32)
    boxes: list[Box] = []
    stances = draw_stances(how, len(places), rng=rng)
    for shape, (place_x, place_y, turn), stance in zip(shapes + others, places, stances, strict=True):
        corner = (place_x + margin - extent[0], place_y + margin - extent[1])
        blow = draw_blow(how, stance, rng, at_mm=corner, height_mm=height_mm, rotation_deg=turn)
        x0, y0, x1, y1 = strike(relief, x.skin_mm, y.skin_mm, shape, die, blow, height_mm=height_mm)
        boxes.append((x.seen(x0), y.seen(y0), x.seen(x1), y.seen(y1)))
    finish = how.plate.texture or partial(plate_texture, variation=how.plate)
    texture = finish(x.seen_mm, y.seen_mm, rng=rng)
    if how.plate.ironing > 0.0:
        texture *= 1.0 - np.float32(how.plate.ironing) * np.clip(-relief / np.float32(die.depth_mm), 0.0, 1.0)
    z = plate_form(x.seen_mm, y.seen_mm, how.plate, rng=rng) + texture + (-relief if raised else relief)
    return StampedPart(
        HeightMap(z, pitch), text, height_mm, tuple(boxes[: len(text)]), font.name,
        lay.other_text, tuple(boxes[len(text) :]), form,
    )  # fmt: skip


@dataclass(frozen=True)
class _Axis:
    seen_mm: NDArray[np.float64]
    skin_mm: NDArray[np.float64]

    def seen(self, skin_mm: float) -> float:
        if self.skin_mm is self.seen_mm:
            return skin_mm
        return float(np.interp(skin_mm, self.skin_mm, self.seen_mm))


def _axis(skin_mm: float, pitch_mm: float, radius_mm: float) -> _Axis:
    width = skin_mm if math.isinf(radius_mm) else 2 * seen_mm(skin_mm / 2, radius_mm)
    count = max(2, math.ceil(width / pitch_mm - 1e-6) + 1)
    if count > MAX_PIXELS:
        raise MapError(
            f"{count:,} samples in a row exceed the limit", hint=f"use a coarser pitch_mm than {pitch_mm}"
        )
    seen = np.arange(count, dtype=np.float64) * np.float64(pitch_mm)
    if math.isinf(radius_mm):
        return _Axis(seen, seen)
    return _Axis(seen, along_skin_mm(seen - seen[-1] / 2, radius_mm) + skin_mm / 2)


def _places(
    shapes: list[Glyph],
    *,
    layout: Layout,
    height_mm: float,
    length_mm: float,
    rotation_deg: float,
    up_mm: float = 0.0,
) -> tuple[list[tuple[float, float, float]], Box]:
    origin = 0.0
    places, boxes = [], []
    for shape in shapes:
        mx, my = middle_mm(shape, height_mm)
        along, up, turn = layout.place(origin + mx, my + up_mm, length_mm=length_mm)
        x, y = to_plate(along, up, rotation_deg=rotation_deg)
        places.append((float(x), float(y), rotation_deg + turn))
        start = (float(x), float(y))
        boxes.append(plate_box(shape, start, rotation_deg + turn, height_mm=height_mm, grow_mm=0.0))
        origin += shape.advance * height_mm
    return places, _hull(*boxes)


def _hull(*boxes: Box) -> Box:
    low_x, low_y, high_x, high_y = zip(*boxes, strict=True)
    return min(low_x), min(low_y), max(high_x), max(high_y)
