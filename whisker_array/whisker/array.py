"""The array of whiskers and its raster plan: lines, passes and time.

An array of W whiskers P apart lays lines only P apart; *interlaced* passes, each shifted by one line pitch,
fill the gaps, and the array then moves on by W P to the next block::

      whisker   0         1         2            0: first pass, 1: second pass, shifted by one line pitch
      pass 0    |         |         |            P = interlace * line_pitch
      pass 1     |         |         |
      pass 2      |         |         |

Whiskers wider than their pitch are in several rows, staggered along the trace (`whisker_array.whisker.comb`). A second
comb with another kind of whisker may run on the same lines behind the first. The return of the stage may be used, too:
the array is then *pushed back* over the lines that it was dragged along.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from glyphs.ranges import Count, Finite, NotNegative, Positive, Validated
from glyphs.surface.display import OneLine
from glyphs.surface.maps import TraceDirection
from whisker_array.arrays import Floats
from whisker_array.whisker.comb import WhiskerArray, default_body
from whisker_array.whisker.passes import Pass, SweepPlan, samples_behind
from whisker_array.whisker.sections import WhiskerError

ALL_DIRECTIONS = tuple(TraceDirection)
LINES_PER_HEIGHT = 40
"""Default number of lines per character height: a stroke of h/10 is four lines wide."""
PIECE_LINES = 4
"""Lines per character height over a test piece, which every whisker crosses by itself."""
SAMPLES_PER_LINE_PITCH = 2
SAFE_SPEED_MM_S = 50.0
"""Safe speed of the default whisker for any character height. In the dynamic simulation of stamped grooves of 45
degrees the error of the edge map is 2.4 % at this speed, 5 % at 74 mm/s and 10 % at 97 mm/s
(`tests.proof.small_model`)."""
COMB_STEP_HEIGHTS = 0.1
"""Step of the distance between rows, character heights: a whole number of samples in all usual plans."""
PITCH_TOLERANCE = 1e-3
"""Allowed deviation of whisker pitch over line pitch from a whole number: the accuracy of a comb's manufacture."""


@dataclass(frozen=True, repr=False)
class RasterPlan(OneLine, Validated, error=WhiskerError):
    """Raster of an array over a rectangle of the plate; whiskers share its lines unless `each_whisker` is set."""

    array: WhiskerArray
    region_mm: tuple[Finite, Finite, Finite, Finite]
    line_pitch_mm: Positive
    sample_pitch_mm: Positive
    directions: tuple[TraceDirection, ...] = field(default=ALL_DIRECTIONS)
    speed_mm_s: Positive = SAFE_SPEED_MM_S
    lead_mm: NotNegative = 1.0
    air_samples: Count = 16
    turnaround_s: NotNegative = 0.25
    two_way: bool = False
    each_whisker: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        x0, y0, x1, y1 = self.region_mm
        if not (x1 > x0 and y1 > y0):
            raise WhiskerError(
                f"region_mm {self.region_mm} is empty", hint="give (x0, y0, x1, y1) with x1 > x0, y1 > y0"
            )
        if not self.directions or len(set(self.directions)) != len(self.directions):
            raise WhiskerError("give at least one trace direction, each at most once")
        lines = self.array.pitch_mm / self.line_pitch_mm
        if self.array.n_whiskers > 1 and abs(lines - self.interlace) > PITCH_TOLERANCE:
            raise WhiskerError(
                f"whiskers {self.array.pitch_mm} mm apart cannot trace lines {self.line_pitch_mm} mm apart",
                hint=f"it must divide the whisker pitch, as {self.array.pitch_mm / self.interlace:.6g} does",
            )
        samples_behind(self.array.offset_mm, self.sample_pitch_mm)

    @property
    def interlace(self) -> int:
        """Number of passes that fill the gap between neighbouring whiskers."""
        return max(1, math.ceil(self.array.pitch_mm / self.line_pitch_mm - 1e-9))

    @property
    def sample_rate_hz(self) -> float:
        return self.speed_mm_s / self.sample_pitch_mm

    def sweeps(self) -> tuple[SweepPlan, ...]:
        """The passes of every direction, dragged, then those pushed back."""
        return tuple(replace(first.sweep_plan(), line_mm=line_mm) for first, line_mm in self._ways())

    def passes(self) -> tuple[Pass, ...]:
        return tuple(
            replace(first, line_mm=tuple(lines))
            for first, line_mm in self._ways()
            for lines in line_mm.tolist()
        )

    def _ways(self) -> Iterator[tuple[Pass, Floats]]:
        x0, y0, x1, y1 = self.region_mm
        ways = [(direction, False) for direction in self.directions]
        if self.two_way:
            ways += [(TraceDirection((int(direction) + 180) % 360), True) for direction in self.directions]
        for direction, pushed in ways:
            along_mm, (low, high) = ((x0, x1), (y0, y1)) if direction.along_x else ((y0, y1), (x0, x1))
            line_mm = self._lines_mm(low, high)
            first = Pass(
                direction=direction,
                line_mm=tuple(line_mm[0].tolist()),
                along_mm=along_mm,
                sample_pitch_mm=self.sample_pitch_mm,
                speed_mm_s=self.speed_mm_s,
                lead_mm=self.lead_mm,
                air_samples=self.air_samples,
                turnaround_s=self.turnaround_s,
                pushed=pushed,
                offset_mm=self.array.offset_mm if self.array.stagger_mm > 0.0 else (),
            )
            yield first, line_mm

    def _lines_mm(self, low: float, high: float) -> Floats:
        n_lines = math.floor((high - low) / self.line_pitch_mm + 1e-6) + 1
        whiskers = self.array.n_whiskers
        if self.each_whisker:
            first = np.arange((1 - whiskers) * self.interlace, n_lines)
            index = first[:, None] + self.interlace * np.arange(whiskers)
        else:
            per_block = whiskers * self.interlace
            block, shift, whisker = np.ogrid[: math.ceil(n_lines / per_block), : self.interlace, :whiskers]
            index = (block * per_block + whisker * self.interlace + shift).reshape(-1, whiskers)
        return np.tile(low + self.line_pitch_mm * index, (1, self.array.kinds))

    @property
    def n_samples(self) -> int:
        """Number of samples of the whole scan: passes x whiskers x (air + touching) over all directions."""
        return sum(s.line_mm.size * (s.n_samples + self.air_samples) for s in self.sweeps())

    @property
    def n_passes(self) -> int:
        return sum(s.line_mm.shape[0] for s in self.sweeps())

    @property
    def scan_time_s(self) -> float:
        return math.fsum(len(line_mm) * first.stage_s for first, line_mm in self._ways())


