"""A pass: one travel of the array over a stretch of the plate, and the stage time that it takes.

::

      air      lead-in        the stretch of interest          lead-out
    (lifted) |----------|===================================|----------|  turnaround: lift, move, set down
              start_mm   along_mm[0]             along_mm[1]

    rows of a comb are one behind the other (offset_mm): the last row reaches a position long after the first, so the
    array runs further by the offset of the last row, and moves back by the same distance

A raster is a sequence of passes (`RasterPlan.passes`); a stage session runs them one by one, in any order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.ranges import Count, Finite, NotNegative, Positive, Validated
from glyphs.surface.display import OneLine
from glyphs.surface.maps import TraceDirection
from whisker_array.arrays import Floats
from whisker_array.whisker.sections import WhiskerError

RAPID_MM_S = 300.0
"""Speed of a lifted array over a stagger (assumed, like the time of a turnaround)."""
SAMPLES_TOLERANCE = 1e-3


def samples_behind(offset_mm: Iterable[float], sample_pitch_mm: float) -> NDArray[np.intp]:
    """Samples by which each whisker reaches a position later than the foremost row. Raises WhiskerError."""
    behind = np.asarray(tuple(offset_mm), dtype=np.float64) / sample_pitch_mm
    whole = np.rint(behind).astype(np.intp)
    if behind.size and (not np.isfinite(behind).all() or whole.min() < 0):
        raise WhiskerError("a row is ahead of the foremost one", hint="count offsets from the foremost row")
    if behind.size and np.abs(behind - whole).max() > SAMPLES_TOLERANCE * max(1.0, float(behind.max())):
        raise WhiskerError(
            f"rows {max(offset_mm):.6g} mm one behind the other do not reach the positions of samples "
            f"{sample_pitch_mm:.6g} mm apart",
            hint="the sample pitch must divide the stagger of the rows",
        )
    return whole


@dataclass(frozen=True, eq=False, repr=False)
class SweepPlan(OneLine):
    """Passes in one trace direction that begin and end at the same positions.

    `line_mm` (passes, whiskers) is the lateral plate coordinate of each trace (y for 0/180 deg, x for 90/270); with
    several kinds, whiskers of the first kind come first. `step_mm` is positive; if the direction is backward, positions
    decrease from `start_mm`. `offset_mm` is the distance of each whisker behind the foremost row, along the trace;
    empty: all level.
    """

    direction: TraceDirection
    line_mm: Floats
    start_mm: float
    step_mm: float
    n_samples: int
    n_lead: int
    pushed: bool = False
    offset_mm: tuple[float, ...] = ()

    @property
    def behind(self) -> NDArray[np.intp]:
        """(whiskers,) samples by which each whisker reaches a position later than the foremost row."""
        offsets = self.offset_mm or (0.0,) * int(self.line_mm.shape[1])
        return samples_behind(offsets, self.step_mm)

    def lines_in_order(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
        """Order of all lines across the plate, from passes first; whisker and position of each in that order."""
        order = np.argsort(self.line_mm, axis=None, kind="stable")
        return order, order % self.line_mm.shape[1], self.line_mm.ravel()[order]

    def of(self, whiskers: slice | NDArray[np.intp]) -> SweepPlan:
        offsets = np.asarray(self.offset_mm)[whiskers].tolist() if self.offset_mm else ()
        return replace(self, line_mm=self.line_mm[:, whiskers], offset_mm=tuple(offsets))

    def position_mm(self) -> Floats:
        """(samples,) plate coordinate along the trace of each touching sample, the same for every row."""
        step_mm = self.direction.sign * self.step_mm
        return self.start_mm + step_mm * np.arange(self.n_samples, dtype=np.float64)


@dataclass(frozen=True, repr=False)
class Pass(OneLine, Validated, error=WhiskerError):
    """One travel of the array; the default preload is that of the touch. Raises WhiskerError."""

    direction: TraceDirection
    line_mm: tuple[Finite, ...]
    along_mm: tuple[Finite, Finite]
    sample_pitch_mm: Positive
    speed_mm_s: Positive
    lead_mm: NotNegative = 1.0
    air_samples: Count = 16
    turnaround_s: NotNegative = 0.25
    pushed: bool = False
    preload_mm: Positive | None = None
    offset_mm: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.line_mm:
            raise WhiskerError("a pass needs a position for every whisker", hint="give line_mm")
        if not self.along_mm[1] > self.along_mm[0]:
            raise WhiskerError(f"the stretch {self.along_mm} is empty", hint="give (least, greatest)")
        if len(self.offset_mm) not in (0, len(self.line_mm)):
            raise WhiskerError(
                f"{len(self.offset_mm)} offsets for {len(self.line_mm)} whiskers", hint="give one for each"
            )
        samples_behind(self.offset_mm, self.sample_pitch_mm)

    @property
    def n_lead(self) -> int:
        return round(self.lead_mm / self.sample_pitch_mm)

    @property
    def n_core(self) -> int:
        return math.floor((self.along_mm[1] - self.along_mm[0]) / self.sample_pitch_mm + 1e-6) + 1

    @property
    def n_samples(self) -> int:
        return self.n_core + 2 * self.n_lead

    @property
    def start_mm(self) -> float:
        lead = self.n_lead * self.sample_pitch_mm
        if self.direction.backward:
            return self.along_mm[0] + (self.n_core - 1) * self.sample_pitch_mm + lead
        return self.along_mm[0] - lead

    @property
    def sample_rate_hz(self) -> float:
        return self.speed_mm_s / self.sample_pitch_mm

    @property
    def stage_s(self) -> float:
        """Stage time: air, lead-in, stretch, lead-out and stagger at tracing speed, then the turnaround."""
        tracing = (self.n_samples + self.air_samples) / self.sample_rate_hz
        return tracing + self.turnaround_s + self.stagger_mm * (1.0 / self.speed_mm_s + 1.0 / RAPID_MM_S)

    @property
    def stagger_mm(self) -> float:
        """Distance of the last row behind the first, by which the array runs and moves back further."""
        return max(self.offset_mm, default=0.0)

    def sweep_plan(self) -> SweepPlan:
        return SweepPlan(
            direction=self.direction,
            line_mm=np.array([self.line_mm], dtype=np.float64),
            start_mm=self.start_mm,
            step_mm=self.sample_pitch_mm,
            n_samples=self.n_samples,
            n_lead=self.n_lead,
            pushed=self.pushed,
            offset_mm=self.offset_mm,
        )

    def moved(self, x_mm: float, y_mm: float) -> Pass:
        along, across = (x_mm, y_mm) if self.direction.along_x else (y_mm, x_mm)
        return replace(
            self,
            line_mm=tuple(v + across for v in self.line_mm),
            along_mm=(self.along_mm[0] + along, self.along_mm[1] + along),
        )

    def describe(self) -> str:
        harder = "" if self.preload_mm is None else f", preload {self.preload_mm:.2f} mm"
        back = " pushed" if self.pushed else ""
        return (
            f"{int(self.direction)}°{back}, {self.along_mm[0]:.1f} to {self.along_mm[1]:.1f} mm, "
            f"{len(self.line_mm)} whiskers from {min(self.line_mm):.2f} mm{harder}, {self.stage_s:.2f} s"
        )
