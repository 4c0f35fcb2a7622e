"""Possible next steps: one or more passes between those that were felt before.

A step adds one line per half character height, by one travel of the array for each block of the region, or two if the
whiskers are a height apart. A block is as wide as the array::

    ALONG, BACK:   ============   lines laid by one travel      CROSS:   | | | | | | | |   one block
                   ------------   the next, half way between             : : : : : : : :   the next, between
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from glyphs.surface.display import OneLine
from glyphs.surface.maps import TraceDirection
from whisker_array.scan.session import Fitting
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAMPLES_PER_LINE_PITCH
from whisker_array.whisker.passes import Pass

Region = tuple[float, float, float, float]

FIRST = 4
"""Lines per half character height of the first step over a part: 8 per character height."""
JOINED = 2
"""Lines per half character height of the first step in each further direction."""
MOST = 16
"""Maximum number of lines per half character height in one direction."""
LEAD_HEIGHTS = 0.3
"""Lead-in and lead-out of a pass, character heights."""
RIM_HEIGHTS = 0.5
"""Width at either edge of a region that need not be felt, character heights: too narrow for a character."""


class Way(StrEnum):
    """Directions of a step."""

    direction: TraceDirection
    # shift of its lines, in sixteenths of a character height: lines on the way back lie half way between the
    # first eight
    shift: float
    purpose: str

    def __new__(
        cls,
        value: str,
        direction: TraceDirection = TraceDirection.FORWARD_X,
        shift: float = 0.0,
        purpose: str = "",
    ) -> Self:
        member = str.__new__(cls, value)
        member._value_, member.direction, member.shift, member.purpose = value, direction, shift, purpose
        return member

    ALONG = "along", TraceDirection.FORWARD_X, 0.0, "lines along x between those felt"
    BACK = "back", TraceDirection.BACK_X, 0.5, "the other side of the walls"
    CROSS = "cross", TraceDirection.FORWARD_Y, 0.0, "across the line"
    CROSS_BACK = "cross back", TraceDirection.BACK_Y, 0.5, "across the line, the other way"


@dataclass(frozen=True, repr=False)
class Step(OneLine):
    """Passes that are felt before the next look; `lines` per half character height in this direction after it."""

    way: Way
    lines: int
    passes: tuple[Pass, ...]

    @property
    def stage_s(self) -> float:
        return math.fsum(p.stage_s for p in self.passes)


def next_step(
    fitting: Fitting, region_mm: Region, way: Way, lines: int, *, joins: bool = False
) -> Step | None:
    """Plan the next step in a direction that has `lines` per half height already; None if that is complete."""
    if lines >= MOST:
        return None
    upto = lines + 1 if lines else JOINED if joins else FIRST
    travels = max(1, round(2.0 * fitting.array.pitch_mm / fitting.height_mm))
    passes = [
        p
        for k in range(travels * lines, travels * upto)
        for p in _lay_travels(fitting, region_mm, way, between(k) + way.shift / 8.0 / travels)
    ]
    return Step(way, upto, tuple(passes))


def between(k: int) -> float:
    """Return term k of the van der Corput sequence: 0, 1/2, 1/4, 3/4, 1/8 ..., each far from all before it."""
    # the binary digits of k, mirrored at the point
    return int(f"{k:b}"[::-1], 2) / 2.0 ** k.bit_length()


def _stretch_to_cover(
    across: tuple[float, float], field: tuple[float, float], *, rim_mm: float
) -> tuple[float, float]:
    cut = [abs(a - b) < 1e-6 for a, b in zip(across, field, strict=True)]
    low = across[0] + (0.0 if cut == [True, False] else rim_mm)
    high = across[1] - (0.0 if cut == [False, True] else rim_mm)
    return (low, high) if high > low else (0.5 * (low + high),) * 2


def _lay_travels(fitting: Fitting, region_mm: Region, way: Way, share: float) -> list[Pass]:
    array, height = fitting.array, fitting.height_mm
    along_x = way.direction.along_x
    (x0, y0, x1, y1), (left, top, right, bottom) = region_mm, fitting.field_mm
    along, across = ((x0, x1), (y0, y1)) if along_x else ((y0, y1), (x0, x1))
    start, within = (left, (top, bottom)) if along_x else (top, (left, right))
    origin, pitch = within[0], array.pitch_mm
    low, high = _stretch_to_cover(across, within, rim_mm=RIM_HEIGHTS * height)
    blocks = max(1, math.ceil((high - low) / (pitch * array.n_whiskers) - 1e-9))
    # centre this travel's lines on the range to cover, as nearly as whole pitches allow: all travels of a step
    # together then cover the width of the blocks, evenly to both sides
    lines = blocks * array.n_whiskers
    first = round((0.5 * (low + high) - origin) / pitch - share - 0.5 * (lines - 1))
    step_mm = height / LINES_PER_HEIGHT / SAMPLES_PER_LINE_PITCH
    begin = start + step_mm * round((along[0] - start) / step_mm)
    return [
        Pass(
            direction=way.direction,
            line_mm=tuple(
                origin + pitch * (first + block * array.n_whiskers + i + share)
                for i in range(array.n_whiskers)
            ),
            along_mm=(begin, along[1]),
            sample_pitch_mm=step_mm,
            speed_mm_s=fitting.speed_mm_s,
            lead_mm=LEAD_HEIGHTS * height,
            offset_mm=array.offset_mm if array.stagger_mm > 0.0 else (),
        )
        for block in range(blocks)
    ]