def usual_speed_mm_s(character_height_mm: float) -> float:
    """Usual speed: 10 character heights a second, but at most `SAFE_SPEED_MM_S`."""
    return min(10.0 * character_height_mm, SAFE_SPEED_MM_S)


def default_comb(character_height_mm: float, *, n_whiskers: int = 8, kinds: int = 1) -> WhiskerArray:
    """Default whiskers in one row, one character height apart: at half a height, in two rows a whole whisker apart,
    every pass is longer. A second kind is behind the first."""
    body, step = default_body(character_height_mm), COMB_STEP_HEIGHTS * character_height_mm
    half = 0.5 * character_height_mm
    return WhiskerArray(
        n_whiskers=n_whiskers,
        pitch_mm=half * math.ceil(body.side_room_mm / half),
        kinds=kinds,
        stagger_mm=step * math.ceil(body.full_stagger_mm / step) if kinds > 1 else 0.0,
        body=body,
    )


def default_plan(
    region_mm: tuple[float, float, float, float],
    *,
    character_height_mm: float,
    n_whiskers: int = 8,
    directions: tuple[TraceDirection, ...] = ALL_DIRECTIONS,
    speed_mm_s: float | None = None,
    kinds: int = 1,
    two_way: bool = False,
    lines_per_height: int = LINES_PER_HEIGHT,
) -> RasterPlan:
    """Return a raster scaled to the character height, by default with 40 lines per height and the default comb. The
    sample pitch is always that for 40 lines, because samples cost no stage time."""
    line_pitch = character_height_mm / lines_per_height
    return RasterPlan(
        array=default_comb(character_height_mm, n_whiskers=n_whiskers, kinds=kinds),
        region_mm=region_mm,
        line_pitch_mm=line_pitch,
        sample_pitch_mm=character_height_mm / (LINES_PER_HEIGHT * SAMPLES_PER_LINE_PITCH),
        directions=directions,
        speed_mm_s=speed_mm_s if speed_mm_s is not None else usual_speed_mm_s(character_height_mm),
        lead_mm=0.3 * character_height_mm,
        two_way=two_way,
    )
