"""Design an array and its plan for the least stage time at a required accuracy.

    whisker (width, inclination) -> body -> pitch -> rows and stagger -> comb
    accuracy        -> plans measured to reach it (lines per height, directions)
    allowed error   -> fastest speed of that whisker                                      } -> stage seconds

For every number of whiskers, the quickest of all combinations is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated

import numpy as np

from glyphs.ranges import Positive, Range, ShareBelowOne, Validated
from glyphs.surface.display import OneLine
from glyphs.surface.maps import TraceDirection
from whisker_array.design.limits import DesignError
from whisker_array.design.plan_accuracy import PlanCounts, describe_directions, measured_plans
from whisker_array.design.search import sides_mm
from whisker_array.whisker.array import COMB_STEP_HEIGHTS, RasterPlan, default_plan
from whisker_array.whisker.comb import Body, WhiskerArray, body_of, least_rows, least_stagger_mm
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.sections import Rectangle
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import default_touch

ARRAY_SIZES = (1, 2, 4, 6, 8, 12, 16, 24, 32, 48)
WIDTHS_THICKNESSES = (15.0, 6.0)
"""Width over thickness of ribbons: the default, and a narrow one, still 17 times as stiff sideways as upwards."""
BETAS_DEG = (0.0, 15.0)
SPEED_BY_ERROR = {0.01: 29.0, 0.02: 39.0, 0.05: 73.0, 0.1: 97.0}
"""Error of the edge map, as a share of its signal, and the fastest speed that keeps it, mm/s, for all heights: computed
with a whisker that has mass, over stamped grooves of 45 degrees (`tests.proof.small_model`)."""
MOST_BLOCKS = 4
LENGTH_HEIGHTS, BESIDE_HEIGHTS = 6.5, 0.5
"""Length of a line of eight characters, and land around it, character heights."""


@dataclass(frozen=True)
class ArrayRequest(Validated, error=DesignError):
    """Use of an array: characters, accuracy and dirt of a measured severity."""

    character_height_mm: Positive
    accuracy: Annotated[Positive, ShareBelowOne] = 0.98
    severity: float = 0.3
    length_mm: Positive | None = None
    speed_error: Annotated[float, Range(0.01, 0.1)] = 0.05

    @property
    def region_mm(self) -> tuple[float, float, float, float]:
        h = self.character_height_mm
        length = self.length_mm or LENGTH_HEIGHTS * h
        return (0.0, 0.0, length + 2.0 * BESIDE_HEIGHTS * h, (1.0 + 2.0 * BESIDE_HEIGHTS) * h)


@dataclass(frozen=True, eq=False, repr=False)
class ArrayChoice(OneLine):
    """An array, its plan, and their accuracy and time."""

    whisker: LShaped
    plan: RasterPlan
    measured: PlanCounts

    @property
    def stage_s(self) -> float:
        return self.plan.scan_time_s


@cache
def _stagger_mm(body: Body, rows: int, step_mm: float) -> float:
    # any two of the rows that `least_rows` takes overlap sideways
    return least_stagger_mm(body, WhiskerArray(rows, body.width_mm / rows, rows=rows), step_mm=step_mm)


def _builds(request: ArrayRequest) -> Iterator[tuple[LShaped, Body]]:
    h = request.character_height_mm
    usual, touch = default_whisker(h), default_touch(h)
    thick, _ = sides_mm(usual)
    for width in WIDTHS_THICKNESSES:
        for beta in BETAS_DEG:
            section = Rectangle(thickness_mm=thick, width_mm=width * thick)
            whisker = replace(usual, section=section, beta_rad=math.radians(beta))
            yield whisker, body_of(whisker, preload_mm=touch.preload_mm, mu=touch.friction)


def _interlaces(request: ArrayRequest, body: Body, *, n_whiskers: int, lines: int) -> set[int]:
    pitch = request.character_height_mm / lines
    x0, y0, x1, y1 = request.region_mm
    interlaces = {math.ceil(body.side_room_mm / pitch - 1e-9)}
    for across in (x1 - x0, y1 - y0):
        n_lines = math.floor(across / pitch + 1e-6) + 1
        interlaces |= {math.ceil(n_lines / (n_whiskers * blocks)) for blocks in range(1, MOST_BLOCKS + 1)}
    return interlaces


def _choices(
    request: ArrayRequest,
    builds: Mapping[LShaped, Body],
    plans: Sequence[PlanCounts],
    n_whiskers: int,
) -> Iterator[ArrayChoice]:
    h = request.character_height_mm
    speed = float(np.interp(request.speed_error, list(SPEED_BY_ERROR), list(SPEED_BY_ERROR.values())))
    for counts in plans:
        usual = default_plan(
            request.region_mm, character_height_mm=h, n_whiskers=1, speed_mm_s=speed,
            directions=tuple(TraceDirection(d) for d in counts.directions), lines_per_height=counts.lines,
        )  # fmt: skip
        for whisker, body in builds.items():
            for interlace in _interlaces(request, body, n_whiskers=n_whiskers, lines=counts.lines):
                pitch = interlace * usual.line_pitch_mm
                rows = least_rows(body, pitch_mm=pitch, n_whiskers=n_whiskers)
                stagger = _stagger_mm(body, rows, COMB_STEP_HEIGHTS * h)
                points = WhiskerArray(n_whiskers, pitch, rows=rows, stagger_mm=stagger)
                yield ArrayChoice(whisker, replace(usual, array=points), counts)


def design_arrays(
    request: ArrayRequest,
    *,
    sizes: Sequence[int] = ARRAY_SIZES,
    counts: Sequence[PlanCounts] | None = None,
) -> tuple[ArrayChoice, ...]:
    """Find the quickest array and plan for each number of whiskers. Raises DesignError if none is accurate enough."""
    known = tuple(counts) if counts is not None else measured_plans()
    there = [c for c in known if math.isclose(c.severity, request.severity)]
    if not there:
        dirts = ", ".join(f"{s:g}" for s in sorted({c.severity for c in known}))
        raise DesignError(
            f"no plan was measured at dirt {request.severity:g}", hint=f"plans were measured at {dirts}"
        )
    accepted = [c for c in there if c.accuracy >= request.accuracy]
    if not accepted:
        best = max(there, key=lambda c: c.accuracy)
        raise DesignError(
            f"no measured plan reads {100 * request.accuracy:g} % of the characters at dirt {request.severity:g}",
            hint=f"ask for {math.floor(1000 * best.accuracy) / 1000:g} or less ({best.lines} lines per height, "
            f"{describe_directions(best.directions)})",
        )
    builds = dict(_builds(request))
    chosen = []
    for n in sizes:
        quickest = min(_choices(request, builds, accepted, n), key=lambda c: c.stage_s)
        # building the comb with its body checks that whiskers have room
        array = replace(quickest.plan.array, body=builds[quickest.whisker])
        chosen.append(replace(quickest, plan=replace(quickest.plan, array=array)))
    return tuple(chosen)
